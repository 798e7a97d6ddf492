"""The robust method on one measurement: what each frame says by itself, and what the half second around it says."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from auditor.identification.accusing import System, accuse, heard
from auditor.identification.freezing import frozen
from auditor.identification.margins import margins
from auditor.identification.windows import window_means
from auditor.results import FINDINGS, Cause, Finding, Suspicion, Verdict, VerdictKind
from auditor.thresholds import Yardstick

WINDOW_S = 0.5
"""Attacks last, most mistakes do not: incidents are made of what half a second says."""

Floats = NDArray[np.float64]


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
    frames: Heard, system: System, scales: Sequence[Yardstick | None], threshold: float = 0.0
) -> list[Verdict]:
    """The verdicts on F frames.

    Each is that of its frame alone; `finding` is what the half second around it says, where both raise it: incidents
    are made of these. `threshold` is that of the half seconds' score. A sensor that stands still while others go on is
    left out, and the frame is at least suspect.
    """
    still = frozen(frames.fingerprints, frames.present)
    missing = _sensors(system, ~frames.present | still)
    z = heard(margins(frames.ratios, scales), system, missing)
    alone = accuse(z, system, missing)
    around = accuse(window_means(z, frames.stamps_ns, WINDOW_S), system, missing, threshold)
    causes = [tuple(Suspicion(Cause.FROZEN, sensor) for sensor in sorted(s)) for s in _sensors(system, still)]
    return [
        _joined(_suspected(one, why), _suspected(moment, why))
        for one, moment, why in zip(alone, around, causes, strict=True)
    ]


def _sensors(system: System, chosen: NDArray[np.bool_]) -> list[frozenset[int]]:
    """The chosen sensors of each frame; few of these sets differ."""
    patterns, which = np.unique(chosen, axis=0, return_inverse=True)
    sets = [frozenset(s for s, there in zip(system.sensors, row, strict=True) if there) for row in patterns.tolist()]
    return [sets[index] for index in which.ravel().tolist()]


def _suspected(verdict: Verdict, causes: tuple[Suspicion, ...]) -> Verdict:
    """The verdict with other causes than an attack; they are a finding even where nothing else is one."""
    if not causes:
        return verdict
    kind = verdict.kind if verdict.kind in FINDINGS else VerdictKind.SUSPECT
    return replace(verdict, kind=kind, causes=causes)


def _joined(alone: Verdict, around: Verdict) -> Verdict:
    if alone.kind not in FINDINGS or around.kind not in FINDINGS:
        return alone
    return replace(alone, finding=Finding(around.kind, around.attacked))
