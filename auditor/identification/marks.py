"""What a judgement must say of the calibration that it was reached by, beside its thresholds.

A calibration is of the LiDAR that made it, and so many points of it fall into the view. A LiDAR of half the rings has
half of them, and more of them are isolated.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from math import atan, log2, nan

import numpy as np

from auditor.identification.parameters import OTHER_LIDAR
from auditor.model.arrays import Floats
from auditor.model.calibration import Calibration, CleanFrames, Marks, RobustThresholds
from auditor.model.checks import Check
from auditor.model.rig import Rig
from auditor.model.rig_kind import Similarity

OPENCV, OPENCV_CPU = "opencv-python-headless", "opencv_cpu"
"""Names in a measurement's versions: of OpenCV, and of the CPU's instruction sets that it uses."""

MACHINE = (OPENCV, OPENCV_CPU)
"""The versions on which counts depend: a clean recording of a calibration keeps them."""


def marks_of(
    calibration: Calibration, similarity: Similarity, recording_id: str, halvings: float, versions: Mapping[str, str]
) -> Marks:
    """The marks of a judgement of a recording: `versions` are those that it was measured with, `halvings` see below."""
    return Marks(
        similarity=similarity,
        in_sample=recording_id in calibration.recordings,
        other_lidar=is_another_lidar(halvings),
        measured_otherwise=_measured_otherwise(calibration.clean, versions),
    )


def halvings_of_points(clean: Sequence[CleanFrames], rig: Rig, returns: Floats) -> float:
    """How many times the LiDAR's usual points in view are half of those of clean drives; negative where it has more.

    `returns` (F,) are the points in view of a recording's frames, NaN where there was no LiDAR. Without any clean drive
    they are compared with those of the LiDARs that the prior was fitted on. NaN where nothing is known of either.
    """
    usual, own = _usual_returns(tuple(clean)) if clean else _of_prior(rig), _median(returns)
    return log2(usual / own) if usual > 0 and own > 0 else nan


def is_another_lidar(halvings: float) -> bool:
    """Whether so many halvings of the points in view make another LiDAR of it; NaN does not."""
    return abs(halvings) > log2(OTHER_LIDAR.factor)


def for_sparser_lidar(thresholds: RobustThresholds, halvings: float) -> RobustThresholds:
    """The thresholds for a LiDAR of fewer points: more of them have no neighbours. Other checks are as they are."""
    more = OTHER_LIDAR.isolated * max(halvings, 0.0)
    expected = {
        check: replace(known, mean=known.mean + more) if check.check is Check.ISOLATED_POINTS else known
        for check, known in thresholds.expected.items()
    }
    return replace(thresholds, expected=expected)


def _of_prior(rig: Rig) -> float:
    if not rig.cameras:
        return nan
    leftmost = rig.camera(rig.n)
    return OTHER_LIDAR.prior_points * 2 * atan(leftmost.width_px / (2 * leftmost.focal_px))


def _measured_otherwise(clean: Sequence[CleanFrames], versions: Mapping[str, str]) -> str:
    """On which other machine the calibration's counts were made, where the same frames may give others; else empty."""
    return ", ".join(dict.fromkeys(_differences(_machines(tuple(clean)), versions)))


@lru_cache(maxsize=2)
def _usual_returns(clean: tuple[CleanFrames, ...]) -> float:
    return _median([one.usual_returns for one in clean])


@lru_cache(maxsize=2)
def _machines(clean: tuple[CleanFrames, ...]) -> tuple[Mapping[str, str], ...]:
    """The versions on which the counts of some recordings depend, each only once."""
    known = {tuple(one.versions.get(name) for name in MACHINE): one.versions for one in clean}
    return tuple(known.values())


def _differences(machines: Sequence[Mapping[str, str]], versions: Mapping[str, str]) -> Iterator[str]:
    for theirs in machines:
        differing = {name for name in MACHINE if name in theirs and name in versions and theirs[name] != versions[name]}
        if OPENCV in differing:
            yield f"OpenCV {versions[OPENCV]}, not {theirs[OPENCV]}"
        if OPENCV_CPU in differing:
            sets = set(versions[OPENCV_CPU].split()) ^ set(theirs[OPENCV_CPU].split())
            yield f"another CPU ({' '.join(sorted(sets))})"


def _median(values: Sequence[float] | Floats) -> float:
    """NaN where nothing is known."""
    known = np.asarray(values, dtype=np.float64)
    known = known[~np.isnan(known)]
    return float(np.median(known)) if known.size else nan
