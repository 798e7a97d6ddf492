"""What a judgement must say of the calibration that it was reached by, beside its thresholds.

A calibration is of the LiDAR that made it, and so many points of it fall into the view. A LiDAR of half the rings has
half of them: what is usual of its checks was not calibrated, so they are judged by the prior.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from auditor.identification.parameters import OTHER_LIDAR
from auditor.model.arrays import Floats
from auditor.model.calibration import Calibration, CleanFrames, Marks
from auditor.model.rig import LIDAR
from auditor.model.rig_kind import Similarity

OPENCV, OPENCV_CPU = "opencv-python-headless", "opencv_cpu"
"""Names in a measurement's versions: of OpenCV, and of the CPU's instruction sets that it uses."""

MACHINE = (OPENCV, OPENCV_CPU)
"""The versions on which counts depend: a clean recording of a calibration keeps them."""


def marks_of(
    calibration: Calibration, similarity: Similarity, recording_id: str, returns: Floats, versions: Mapping[str, str]
) -> Marks:
    """The marks of a judgement of a recording.

    `returns` (F,) are the LiDAR's points in view of its frames, NaN where there was none; `versions` are those that it
    was measured with.
    """
    return Marks(
        similarity=similarity,
        in_sample=recording_id in calibration.recordings,
        other_lidar=is_another_lidar(calibration.clean, returns),
        measured_otherwise=_measured_otherwise(calibration.clean, versions),
    )


def is_another_lidar(clean: Sequence[CleanFrames], returns: Floats) -> bool:
    """Whether a LiDAR has far fewer or far more points in view than that of clean recordings usually has."""
    usual, own = _median([_median(one.returns) for one in clean]), _median(returns)
    return bool(own > OTHER_LIDAR.factor * usual or usual > OTHER_LIDAR.factor * own)


@lru_cache(maxsize=4)
def without_lidar(calibration: Calibration) -> Calibration:
    """The calibration as if nothing had been learnt of its LiDAR's checks and faults."""
    return replace(calibration, clean=tuple(map(clean_without_lidar, calibration.clean)))


def clean_without_lidar(clean: CleanFrames) -> CleanFrames:
    """The same frames as if nothing of the LiDAR's checks and faults had been measured in them."""
    unknown = np.full(clean.frames, np.nan)
    return replace(
        clean,
        statistics={one: unknown if one.sensor == LIDAR else known for one, known in clean.statistics.items()},
        strengths={cause: unknown if cause[1] == LIDAR else known for cause, known in clean.strengths.items()},
    )


def _measured_otherwise(clean: Sequence[CleanFrames], versions: Mapping[str, str]) -> str:
    """On which other machine the calibration's counts were made, where the same frames may give others; else empty."""
    return ", ".join(dict.fromkeys(_differences(clean, versions)))


def _differences(clean: Sequence[CleanFrames], versions: Mapping[str, str]) -> Iterator[str]:
    for theirs in (one.versions for one in clean):
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
    return float(np.median(known)) if known.size else np.nan
