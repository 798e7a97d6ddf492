"""A calibration for recordings of other rigs, LiDARs or machines than its own.

Of a rig that lacks some sensors: thresholds are of checks, and checks are of pairs and triples of sensors, so what was
measured of those that remain is selected and renumbered. Fault scores weigh all pairs of a camera, so they are worked
out anew from the fault features of the pairs that remain.

What else a judgement must say of its calibration: it is of the LiDAR that made it, and so many points of it fall into
the view. A LiDAR of half the rings has half of them, and more of them are isolated.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from math import atan, log2, nan
from typing import NamedTuple

import numpy as np

from auditor.identification.faults import fault_scores
from auditor.identification.transfer_parameters import LIKE_CAMERAS, OTHER_LIDAR
from auditor.model.arrays import Floats
from auditor.model.calibration import Calibration, CleanFrames, Marks, NullDistribution, RobustThresholds, read_later
from auditor.model.checks import Check, Pair, SensorCheck, rig_sensor_checks
from auditor.model.fault_features import COLUMNS, OF_LIDAR, ObservedFeatures
from auditor.model.measurement import BRIGHTNESS, Statistic
from auditor.model.rig import LIDAR, Rig, Triple
from auditor.model.rig_kind import RigKind, Similarity
from auditor.model.sub_rigs import SubRig, sub_rig

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


def for_like_cameras(
    thresholds: RobustThresholds, cameras: Sequence[int], brightness: Mapping[tuple[str, int], Floats]
) -> RobustThresholds:
    """The prior's thresholds for two cameras alone that are both grey or both in colour, which predict each other.

    `brightness` (F,) are the levels of a recording's frames: only those of a camera with colours have a blue one. What
    was learnt stays as it is, and so does the prior of cameras of two kinds.
    """
    blue = [brightness.get(("blue_level", camera)) for camera in cameras]
    coloured = sum(levels is not None and not np.isnan(levels).all() for levels in blue)
    if thresholds.drives or len(cameras) != 2 or coloured == 1:
        return thresholds
    expected = {check: _of_like_cameras(check.check, null) for check, null in thresholds.expected.items()}
    return replace(thresholds, expected=expected)


def _of_like_cameras(check: Check, null: NullDistribution) -> NullDistribution:
    if check in (Check.ADDED_LIGHT, Check.REMOVED_LIGHT):
        return _narrowed(replace(null, mean=null.mean - LIKE_CAMERAS.less_light), LIKE_CAMERAS.light)
    return _narrowed(null, LIKE_CAMERAS.inconsistency) if check is Check.PHOTOMETRIC_INCONSISTENCY else null


def _narrowed(null: NullDistribution, times: float) -> NullDistribution:
    deviation, within, between = (times * one for one in (null.deviation, null.within, null.between))
    return replace(null, deviation=deviation, within=within, between=between)


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
    machines = {tuple(one.versions.get(name) for name in MACHINE): one.versions for one in clean}
    return tuple(machines.values())


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
    measured = np.asarray(values, dtype=np.float64)
    measured = measured[~np.isnan(measured)]
    return float(np.median(measured)) if measured.size else nan


class _RigMeasurements(NamedTuple):
    """What is measured by a rig: the same for all rigs of a kind, whose calibrations are made once."""

    kind: RigKind
    triples: tuple[Triple, ...]
    pairs: tuple[Pair, ...]
    sensor_checks: tuple[SensorCheck, ...]


def calibration_for(calibration: Calibration, rig: Rig) -> Calibration | None:
    """The calibration as it holds for a rig: itself for a rig of its kind or a similar one, or a part of it.

    The part has the whole's id, and `part` says what it is. None where the rig is neither.
    """
    if calibration.rig_kind.similarity(rig.kind) is not Similarity.OTHER:
        return calibration
    part = sub_rig(calibration.rig_kind, rig)
    if part is None:
        return None
    return _of_part(
        calibration, part, _RigMeasurements(rig.kind, rig.measured_triples, rig.pairs, rig_sensor_checks(rig))
    )


def closeness(calibration: Calibration, rig: Rig) -> tuple[bool, int] | None:
    """How close a calibration's rig is to another, smaller where closer; None where it does not hold for that.

    Whether its kind is only similar, and how many sensors it has beyond the other's.
    """
    similarity, additional = calibration.rig_kind.similarity(rig.kind), 0
    if similarity is Similarity.OTHER:
        part = sub_rig(calibration.rig_kind, rig)
        if part is None:
            return None
        similarity, additional = part.similarity, len(part.absent)
    return similarity is Similarity.SIMILAR, additional


@lru_cache(maxsize=8)
def _of_part(calibration: Calibration, part: SubRig, rig: _RigMeasurements) -> Calibration:
    clean = read_later((one.recording_id, partial(_clean_of_part, one, part, rig)) for one in calibration.clean)
    return replace(calibration, rig_kind=rig.kind, clean=clean, part=part)


def _clean_of_part(clean: CleanFrames, part: SubRig, rig: _RigMeasurements) -> CleanFrames:
    kind = rig.kind
    own = range(0 if kind.lidar else 1, len(kind.sizes_px) + 1)
    there = dict(zip(own, part.sensors, strict=True))
    errors = {(s, t): (s, Triple(*(there[sensor] for sensor in t))) for s in Statistic for t in rig.triples}
    checks = {
        one: SensorCheck(one.check, there.get(one.sensor, LIDAR), tuple(there[other] for other in one.others))
        for one in rig.sensor_checks
    }
    measured = clean.statistics if kind.lidar else {**clean.statistics, **clean.unmasked}
    return CleanFrames(
        clean.recording_id,
        clean.stamps_ns,
        {key: clean.errors[known] for key, known in errors.items() if known in clean.errors},
        {key: measured[known] for key, known in checks.items() if known in measured},
        fault_scores(_features(clean, kind, there, rig.pairs), clean.stamps_ns, list(own)),
        missing={sensor: clean.missing[known] for sensor, known in there.items() if known in clean.missing},
        frozen={sensor: clean.frozen[known] for sensor, known in there.items() if known in clean.frozen},
        returns=clean.returns if kind.lidar else np.zeros(0),
        versions=clean.versions,
    )


def _features(clean: CleanFrames, kind: RigKind, there: dict[int, int], pairs: tuple[Pair, ...]) -> ObservedFeatures:
    """The fault features of the pairs that remain; without the LiDAR there are none of it."""
    unknown = np.full(clean.frames, np.nan)
    cameras = tuple(sensor for sensor in there if sensor != LIDAR)

    def of_pairs(name: str) -> Floats:
        columns = [clean.features.get((name, (there[i], there[k])), unknown) for i, k in pairs]
        usable = kind.lidar or name not in OF_LIDAR
        return np.stack(columns if usable else [unknown] * len(pairs), axis=1)

    def of_cameras(name: str) -> Floats:
        return np.stack([clean.brightness.get((name, there[camera]), unknown) for camera in cameras], axis=1)

    return ObservedFeatures(
        pairs, {name: of_pairs(name) for name in COLUMNS}, cameras, {name: of_cameras(name) for name in BRIGHTNESS}
    )
