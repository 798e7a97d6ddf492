"""Frames of a drive under one fault or attack, measured as a scan would, and judged: without images and count grids."""

import pickle
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from auditor.identification.drive_level import for_drive
from auditor.identification.faults import fault_scores
from auditor.identification.incidents.series import FrameSeries
from auditor.identification.robust import judge_frames
from auditor.identification.scores import thresholds_from
from auditor.identification.statistics import sensor_statistics
from auditor.identification.systems import System
from auditor.lab.simulation.conditions import CONDITIONS
from auditor.lab.simulation.drives import make_drive
from auditor.lab.simulation.streets import STYLES
from auditor.measurement import FaultFeatures, measure
from auditor.measurement.disparity.matchers import find_matcher
from auditor.model.calibration import CleanFrames, RobustThresholds
from auditor.model.checks import Pair, rig_sensor_checks
from auditor.model.fault_features import COLUMNS, ObservedFeatures
from auditor.model.frames import Frame
from auditor.model.measurement import BRIGHTNESS, NO_FINGERPRINT, Measurement
from auditor.model.rig import Rig
from auditor.model.verdict import Cause, CauseIn, Verdict
from tests.benchmarks.lasting_faults import Happening
from tests.benchmarks.scenes import Scene

MATCHER = find_matcher("sgbm")
OTHER_DRIVES = 3
"""Drives of a street's vehicle elsewhere, that it is calibrated by."""

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Watched:
    """F frames, measured in their order; NaN where something was not.

    `numbers` and `stamps_ns` are (F,), `statistics` (F, M) by sensor check, `fault_features` (F, P, columns) by pair,
    `brightness` (F, C) by the names of BRIGHTNESS and by camera, `fingerprints` (F, S) by sensor.
    """

    numbers: Integers
    stamps_ns: Integers
    statistics: Floats
    pairs: tuple[Pair, ...]
    fault_features: Floats
    brightness: Mapping[str, Floats]
    fingerprints: Integers


@dataclass(frozen=True, eq=False)
class Series:
    """Frames under one fault or attack: see `lasting_faults.Happening`."""

    name: str
    cause: Cause | None
    sensor: int | None
    frames: Watched


@dataclass(frozen=True, eq=False)
class Drive:
    """A drive's series, and clean frames of other drives of its vehicle; `family` as drives that are alike share it."""

    name: str
    family: str
    rig: Rig
    series: tuple[Series, ...]
    elsewhere: tuple[Watched, ...] = ()


def measured(stream: Iterable[Frame], rig: Rig) -> Watched:
    """A series as a scan would measure it."""
    watch, found = FaultFeatures(), []
    for frame in stream:
        measurement, evidence = measure(frame, rig, MATCHER)
        found.append(replace(measurement, fault_features=watch.update(evidence)))
    return _distilled(found, rig)


def _distilled(found: Sequence[Measurement], rig: Rig) -> Watched:
    checks, cameras = rig_sensor_checks(rig), [camera.number for camera in rig.cameras]
    pairs = tuple(found[0].fault_features)
    return Watched(
        np.array([m.number for m in found], dtype=np.int64),
        np.array([m.stamp_ns for m in found], dtype=np.int64),
        np.array([sensor_statistics(checks, m.cells, m.shares) for m in found], dtype=np.float64),
        pairs,
        np.array([[m.fault_features[pair].values for pair in pairs] for m in found], dtype=np.float64),
        {
            name: np.array([[getattr(m.coverage[c], name) for c in cameras] for m in found], dtype=np.float64)
            for name in BRIGHTNESS
        },
        np.array([[m.fingerprints.get(s, NO_FINGERPRINT) for s in rig.sensors] for m in found], dtype=np.int64),
    )


def clean_of(scene: Scene) -> Watched:
    """The clean frames of a kept scene."""
    cases, cameras = [c for c in scene.cases if not c.attack], [camera.number for camera in scene.rig.cameras]
    pairs = tuple(cases[0].features)
    return Watched(
        np.array([c.frame for c in cases], dtype=np.int64),
        np.array([c.stamp_ns for c in cases], dtype=np.int64),
        np.array([c.statistics for c in cases], dtype=np.float64),
        pairs,
        np.array([[c.features[pair] for pair in pairs] for c in cases], dtype=np.float64),
        {
            name: np.array([[c.brightness(name).get(n) for n in cameras] for c in cases], dtype=np.float64)
            for name in BRIGHTNESS
        },
        np.full((len(cases), len(scene.rig.sensors)), NO_FINGERPRINT, dtype=np.int64),
    )


def measured_drive(name: str, family: str, rig: Rig, happened: Iterable[Happening]) -> Drive:
    """A drive under everything that happens to it."""
    found = (Series(what, cause, sensor, measured(stream, rig)) for what, cause, sensor, stream in happened)
    return Drive(name, family, rig, tuple(found))


def elsewhere(vehicle: int, frames: int, cameras: int) -> Iterator[Watched]:
    """Clean frames of a vehicle in other streets, of styles and conditions in turn."""
    for number in range(vehicle + 1, vehicle + 1 + OTHER_DRIVES):
        style, condition = list(STYLES)[number % len(STYLES)], list(CONDITIONS)[number % len(CONDITIONS)]
        seed = OTHER_DRIVES * 100_000 + OTHER_DRIVES * vehicle + number
        drive = make_drive(seed, frames, n_cameras=cameras, style=style, vehicle=vehicle, condition=condition)
        yield measured(drive.frames(), drive.rig)


def kept_drive(path: Path, make: Callable[[], Drive]) -> Drive:
    """A drive from its file, where it was measured before."""
    if not path.exists():
        path.write_bytes(pickle.dumps(make()))
        print(f"measured {path.stem}", flush=True)
    found: Drive = pickle.loads(path.read_bytes())
    return found


def scores_of(part: Watched, rig: Rig, absent: Collection[int] = ()) -> dict[CauseIn, Floats]:
    """(F,) fault scores of each cause, without some sensors."""
    cameras = [camera.number for camera in rig.cameras]
    there = [place for place, camera in enumerate(cameras) if camera not in absent]
    pairs = [place for place, pair in enumerate(part.pairs) if set(pair).isdisjoint(absent)]
    seen = ObservedFeatures(
        tuple(part.pairs[place] for place in pairs),
        {name: part.fault_features[:, pairs, n] for n, name in enumerate(COLUMNS)},
        tuple(cameras[place] for place in there),
        {name: values[:, there] for name, values in part.brightness.items()},
    )
    return fault_scores(seen, part.stamps_ns, [sensor for sensor in rig.sensors if sensor not in absent])


def system_of(rig: Rig) -> System:
    """What frames of a rig are judged by."""
    return System(rig_sensor_checks(rig), rig.triples, rig.sensors, rig.fallback)


def learn(
    recordings: Sequence[Watched], rig: Rig, r: Decimal = Decimal("0.01"), absent: Collection[int] = ()
) -> RobustThresholds:
    """Thresholds at r from clean recordings; of none of them the prior's, with no causes."""
    system = system_of(rig)
    clean = [
        CleanFrames(
            str(number),
            part.stamps_ns,
            {},
            dict(zip(system.sensor_checks, part.statistics.T, strict=True)),
            scores_of(part, rig, absent),
        )
        for number, part in enumerate(recordings)
    ]
    return thresholds_from(clean, system.sensor_checks, len(system.counting(frozenset(absent))), r)


def judged(part: Watched, learnt: RobustThresholds, rig: Rig, absent: Collection[int] = ()) -> list[Verdict]:
    """The verdicts of the robust method, as a scan has them: with what is usual of the series itself."""
    system = system_of(rig)
    learnt = for_drive(learnt, system.sensor_checks, part.statistics, part.stamps_ns)
    present = np.tile([sensor not in absent for sensor in rig.sensors], (len(part.numbers), 1))
    scores: Mapping[CauseIn, Floats] = scores_of(part, rig, absent)
    cameras = [camera.number for camera in rig.cameras]
    brightness = {
        (name, camera): column
        for name, values in part.brightness.items()
        for camera, column in zip(cameras, values.T, strict=True)
    }
    series = FrameSeries.of_recording(part.stamps_ns, part.statistics, present, part.fingerprints, scores, brightness)
    return judge_frames(series, system, learnt)
