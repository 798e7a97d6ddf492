"""Successive frames that are judged together: those of a recording, or of the portions that its rigs make of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from auditor.identification.incidents.sequential import periods_of
from auditor.identification.statistics import frozen, repeated, runs_of
from auditor.identification.systems import System
from auditor.model.arrays import Flags, Floats, Integers
from auditor.model.calibration import CleanFrames, RobustThresholds
from auditor.model.verdict import CauseIn


@dataclass(frozen=True, eq=False)
class FrameSeries:
    """F successive frames that are judged together.

    `stamps_ns` are (F,), and `runs` (F,) number the runs without a gap that they belong to. `statistics` are (F, M) by
    sensor check, NaN where not measured; `present` (F, S) says whether a sensor was there, `frozen` (F, S)
    whether it repeats its data while others change. `fault_scores` are (F,) by fault and sensor, and
    `brightness` by the names of BRIGHTNESS and camera. `repeated` are the places of frames without any new data.
    `agreeing` (F,) are the shares of the LiDAR's points that agree with cameras, NaN where not known, None of all.
    `periods_s` (F,) are those of a longer series that the frames are a portion of; None where they are a whole one.
    """

    stamps_ns: Integers
    runs: Integers
    statistics: Floats
    present: Flags
    frozen: Flags
    fault_scores: Mapping[CauseIn, Floats] = field(default_factory=dict)
    brightness: Mapping[tuple[str, int], Floats] = field(default_factory=dict)
    repeated: frozenset[int] = frozenset()
    agreeing: Floats | None = None
    periods_s: Floats | None = None

    @classmethod
    def of_recording(
        cls,
        stamps_ns: Integers,
        statistics: Floats,
        present: Flags,
        fingerprints: Integers,
        fault_scores: Mapping[CauseIn, Floats],
        brightness: Mapping[tuple[str, int], Floats] | None = None,
        agreeing: Floats | None = None,
        *,
        by_time: bool = False,
    ) -> "FrameSeries":
        """All frames of a recording; equal `fingerprints` (F, S) of a sensor are equal data.

        Of sensors that are checked `by_time` what was replayed is frozen as well: their own past would deny the others.
        """
        return cls(
            stamps_ns,
            runs_of(stamps_ns),
            statistics,
            present,
            frozen(fingerprints, present, replayed=by_time),
            fault_scores,
            brightness or {},
            frozenset(np.flatnonzero(repeated(fingerprints, present)).tolist()),
            agreeing,
        )

    @classmethod
    def of_clean(cls, clean: CleanFrames, system: System) -> "FrameSeries":
        """The clean frames of a calibration."""
        nowhere = np.zeros(clean.frames, dtype=np.bool_)
        missing, still = (
            np.stack([of_sensor.get(sensor, nowhere) for sensor in system.sensors], axis=1)
            for of_sensor in (clean.missing, clean.frozen)
        )
        statistics = clean.statistics_of(system.sensor_checks)
        return cls(
            clean.stamps_ns, runs_of(clean.stamps_ns), statistics, ~missing, still, clean.strengths, clean.brightness
        )

    def brightness_in(self, frame: int) -> dict[tuple[str, int], float]:
        """What is known of the cameras' brightness in the frame at this place."""
        return {key: float(values[frame]) for key, values in self.brightness.items()}


@dataclass(frozen=True, eq=False)
class Portion:
    """Frames of a recording, by their `numbers` (F,) in it, that one rig's system and thresholds judge."""

    numbers: Integers
    series: FrameSeries
    system: System
    thresholds: RobustThresholds


def on_one_line(parts: Sequence[FrameSeries], order: Integers) -> list[FrameSeries]:
    """The parts of a series with the runs and periods that the whole series has in this order of their frames."""
    if len(parts) == 1:
        return [*parts]
    stamps_ns = np.concatenate([one.stamps_ns for one in parts])[order]
    runs = runs_of(stamps_ns)
    in_turn = np.argsort(order, kind="stable")
    bounds = np.cumsum([len(one.stamps_ns) for one in parts])[:-1]
    of_parts = zip(*(np.split(column[in_turn], bounds) for column in (runs, periods_of(stamps_ns, runs))), strict=True)
    return [replace(one, runs=own, periods_s=periods) for one, (own, periods) in zip(parts, of_parts, strict=True)]
