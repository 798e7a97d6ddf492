"""The background of a stretch of road: what checks showed in the seconds before a frame.

A low sun in one lens, foliage before a bright sky and wet ground raise the same check for seconds, hardly above its
limit, and frames of one stretch are no independent evidence. An attack begins suddenly. So a frame speaks for an
incident by what its checks exceed a local level by, as in detection at a constant false-alarm rate (CFAR; Finn and
Johnson, RCA Review 1968), with two differences: the level is bounded, since an attack may last or rise slowly, and it
is never below the limit that all clean roads share.
"""

from math import ceil

import numpy as np

from auditor.identification.evidence_parameters import INCIDENTS
from auditor.identification.incidents import periods_of
from auditor.model.arrays import Floats, Integers
from auditor.model.checks import IMAGE_CHECKS, Check

BACKGROUND_CHECKS = frozenset({*IMAGE_CHECKS, Check.ISOLATED_POINTS})
"""The checks whose clean frames are raised in rows; those of the LiDAR by cameras are raised in single ones."""


def background(levels: Floats, limit: float) -> Floats:
    """By how much z the limit is raised where checks showed such `levels` before; as little as on any road of -inf."""
    return np.clip(levels + INCIDENTS.over_background - limit, INCIDENTS.least_background, INCIDENTS.most_background)


def levels_before(z: Floats, stamps_ns: Integers, runs: Integers, places: Integers) -> Floats:
    """(P, C) the z that a fifth of the frames before each of P places showed, of (F, C) scores of C checks.

    -inf where fewer frames of its run (F,) were measured before it. The share is that of a strobe's attacked frames.
    """
    levels = np.full((len(places), z.shape[1]), -np.inf)
    known = np.where(np.isnan(z), -np.inf, z)
    periods = periods_of(stamps_ns, runs)
    for run in np.unique(runs[places]):
        own = np.flatnonzero(runs == run)
        first, period = int(own[0]), float(periods[own[0]])
        if np.isnan(period):  # a lone frame
            continue
        frames, gap = _window(period)
        at = np.flatnonzero(runs[places] == run)
        window = places[at][:, None] - gap - np.arange(frames)
        values = np.where((window >= first)[:, :, None], known[np.maximum(window, first)], -np.inf)
        rank = ceil(frames * INCIDENTS.duty)
        levels[at] = np.partition(values, frames - rank, axis=1)[:, frames - rank]
    return levels


def _window(period_s: float) -> tuple[int, int]:
    """How many frames a window before a frame has, and how many frames before it the last of them is."""
    gap = max(round(INCIDENTS.background_until_s / period_s), 1)
    until = round(INCIDENTS.background_s / period_s)
    return max(until - gap + 1, INCIDENTS.background_frames), gap
