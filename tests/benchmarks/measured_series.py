"""The measured series of the benchmark of causes: all that judging needs, without images and count grids."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from auditor.identification.statistics import windowed_ratios
from auditor.lab.simulation.drives import make_drive
from auditor.measurement import FaultFeatures, measure
from auditor.measurement.disparity.matchers import find_matcher
from auditor.model.checks import Pair, rig_pair_checks
from auditor.model.frames import Frame
from auditor.model.measurement import NO_FINGERPRINT, Measurement
from auditor.model.rig import Rig
from auditor.model.verdict import Cause
from tests.benchmarks import lasting_faults
from tests.benchmarks.kept_scenes import digest, measure_kept, of_package
from tests.benchmarks.lasting_faults import PARTS

MATCHER = find_matcher("sgbm")
_SOURCES = (
    "measurement/**/*.py",
    "lab/**/*.py",
    "identification/statistics.py",
    "model/*.py",
)

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Watched:
    """F frames, measured in their order; NaN where something was not.

    `numbers` and `stamps_ns` are (F,), `ratios` (F, M) windowed ratios by pair check, `fault_features` (F, P, columns)
    by pair, `level` and `saturated` (F, C) by camera, `fingerprints` (F, S) by sensor.
    """

    numbers: Integers
    stamps_ns: Integers
    ratios: Floats
    pairs: tuple[Pair, ...]
    fault_features: Floats
    level: Floats
    saturated: Floats
    fingerprints: Integers


@dataclass(frozen=True, eq=False)
class Series:
    """Frames of a recording under one fault or attack: see `lasting_faults.Happening`."""

    recording: str
    name: str
    cause: Cause | None
    sensor: int | None
    frames: Watched


@dataclass(frozen=True)
class Street:
    """A street of so many frames, driven along by a vehicle of its own, and which of PARTS happens there."""

    style: str
    number: int
    frames: int
    part: str

    @property
    def name(self) -> str:
        """The name of its file."""
        return f"{self.recording}-{self.part}"

    @property
    def recording(self) -> str:
        """The name that all its parts share."""
        return f"{self.style}-{self.number}-{self.frames}"


def measured(stream: Iterable[Frame], rig: Rig) -> Watched:
    """A series as a scan would measure it."""
    watch, found = FaultFeatures(), []
    for frame in stream:
        measurement, evidence = measure(frame, rig, MATCHER)
        found.append(replace(measurement, fault_features=watch.update(evidence)))
    return _distilled(found, rig)


def _distilled(found: Sequence[Measurement], rig: Rig) -> Watched:
    pair_checks, cameras = rig_pair_checks(rig), [camera.number for camera in rig.cameras]
    pairs = tuple(found[0].fault_features)
    return Watched(
        np.array([m.number for m in found], dtype=np.int64),
        np.array([m.stamp_ns for m in found], dtype=np.int64),
        np.array([windowed_ratios(pair_checks, m.cells, m.shares) for m in found], dtype=np.float64),
        pairs,
        np.array([[m.fault_features[pair].values for pair in pairs] for m in found], dtype=np.float64),
        np.array([[m.coverage[c].level for c in cameras] for m in found], dtype=np.float64),
        np.array([[m.coverage[c].saturated_share for c in cameras] for m in found], dtype=np.float64),
        np.array([[m.fingerprints.get(s, NO_FINGERPRINT) for s in rig.sensors] for m in found], dtype=np.int64),
    )


def all_series(recording: str, kept: Sequence[Frame], rig: Rig, part: str) -> Iterator[Series]:
    """The series of one of PARTS, one after the other."""
    for name, cause, sensor, stream in PARTS[part](kept, rig):
        yield Series(recording, name, cause, sensor, measured(stream, rig))


def measure_streets(streets: Sequence[Street], folder: Path, processes: int) -> tuple[Rig, dict[Street, list[Series]]]:
    """Their series, from the folder where the same code has measured them before, and a rig: all have like sensors."""
    code = digest([*of_package(*_SOURCES), Path(__file__), Path(lasting_faults.__file__)])
    found = measure_kept(streets, _measure, folder / code, processes)
    return next(iter(found.values()))[0], {street: series for street, (_, series) in found.items()}


def _measure(street: Street) -> tuple[Rig, list[Series]]:
    drive = make_drive(street.number, street.frames, style=street.style, vehicle=street.number)
    return drive.rig, list(all_series(street.recording, list(drive.frames()), drive.rig, street.part))
