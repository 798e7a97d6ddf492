"""Causes that are not attacks, ranked from stored symptoms, and what they make of a verdict.

An attack changes a portion of what a sensor sees. A fault changes all of it in one way: every point of a picture lies
on another row, or where it lay a frame ago; every LiDAR point agrees with stereo once all are moved alike.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from auditor.elements import OF_THE_LIDAR, Element, Witness
from auditor.identification.margins import margins
from auditor.identification.parameters import FAULT_HYPOTHESES
from auditor.identification.strengths import Floats
from auditor.results import FINDINGS, Alternative, Cause, CauseIn, Evidence, Suspicion, Verdict, VerdictKind
from auditor.thresholds import HIGHEST_MARGIN, Yardstick

ENOUGH = FAULT_HYPOTHESES.enough
"""The score of a margin of zero: from here on a cause is seen more strongly than clean frames show it."""

FAULTS = frozenset({Cause.FROZEN, Cause.LATE, Cause.DISPLACED})
"""Causes that are findings by themselves; the others only say why a frame may have been raised."""

_CLEARLY = FAULT_HYPOTHESES.clear_lead
"""An attack whose strongest margin leads that of a cause by more than this is not doubted for it."""

_MOSTLY = FAULT_HYPOTHESES.most_of_it
"""Share of the raised margins that a sensor with a fault must be able to raise, to explain them."""

_LEAST_TOLD = FAULT_HYPOTHESES.least_told

_RAIN_RAISES = FAULT_HYPOTHESES.rain_highest
"""The largest margin that rain counts with, however hard it rains: drops lie apart, and raise next to nothing."""


def suspicions(strength: Mapping[CauseIn, Floats], scales: Mapping[CauseIn, Yardstick]) -> list[tuple[Suspicion, ...]]:
    """The causes of each frame worth telling, the likeliest first, from their (F,) strengths.

    Their margins are those of the witnesses, above the threshold of clean frames; a score is 0.5 at a margin of zero
    and 1 at the highest. A cause without a yardstick is not told.
    """
    keys = list(strength)
    z = margins(np.stack([strength[key] for key in keys], axis=1), [scales.get(key) for key in keys])
    share = np.nan_to_num(ENOUGH * (1 + z / HIGHEST_MARGIN))
    told: list[tuple[Suspicion, ...]] = [()] * len(share)
    for frame in np.flatnonzero((share >= _LEAST_TOLD).any(axis=1)).tolist():
        ranked = sorted(zip(share[frame].tolist(), range(len(keys)), strict=True), key=lambda one: (-one[0], one[1]))
        told[frame] = tuple(Suspicion(*keys[place], score) for score, place in ranked if score >= _LEAST_TOLD)
    return told


def weigh(verdict: Verdict, causes: Sequence[Suspicion], in_several_pairs: Collection[int] = ()) -> Verdict:
    """The verdict beside the causes of its frame: `suspect` where one of them explains it about as well as an attack.

    A fault is a finding by itself; darkness, glare and rain are told where nothing was raised, and are none. A sensor
    that the verdict was reached without cannot have raised anything. What stands out much further in one place than a
    cause does over the whole picture is that place's own: an attack. Of a `suspect` verdict it stays the first of the
    alternatives. `in_several_pairs` are the cameras matched with more than one other.
    """
    raised = verdict.kind in FINDINGS
    least = max((one.margin for one in verdict.evidence), default=0.0) - _CLEARLY if raised else 0.0
    kept = tuple(one for one in causes if (_explains(one, verdict, in_several_pairs) if raised else _by_itself(one)))
    enough = any(
        one.score >= ENOUGH
        and _margin(one) >= least
        and (one.sensor not in verdict.out_of_system if raised else one.cause in FAULTS)
        for one in kept
    )
    if not enough:
        return replace(verdict, causes=kept) if kept else verdict
    likeliest = (Alternative(verdict.attacked, 0.0),) if verdict.attacked else ()
    alternatives = (*likeliest, *verdict.alternatives)
    return replace(verdict, kind=VerdictKind.SUSPECT, attacked=(), alternatives=alternatives, causes=kept)


def _margin(suspicion: Suspicion) -> float:
    """The margin that a cause's score was made of; rain's is not larger than what it can raise."""
    margin = (suspicion.score / ENOUGH - 1) * HIGHEST_MARGIN
    return min(margin, _RAIN_RAISES) if suspicion.cause is Cause.RAIN else margin


def _by_itself(suspicion: Suspicion) -> bool:
    """Whether a cause is worth telling where nothing was raised: dirt would have raised something."""
    return suspicion.score >= ENOUGH and suspicion.cause is not Cause.SOILED


def _explains(suspicion: Suspicion, verdict: Verdict, in_several_pairs: Collection[int]) -> bool:
    """Whether a cause can have raised what a verdict's evidence says."""
    witnesses = {one.witness for one in verdict.evidence}
    if suspicion.cause is Cause.SOILED and suspicion.sensor not in verdict.attacked:
        # To one pair dirt on a camera looks like light in the other: several must see it, clearer than what was raised.
        strongest = max(one.margin for one in verdict.evidence)
        seen = suspicion.sensor in in_several_pairs and _margin(suspicion) >= strongest
        return seen and _raises_most(suspicion.sensor, verdict)
    if suspicion.cause is Cause.DARK:
        return Witness.LIGHT.value not in witnesses
    if suspicion.cause is Cause.RAIN and not witnesses.isdisjoint(OF_THE_LIDAR):
        return False
    if suspicion.sensor is None or suspicion.sensor in verdict.out_of_system:
        return True
    return _raises_most(suspicion.sensor, verdict)


def _raises_most(sensor: int | None, verdict: Verdict) -> bool:
    """Whether a fault of a sensor can have raised at least half of the margins."""
    raised = [(one.margin, sensor in _accusable(one)) for one in verdict.evidence]
    return sum(margin for margin, own in raised if own) >= _MOSTLY * sum(margin for margin, _ in raised)


def _accusable(evidence: Evidence) -> tuple[int, ...]:
    """The sensors one of which must be at fault where it is raised."""
    return Element(Witness(evidence.witness), evidence.i, evidence.k).accusable
