"""The one judge of the robust method: frames of a recording in, verdicts out, whoever asks.

A scan, an evaluation, the hold-out of a calibration and benchmarks call `judge_frames`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from auditor.identification.accusing import System, accuse, heard, raising_scores
from auditor.identification.causes import suspicions, weigh
from auditor.identification.freezing import frozen
from auditor.identification.margins import margins
from auditor.identification.parameters import TEMPORAL_WINDOW
from auditor.identification.states import sensors_where
from auditor.identification.windows import runs_of, window_means
from auditor.results import FINDINGS, Cause, CauseIn, Finding, Suspicion, Verdict
from auditor.thresholds import CleanFrames, RobustThresholds

WINDOW_S = TEMPORAL_WINDOW.seconds
"""Attacks last, most mistakes do not: incidents are made of what half a second says."""

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Numbers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class FrameSeries:
    """What the judge needs of F successive frames.

    `stamps_ns` are (F,), and `runs` (F,) number the runs without a gap that they belong to. `ratios` are (F, M) local
    ratios by element, NaN where not measured; `present` (F, S) whether a sensor was there, `frozen` (F, S) whether it
    stands still while others go on. `fault_scores` are (F,) by cause that is not an attack.
    """

    stamps_ns: Numbers
    runs: Numbers
    ratios: Floats
    present: Flags
    frozen: Flags
    fault_scores: Mapping[CauseIn, Floats] = field(default_factory=dict)

    @classmethod
    def of_recording(
        cls,
        stamps_ns: Numbers,
        ratios: Floats,
        present: Flags,
        fingerprints: Numbers,
        fault_scores: Mapping[CauseIn, Floats],
    ) -> "FrameSeries":
        """All frames of a recording; `fingerprints` (F, S) tell whether a sensor's data change."""
        return cls(stamps_ns, runs_of(stamps_ns), ratios, present, frozen(fingerprints, present), fault_scores)

    @classmethod
    def of_clean(cls, clean: CleanFrames, system: System) -> "FrameSeries":
        """The clean frames of a calibration."""
        nowhere = np.zeros(clean.frames, dtype=np.bool_)
        missing, still = (
            np.stack([of_sensor.get(sensor, nowhere) for sensor in system.sensors], axis=1)
            for of_sensor in (clean.missing, clean.frozen)
        )
        ratios = clean.ratios_of(system.elements)
        return cls(clean.stamps_ns, runs_of(clean.stamps_ns), ratios, ~missing, still, clean.strengths)


def judge_frames(
    series: FrameSeries,
    system: System,
    thresholds: RobustThresholds,
    *,
    only: Sequence[int] | None = None,
    without_causes: bool = False,
) -> list[Verdict]:
    """The verdicts on F frames, or `only` on those at these places.

    Each is that of its frame alone; `finding` is what the half second around it says, where both raise it: incidents
    are made of these, and `thresholds.score` is the threshold of the half seconds' score. A sensor that stands still
    while others go on is left out, and the frame is at least suspect; so it is where another cause that is not an
    attack explains it as well, unless the caller wants it `without_causes`.
    """
    chosen = np.arange(len(series.stamps_ns)) if only is None else np.asarray(only, dtype=np.intp)
    left_out = _left_out(series, system)
    z, around = _scores(series, system, thresholds, left_out)
    missing = [left_out[place] for place in chosen.tolist()]
    alone = accuse(z[chosen], system, missing)
    moments = accuse(around[chosen], system, missing, thresholds.score)
    faults = [()] * len(chosen) if without_causes else _causes(series, thresholds, chosen)
    still = sensors_where(system.sensors, series.frozen[chosen])
    told = [_with_frozen(those, others) for those, others in zip(still, faults, strict=True)]
    several = system.in_several_pairs
    return [
        _joined(weigh(one, why, several), weigh(moment, why, several))
        for one, moment, why in zip(alone, moments, told, strict=True)
    ]


def window_scores(series: FrameSeries, system: System, thresholds: RobustThresholds) -> Floats:
    """(F,) the score of the half second around each frame: what `judge_frames` compares with `thresholds.score`."""
    left_out = _left_out(series, system)
    _, around = _scores(series, system, thresholds, left_out)
    return raising_scores(around, system, left_out)


def _scores(
    series: FrameSeries, system: System, thresholds: RobustThresholds, left_out: Sequence[frozenset[int]]
) -> tuple[Floats, Floats]:
    """(F, M) margins of the frames, and their means over the half seconds around them."""
    scales = [thresholds.yardsticks.get(element) for element in system.elements]
    z = heard(margins(series.ratios, scales), system, left_out)
    return z, window_means(z, series.stamps_ns, WINDOW_S, series.runs)


def _left_out(series: FrameSeries, system: System) -> list[frozenset[int]]:
    """The sensors that each frame is judged without."""
    return sensors_where(system.sensors, ~series.present | series.frozen)


def _causes(
    series: FrameSeries, thresholds: RobustThresholds, chosen: NDArray[np.intp]
) -> Sequence[tuple[Suspicion, ...]]:
    if not series.fault_scores:
        return [()] * len(chosen)
    return suspicions({cause: scores[chosen] for cause, scores in series.fault_scores.items()}, thresholds.causes)


def _with_frozen(still: frozenset[int], others: tuple[Suspicion, ...]) -> tuple[Suspicion, ...]:
    """The sensors that stand still first: nothing else that is observed of them means anything."""
    if not still:
        return others
    first = [Suspicion(Cause.FROZEN, sensor) for sensor in sorted(still)]
    return (*first, *(one for one in others if one.sensor not in still))


def _joined(alone: Verdict, around: Verdict) -> Verdict:
    if alone.kind not in FINDINGS or around.kind not in FINDINGS:
        return alone
    return replace(alone, finding=Finding(around.kind, around.attacked))
