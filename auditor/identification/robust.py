"""The robust method on one measurement: what each frame says by itself, and what the half second around it says."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from auditor.identification.accusing import System, accuse, heard
from auditor.identification.causes import weigh
from auditor.identification.freezing import frozen
from auditor.identification.margins import margins
from auditor.identification.parameters import TEMPORAL_WINDOW
from auditor.identification.windows import window_means
from auditor.results import FINDINGS, Cause, Finding, Suspicion, Verdict
from auditor.thresholds import Yardstick

WINDOW_S = TEMPORAL_WINDOW.seconds
"""Attacks last, most mistakes do not: incidents are made of what half a second says."""

Floats = NDArray[np.float64]
Told = Sequence[tuple[Suspicion, ...]]


@dataclass(frozen=True, eq=False)
class Heard:
    """What the witnesses say in F successive frames.

    `ratios` are (F, M) local ratios by element, NaN where not measured; `present` (F, S) whether a sensor was there,
    and `fingerprints` (F, S) whether its data change.
    """

    stamps_ns: NDArray[np.int64]
    ratios: Floats
    present: NDArray[np.bool_]
    fingerprints: NDArray[np.int64]


def judge_heard(
    frames: Heard,
    system: System,
    scales: Sequence[Yardstick | None],
    threshold: float = 0.0,
    causes: Told = (),
) -> list[Verdict]:
    """The verdicts on F frames.

    Each is that of its frame alone; `finding` is what the half second around it says, where both raise it: incidents
    are made of these. `threshold` is that of the half seconds' score. A sensor that stands still while others go on is
    left out, and the frame is at least suspect; so it is where one of the other `causes` explains it as well. These are
    by frame, or none at all.
    """
    still = frozen(frames.fingerprints, frames.present)
    missing = _sensors(system, ~frames.present | still)
    z = heard(margins(frames.ratios, scales), system, missing)
    alone = accuse(z, system, missing)
    around = accuse(window_means(z, frames.stamps_ns, WINDOW_S), system, missing, threshold)
    told = [_with_frozen(s, others) for s, others in zip(_sensors(system, still), causes or [()] * len(z), strict=True)]
    several = system.in_several_pairs
    return [
        _joined(weigh(one, why, several), weigh(moment, why, several))
        for one, moment, why in zip(alone, around, told, strict=True)
    ]


def _sensors(system: System, chosen: NDArray[np.bool_]) -> list[frozenset[int]]:
    """The chosen sensors of each frame; few of these sets differ."""
    patterns, which = np.unique(chosen, axis=0, return_inverse=True)
    sets = [frozenset(s for s, there in zip(system.sensors, row, strict=True) if there) for row in patterns.tolist()]
    return [sets[index] for index in which.ravel().tolist()]


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
