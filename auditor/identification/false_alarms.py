"""What a calibration is worth: false alarms on recordings that it has not seen, and incidents per hour."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from auditor.identification.accusing import System, raising_score
from auditor.identification.causes import FAULTS
from auditor.identification.joint import explain
from auditor.identification.margins import margins, strength_yardsticks, yardsticks
from auditor.identification.robust import WINDOW_S
from auditor.identification.thresholds import threshold
from auditor.identification.windows import window_means
from auditor.results import Statistic
from auditor.thresholds import Calibration, CleanFrames, strengths_of

NS_PER_HOUR = 3600 * 10**9
_Z = 1.959963984540054

Floats = NDArray[np.float64]
Raised = Callable[[Sequence[CleanFrames], CleanFrames], tuple[NDArray[np.bool_], NDArray[np.bool_]]]
"""Thresholds from some recordings, applied to another: which of its F frames are raised, and which are in incidents."""


@dataclass(frozen=True)
class HeldOut:
    """Clean frames of one recording raised by thresholds that were calibrated on all the others."""

    recording: str
    frames: int
    raised: int
    incidents: int
    hours: float


def hold_out_robust(calibration: Calibration, system: System, r: Decimal) -> list[HeldOut]:
    """Judge each clean recording by the others with the robust method. Empty with fewer than two recordings."""

    def raised(others: Sequence[CleanFrames], held: CleanFrames) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        scores = _scores(others, held, system, r)
        faulty = _faulty(others, held, r)
        alone, around = (faulty | (score > 0) for score in scores)
        return alone, alone & around

    return _hold_out(calibration, raised)


def hold_out_paper(calibration: Calibration, statistic: Statistic, r: Decimal) -> list[HeldOut]:
    """Judge each clean recording by the others as the paper does: raised where some E lies above its theta."""

    def raised(others: Sequence[CleanFrames], held: CleanFrames) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        above = np.zeros(held.frames, dtype=np.bool_)
        for (kind, triple), E in held.errors.items():
            learnt = [o.errors[kind, triple] for o in others if (kind, triple) in o.errors]
            samples = _known(learnt) if kind is statistic else np.zeros(0)
            if samples.size:
                above |= threshold(samples.tolist(), r) < E
        return above, above

    return _hold_out(calibration, raised)


def held_out_scores(calibration: Calibration, system: System, r: Decimal) -> Floats:
    """The half seconds' scores of all clean frames, each recording by the thresholds of the others, in order of time.

    Two recordings are kept apart by a score of -inf. Those of one recording alone are in sample.
    """
    apart = np.full(1, -np.inf)
    scores: list[Floats] = []
    for held in calibration.clean:
        others = [other for other in calibration.clean if other.recording_id != held.recording_id]
        scores += [_scores(others or [held], held, system, r)[1], apart]
    return np.concatenate(scores) if scores else apart


def score_threshold(scores: Floats, hours: float, incidents_per_hour: float) -> float:
    """The smallest score threshold, zero at least, that clean frames cross in no more than so many incidents an hour.

    `scores` (F,) are in the order of time; an incident is a run of frames whose score lies above the threshold.
    """
    allowed = int(incidents_per_hour * hours)
    for candidate in [0.0, *np.unique(scores[scores > 0]).tolist()]:
        if _runs(scores > candidate) <= allowed:
            return float(candidate)
    raise AssertionError("nothing lies above the largest score")


def hours_of(stamps_ns: NDArray[np.int64]) -> float:
    """Time that frames stand for: their number times the usual time between two; of a single one nothing is known."""
    return len(stamps_ns) * float(np.median(np.diff(stamps_ns))) / NS_PER_HOUR if len(stamps_ns) > 1 else 0.0


def wilson(k: int, n: int) -> tuple[float, float]:
    """Both ends of Wilson's 95 % interval of k out of n; 0 and 1 where n = 0."""
    if n == 0:
        return 0.0, 1.0
    p = k / n
    middle, half = p + _Z * _Z / (2 * n), _Z * sqrt(p * (1 - p) / n + _Z * _Z / (4 * n * n))
    scale = 1 + _Z * _Z / n
    return max((middle - half) / scale, 0.0), min((middle + half) / scale, 1.0)


def _hold_out(calibration: Calibration, raised: Raised) -> list[HeldOut]:
    """One result a recording and rig: several rigs of one kind may have measured it."""
    return list(_results(calibration.clean, raised)) if len(calibration.recordings) > 1 else []


def _results(clean: Sequence[CleanFrames], raised: Raised) -> Iterator[HeldOut]:
    for held in clean:
        others = [other for other in clean if other.recording_id != held.recording_id]
        alone, incidents = raised(others, held)
        yield HeldOut(
            held.recording_id, held.frames, int(np.count_nonzero(alone)), _runs(incidents), hours_of(held.stamps_ns)
        )


def _scores(learnt: Sequence[CleanFrames], judged: CleanFrames, system: System, r: Decimal) -> tuple[Floats, Floats]:
    """(F,) scores of single frames and of half seconds."""
    scales = yardsticks(np.vstack([one.ratios_of(system.elements) for one in learnt]), system.elements, r)
    z = margins(judged.ratios_of(system.elements), scales)
    sets = system.attack_sets
    alone, around = (
        raising_score(part, explain(part, system.elements, sets))
        for part in (z, window_means(z, judged.stamps_ns, WINDOW_S))
    )
    return alone, around


def _faulty(learnt: Sequence[CleanFrames], judged: CleanFrames, r: Decimal) -> NDArray[np.bool_]:
    """(F,) whether a fault is seen that is a finding by itself."""
    found = np.zeros(judged.frames, dtype=np.bool_)
    for key, scale in strength_yardsticks(strengths_of(learnt), r).items():
        if key[0] in FAULTS and key in judged.strengths:
            found |= judged.strengths[key] > scale.theta
    return found


def _known(columns: Sequence[Floats]) -> Floats:
    values = np.concatenate(columns) if columns else np.zeros(0)
    return np.sort(values[~np.isnan(values)])


def _runs(above: NDArray[np.bool_]) -> int:
    return int(np.count_nonzero(np.diff(above.astype(np.int8), prepend=0) == 1))
