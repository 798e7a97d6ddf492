"""What a calibration is worth: false alarms on recordings that it has not seen, and incidents per hour."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal

import numpy as np
from numpy.typing import NDArray

from auditor.elements import Element
from auditor.identification.joint import explain
from auditor.identification.margins import margins, yardsticks

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class HeldOut:
    """Clean frames of one recording raised by thresholds that were calibrated on all the others."""

    recording: str
    frames: int
    raised: int


def leave_one_recording_out(
    ratios: Mapping[str, Floats], elements: Sequence[Element], sets: Sequence[tuple[int, ...]], r: Decimal
) -> list[HeldOut]:
    """Judge each clean recording by the others: `ratios` holds the (F, M) local ratios of each by its id.

    Empty where there are fewer than two recordings: nothing can be held out.
    """
    results = []
    for held, frames in ratios.items():
        others = [samples for recording, samples in ratios.items() if recording != held]
        if not others:
            return []
        scales = yardsticks(np.vstack(others), elements, r)
        score = explain(margins(frames, scales), elements, sets).score
        results.append(HeldOut(held, len(frames), int(np.count_nonzero(score > 0))))
    return results


def score_threshold(scores: Floats, hours: float, incidents_per_hour: float) -> float:
    """The smallest score threshold, zero at least, that clean frames cross in no more than so many incidents an hour.

    `scores` (F,) are in the order of time; an incident is a run of frames whose score lies above the threshold.
    """
    allowed = int(incidents_per_hour * hours)
    for candidate in [0.0, *np.unique(scores[scores > 0]).tolist()]:
        if _runs(scores > candidate) <= allowed:
            return float(candidate)
    raise AssertionError("nothing lies above the largest score")


def _runs(above: NDArray[np.bool_]) -> int:
    return int(np.count_nonzero(np.diff(above.astype(np.int8), prepend=0) == 1))
