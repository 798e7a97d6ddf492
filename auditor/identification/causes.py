"""Causes that are not attacks, ranked from stored symptoms, and what they make of a verdict.

An attack changes a portion of what a sensor sees. A fault changes all of it in one way: every point of a picture lies
on another row, or where it lay a frame ago; every LiDAR point agrees with stereo once all are moved alike.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from auditor.elements import Element, Witness
from auditor.identification.strengths import Floats, Who
from auditor.results import FINDINGS, Cause, Evidence, Suspicion, Verdict, VerdictKind

ENOUGH = 0.5
"""The score from which a cause explains a frame about as well as an attack does: that of a strength of 1."""

FAULTS = frozenset({Cause.FROZEN})
"""Causes that are findings by themselves; the others only say why a frame may have been raised.

Nothing is calibrated for them: a LiDAR that lies a tenth of a degree beside its calibration, as many do, or points that
would fit the frame before as well, are told and raise nothing.
"""

_MOSTLY = 0.5
"""Share of the raised margins that a sensor with a fault must be able to raise, to explain them."""

_LEAST_TOLD = 0.1


def suspicions(strength: Mapping[Who, Floats]) -> list[tuple[Suspicion, ...]]:
    """The causes of each frame worth telling, the likeliest first; a score is half the strength, at most 1."""
    keys = list(strength)
    scores = np.clip(np.nan_to_num(np.stack([strength[key] for key in keys], axis=1)) * ENOUGH, 0, 1)
    told: list[tuple[Suspicion, ...]] = [()] * len(scores)
    for frame in np.flatnonzero((scores >= _LEAST_TOLD).any(axis=1)).tolist():
        ranked = sorted(zip(scores[frame].tolist(), range(len(keys)), strict=True), key=lambda one: (-one[0], one[1]))
        told[frame] = tuple(Suspicion(*keys[place], score) for score, place in ranked if score >= _LEAST_TOLD)
    return told


def weigh(verdict: Verdict, causes: Sequence[Suspicion]) -> Verdict:
    """The verdict beside the causes of its frame: `suspect` where one of them explains it about as well as an attack.

    A fault is a finding by itself; darkness and glare are told where nothing was raised, and are none. A sensor that
    the verdict was reached without cannot have raised anything.
    """
    raised = verdict.kind in FINDINGS
    kept = tuple(one for one in causes if (_explains(one, verdict) if raised else _by_itself(one)))
    enough = any(
        one.score >= ENOUGH and (one.sensor not in verdict.out_of_system if raised else one.cause in FAULTS)
        for one in kept
    )
    if not enough:
        return replace(verdict, causes=kept) if kept else verdict
    return replace(verdict, kind=VerdictKind.SUSPECT, attacked=(), causes=kept)


def _by_itself(suspicion: Suspicion) -> bool:
    """Whether a cause is worth telling where nothing was raised: dirt would have raised something."""
    return suspicion.score >= ENOUGH and suspicion.cause is not Cause.SOILED


def _explains(suspicion: Suspicion, verdict: Verdict) -> bool:
    """Whether a cause can have raised what a verdict's evidence says."""
    witnesses = {one.witness for one in verdict.evidence}
    if suspicion.cause is Cause.SOILED:
        return suspicion.sensor in (verdict.attacked or {s for e in verdict.evidence for s in (e.i, e.k)})
    if suspicion.cause is Cause.DARK:
        return Witness.LIGHT.value not in witnesses
    if suspicion.sensor is None or suspicion.sensor in verdict.out_of_system:
        return True
    raised = [(one.margin, suspicion.sensor in _accusable(one)) for one in verdict.evidence]
    return sum(margin for margin, own in raised if own) >= _MOSTLY * sum(margin for margin, _ in raised)


def _accusable(evidence: Evidence) -> tuple[int, ...]:
    """The sensors one of which must be at fault where it is raised."""
    return Element(Witness(evidence.witness), evidence.i, evidence.k).accusable
