"""A calibration of a whole rig for a rig that lacks some of its sensors.

Thresholds are of checks, and checks are of pairs and triples of sensors: what was measured of those that remain is
selected and renumbered. Fault scores weigh all pairs of a camera, so they are worked out anew from the fault features
of the pairs that remain.
"""

from dataclasses import replace
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np

from auditor.identification.causes.faults import ObservedFeatures, fault_scores
from auditor.model.arrays import Floats
from auditor.model.calibration import Calibration, CleanFrames, read_later
from auditor.model.checks import COLUMNS, OF_LIDAR, Pair, SensorCheck, rig_sensor_checks
from auditor.model.measurement import BRIGHTNESS, Statistic
from auditor.model.rig import LIDAR, Rig, Triple
from auditor.model.rig_kind import RigKind, Similarity
from auditor.model.sub_rigs import SubRig, sub_rig


class _Measured(NamedTuple):
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
    return _of_part(calibration, part, _Measured(rig.kind, rig.measured_triples, rig.pairs, rig_sensor_checks(rig)))


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
def _of_part(calibration: Calibration, part: SubRig, rig: _Measured) -> Calibration:
    clean = read_later((one.recording_id, partial(_clean_of_part, one, part, rig)) for one in calibration.clean)
    return replace(calibration, rig_kind=rig.kind, clean=clean, part=part)


def _clean_of_part(clean: CleanFrames, part: SubRig, rig: _Measured) -> CleanFrames:
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
        known = [clean.features.get((name, (there[i], there[k])), unknown) for i, k in pairs]
        usable = kind.lidar or name not in OF_LIDAR
        return np.stack(known if usable else [unknown] * len(pairs), axis=1)

    def of_cameras(name: str) -> Floats:
        return np.stack([clean.brightness.get((name, there[camera]), unknown) for camera in cameras], axis=1)

    return ObservedFeatures(
        pairs, {name: of_pairs(name) for name in COLUMNS}, cameras, {name: of_cameras(name) for name in BRIGHTNESS}
    )
