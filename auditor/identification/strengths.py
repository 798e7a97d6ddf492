"""How strongly the symptoms of a frame speak for each cause that is not an attack."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auditor.identification.parameters import FAULT_SCORES, TEMPORAL_WINDOW
from auditor.identification.windows import window_means
from auditor.results import Cause, CauseIn
from auditor.rig import LIDAR
from auditor.symptoms import Pair, lead

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Observed:
    """What was observed in F frames: `columns` holds (F, P) values by the names of `symptoms.COLUMNS`.

    `pairs` are the P matched pairs (i, k). `level` and `saturated` are (F, C), mean grey level and saturated share of
    the `cameras`. NaN where not measured.
    """

    pairs: tuple[Pair, ...]
    columns: Mapping[str, Floats]
    cameras: tuple[int, ...]
    level: Floats
    saturated: Floats


def strengths(seen: Observed, stamp_ns: NDArray[np.int64], sensors: Sequence[int]) -> dict[CauseIn, Floats]:
    """(F,) strength of each cause over the half second around each frame (dirt: two); 1 is just enough.

    `stamp_ns` (F,) are the frames' stamps. NaN where nothing was measured.
    """
    found: dict[CauseIn, Floats] = {}
    for camera in seen.cameras:
        found[Cause.LATE, camera] = _late(seen, camera)
        found[Cause.DISPLACED, camera] = _displaced(seen, camera)
        found[Cause.SOILED, camera] = _darker(seen, camera) / FAULT_SCORES.soiled
    if LIDAR in sensors:
        found[Cause.LATE, LIDAR] = _late_lidar(seen)
        found[Cause.DISPLACED, LIDAR] = _turned(seen)
        found[Cause.RAIN, LIDAR] = _rain(seen)
    begins, enough = FAULT_SCORES.dark_from, FAULT_SCORES.dark
    found[Cause.DARK, None] = (begins - np.fmax.reduce(seen.level.T)) / (begins - enough)
    found[Cause.GLARE, None] = np.fmin.reduce(seen.saturated.T) / FAULT_SCORES.glare
    usual, soiled = TEMPORAL_WINDOW.seconds, TEMPORAL_WINDOW.soiled_seconds
    seconds = {who: soiled if who[0] is Cause.SOILED else usual for who in found}
    return {who: window_means(values[:, None], stamp_ns, seconds[who])[:, 0] for who, values in found.items()}


def _late(seen: Observed, camera: int) -> Floats:
    """A camera lags where all its pairs find more points on one row once it is taken for a frame earlier."""
    columns = seen.columns
    now = np.fmax(columns["in_step"], columns["offset_share"])
    gains = [(columns["late_i" if camera == i else "late_k"] - now)[:, p] for p, (i, _) in _with(seen, camera)]
    return _least(gains, seen) / FAULT_SCORES.late_camera


def _displaced(seen: Observed, camera: int) -> Floats:
    """A camera has turned where all its pairs, and no others, are off by one constant: in rows, or in disparities."""
    columns = seen.columns
    offset, bias = np.abs(columns["offset_px"]), np.abs(columns["bias_px"])
    tilted = np.where(offset >= FAULT_SCORES.tilted_by_px, columns["offset_share"] - columns["in_step"], 0.0)
    biased = np.where(bias >= FAULT_SCORES.biased_by_px, columns["biased"] - columns["agreeing"], 0.0)
    tilted, biased = (_alone(seen, camera, gain) for gain in (tilted, biased))
    return np.fmax(tilted / FAULT_SCORES.tilted, biased / FAULT_SCORES.biased)


def _late_lidar(seen: Observed) -> Floats:
    """The LiDAR lags where most points that tell two frames apart agree with stereo of the one before."""
    return _mean(lead(seen.columns["before_only"], seen.columns["now_only"])) / FAULT_SCORES.late_lidar


def _turned(seen: Observed) -> Floats:
    """The LiDAR has turned where most points that tell agree with stereo of every pair once all are moved alike.

    Where a constant bias of a pair's disparities does as well its cameras have turned instead.
    """
    columns = seen.columns
    moved = lead(columns["turned_only"], columns["unturned_only"])
    cameras = (np.abs(columns["bias_px"]) >= FAULT_SCORES.biased_by_px) & (columns["biased"] >= columns["turned"])
    return _least(list(np.where(cameras, np.minimum(moved, 0), moved).T), seen) / FAULT_SCORES.turned_lidar


def _rain(seen: Observed) -> Floats:
    """Drops stand alone near the LiDAR; spoofed points at chance ranges do so farther away nearly as often."""
    beyond = FAULT_SCORES.rain_beyond * seen.columns["specks_beyond"]
    return _mean(seen.columns["specks_near"] - beyond) / FAULT_SCORES.rain


def _with(seen: Observed, camera: int) -> list[tuple[int, Pair]]:
    return [(p, pair) for p, pair in enumerate(seen.pairs) if camera in pair]


def _alone(seen: Observed, camera: int, gain: Floats) -> Floats:
    """The least gain of the camera's pairs, less the largest of the others: those cannot be its doing."""
    inside = _least([gain[:, p] for p, _ in _with(seen, camera)], seen)
    outside = [gain[:, p] for p, pair in enumerate(seen.pairs) if camera not in pair]
    return inside - np.maximum(np.nan_to_num(np.fmax.reduce(outside)), 0) if outside else inside


def _darker(seen: Observed, camera: int) -> Floats:
    """(F,) by how many grey levels a camera is at least darker than its partners where they are unlike.

    A partner that is as much brighter than others is itself what has changed.
    """
    unlike, difference = seen.columns["unlike_px"], seen.columns["difference"]
    found = []
    for p, (i, k) in _with(seen, camera):
        partner = i if camera == k else k
        darker = difference[:, p] * (1.0 if camera == i else -1.0)
        enough = FAULT_SCORES.soiled_partner * unlike[:, p]
        others = [
            np.where(unlike[:, q] > enough, difference[:, q] * (1.0 if partner == pair[1] else -1.0), 0.0)
            for q, pair in _with(seen, partner)
            if q != p
        ]
        usual = np.fmax(np.fmax.reduce(others), 0.0) if others else 0.0
        found.append(np.where(unlike[:, p] >= FAULT_SCORES.soiled_fewest, darker - usual, 0 * unlike[:, p]))
    return _least(found, seen)


def _mean(values: Floats) -> Floats:
    """(F,) the means of what was measured in each row of (F, P), NaN where nothing was."""
    measured = ~np.isnan(values)
    count = measured.sum(axis=1)
    return np.asarray(np.where(count > 0, np.where(measured, values, 0).sum(axis=1) / np.maximum(count, 1), np.nan))


def _least(values: Sequence[Floats], seen: Observed) -> Floats:
    """(F,) the least of those measured, NaN where none was."""
    return np.asarray(np.fmin.reduce(values)) if len(values) else np.full(len(seen.level), np.nan)
