"""The robust method on one measurement: the verdict of each frame, and that of the temporal window around it.

1. Every sensor check becomes a normalised score z, and z is averaged over the temporal window (half a second).
2. The scores of a frame, and those of its window, name the attacked sensors (`naming`).
3. Faults, rain and dirt that may explain a finding as well make it suspect (`faults`).
4. A frame belongs to an incident where its own verdict and that of its window are findings.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from auditor.identification.algorithm2 import sensors_where
from auditor.identification.faults import fault_hypotheses, frozen, weigh
from auditor.identification.light_causes import seen_of
from auditor.identification.naming import attack_scores, name_attacked
from auditor.identification.parameters import TEMPORAL_WINDOW
from auditor.identification.scores import normalised_scores
from auditor.identification.statistics import runs_of, window_means
from auditor.identification.systems import System
from auditor.model.arrays import Flags, Floats, Indices, Integers
from auditor.model.calibration import CleanFrames, RobustThresholds
from auditor.model.verdict import FINDINGS, Cause, CauseIn, FaultHypothesis, Finding, Verdict


@dataclass(frozen=True, eq=False)
class FrameSeries:
    """F successive frames that are judged together.

    `stamps_ns` are (F,), and `runs` (F,) number the runs without a gap that they belong to. `statistics` are (F, M) by
    sensor check, NaN where not measured; `present` (F, S) says whether a sensor was there, `frozen` (F, S)
    whether it repeats its data while others change. `fault_scores` are (F,) by fault and sensor, and
    `brightness` by the names of BRIGHTNESS and camera.
    """

    stamps_ns: Integers
    runs: Integers
    statistics: Floats
    present: Flags
    frozen: Flags
    fault_scores: Mapping[CauseIn, Floats] = field(default_factory=dict)
    brightness: Mapping[tuple[str, int], Floats] = field(default_factory=dict)

    @classmethod
    def of_recording(
        cls,
        stamps_ns: Integers,
        statistics: Floats,
        present: Flags,
        fingerprints: Integers,
        fault_scores: Mapping[CauseIn, Floats],
        brightness: Mapping[tuple[str, int], Floats] | None = None,
    ) -> "FrameSeries":
        """All frames of a recording; equal `fingerprints` (F, S) of a sensor are equal data."""
        still = frozen(fingerprints, present)
        return cls(stamps_ns, runs_of(stamps_ns), statistics, present, still, fault_scores, brightness or {})

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


def judge_frames(
    series: FrameSeries,
    system: System,
    thresholds: RobustThresholds,
    *,
    only: Sequence[int] | None = None,
    without_causes: bool = False,
) -> list[Verdict]:
    """The verdicts on F frames, or `only` on those at these places.

    Each is that of its frame by itself. Its `finding` is the verdict of the temporal window, where both are findings:
    incidents are made of these, and `window_limit` is what the window must exceed. A sensor with
    frozen data is left out, and the frame is at least suspect; so it is where a fault explains it as well as an attack,
    unless the caller wants verdicts `without_causes`.
    """
    judged = np.arange(len(series.stamps_ns)) if only is None else np.asarray(only, dtype=np.intp)
    unused = _unused_sensors(series, system)
    z, z_window = _scores(series, system, thresholds)
    missing = [unused[frame] for frame in judged.tolist()]
    frames = name_attacked(z[judged], system, missing, thresholds.limit)
    of_window = window_limit(thresholds)
    windows = name_attacked(z_window[judged], system, missing, of_window)
    faults = [()] * len(judged) if without_causes else _fault_hypotheses(series, thresholds, judged)
    still = sensors_where(system.sensors, series.frozen[judged])
    hypotheses = [_with_frozen(sensors, others) for sensors, others in zip(still, faults, strict=True)]

    def weighed(verdicts: Sequence[Verdict], scores: Floats, statistics: Floats, limit: float) -> list[Verdict]:
        seen = (
            seen_of(verdict, scores[f], statistics[f], system, series.brightness_in(f)) if verdict.evidence else {}
            for f, verdict in zip(judged.tolist(), verdicts, strict=True)
        )
        return [
            weigh(verdict, causes, limit, shown)
            for verdict, causes, shown in zip(verdicts, hypotheses, seen, strict=True)
        ]

    means = window_means(series.statistics, series.stamps_ns, TEMPORAL_WINDOW.seconds, series.runs)
    of_frames = weighed(frames, z, series.statistics, thresholds.limit)
    of_windows = weighed(windows, z_window, means, of_window)
    return list(map(_with_finding, of_frames, of_windows))


def window_scores(series: FrameSeries, system: System, thresholds: RobustThresholds) -> Floats:
    """(F,) the score of each frame's temporal window: `judge_frames` compares it with `thresholds.score`."""
    unused = _unused_sensors(series, system)
    _, z_window = _scores(series, system, thresholds)
    return attack_scores(z_window, system, unused) - window_limit(replace(thresholds, score=0.0))


def window_limit(thresholds: RobustThresholds) -> float:
    """What the mean z of a temporal window must exceed: less than a frame, since a third of its frames may be clean."""
    return thresholds.limit * TEMPORAL_WINDOW.limit_share + thresholds.score


def _unused_sensors(series: FrameSeries, system: System) -> list[frozenset[int]]:
    """The sensors that each frame is judged without: missing ones and those with frozen data."""
    return sensors_where(system.sensors, ~series.present | series.frozen)


def _scores(series: FrameSeries, system: System, thresholds: RobustThresholds) -> tuple[Floats, Floats]:
    """(F, M) normalised scores of the frames, and their means over the temporal windows."""
    z = normalised_scores(series.statistics, [thresholds.expected.get(check) for check in system.sensor_checks])
    return z, window_means(z, series.stamps_ns, TEMPORAL_WINDOW.seconds, series.runs)


def _fault_hypotheses(
    series: FrameSeries, thresholds: RobustThresholds, judged: Indices
) -> Sequence[tuple[FaultHypothesis, ...]]:
    if not series.fault_scores:
        return [()] * len(judged)
    return fault_hypotheses({cause: scores[judged] for cause, scores in series.fault_scores.items()}, thresholds.causes)


def _with_frozen(still: frozenset[int], others: tuple[FaultHypothesis, ...]) -> tuple[FaultHypothesis, ...]:
    """The sensors with frozen data first; no other fault of theirs can be measured."""
    if not still:
        return others
    first = [FaultHypothesis(Cause.FROZEN, sensor) for sensor in sorted(still)]
    return (*first, *(one for one in others if one.sensor not in still))


def _with_finding(frame: Verdict, window: Verdict) -> Verdict:
    if frame.kind not in FINDINGS or window.kind not in FINDINGS:
        return frame
    return replace(frame, finding=Finding(window.kind, window.attacked))
