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
from auditor.identification.statistics import NANOSECONDS
from auditor.model.arrays import Floats, Integers
from auditor.model.checks import IMAGE_CHECKS, Check

_AT_ONCE = 4096
"""Frames whose windows are in memory at once."""

BACKGROUND_CHECKS = frozenset({*IMAGE_CHECKS, Check.ISOLATED_POINTS, Check.POINT_DROPOUT, Check.LOST_RETURNS})
"""The checks whose clean frames are raised in rows; LiDAR conflicts are in single ones, light in rows in none."""


def background(levels: Floats, limit: float) -> Floats:
    """By how much z the limit is raised where checks showed such `levels` before; as little as on any road of -inf."""
    return np.clip(levels + INCIDENTS.over_background - limit, INCIDENTS.least_background, INCIDENTS.most_background)


def levels_before(z: Floats, periods_s: Floats, runs: Integers, places: Integers) -> Floats:
    """(P, C) the z that a fifth of the frames before each of P places showed, of (F, C) scores of C checks.

    -inf where fewer frames of its run (F,) were measured before it. `periods_s` (F,) are the times between two frames
    of its run, NaN of a lone frame. The share is that of a strobe's attacked frames.
    """
    firsts, periods = np.searchsorted(runs, runs[places]), periods_s[places]
    levels = np.full((len(places), z.shape[1]), -np.inf)
    for one in range(0, len(places), _AT_ONCE):
        part = slice(one, one + _AT_ONCE)
        for period in np.unique(periods[part][~np.isnan(periods[part])]):
            at = one + np.flatnonzero(periods[part] == period)
            before = places[at, None] - _window(float(period))
            first = firsts[at, None]
            values = z[np.maximum(before, first)]
            values[np.isnan(values) | (before < first)[:, :, None]] = -np.inf
            place = before.shape[1] - ceil(before.shape[1] * INCIDENTS.duty)
            levels[at] = np.partition(values, place, axis=1)[:, place]
    return levels


def _window(period_s: float) -> Integers:
    """(W,) how many frames before a frame those of its background are: all of the time, or so many of a fast camera."""
    period = max(period_s, 1 / NANOSECONDS)
    nearest = max(round(INCIDENTS.background_until_s / period), 1)
    farthest = max(round(INCIDENTS.background_s / period), nearest + INCIDENTS.background_frames - 1)
    frames = min(farthest - nearest + 1, INCIDENTS.most_background_frames)
    return np.rint(np.linspace(nearest, farthest, frames)).astype(np.int64)
