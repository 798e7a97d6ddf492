"""Joint identification: from the normalised scores of all pair checks to the sensors that are named as attacked."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from auditor.identification.algorithm2 import (
    ABOVE,
    FEWEST_SENSORS,
    NOT_ABOVE,
    NOT_MEASURED,
    allowed_attack_sets,
    identify,
)
from auditor.identification.attack_sets import AttackSetCosts, attack_set_costs, covers, triple_states
from auditor.identification.parameters import ATTACK_SET_COST
from auditor.model.arrays import Floats, Indices
from auditor.model.checks import Check, PairCheck
from auditor.model.rig import LIDAR, Triple
from auditor.model.verdict import Alternative, Evidence, Verdict, VerdictKind

_NO_CHECK = "no check could be measured"
_LIDAR_UNCHECKED = "no camera pair can check the LiDAR here: points that it invents pass unnoticed"


@dataclass(frozen=True)
class System:
    """What a rig's frames are judged by: its pair checks, triples and sensors, in their fixed orders."""

    pair_checks: tuple[PairCheck, ...]
    triples: tuple[Triple, ...]
    sensors: tuple[int, ...]

    @property
    def in_several_pairs(self) -> frozenset[int]:
        """The cameras matched with more than one other: a fault in one of them shows in all its pairs."""
        pairs = Counter(s for e in self.pair_checks if e.check is Check.PHOTOMETRIC_INCONSISTENCY for s in (e.i, e.k))
        return frozenset(sensor for sensor, number in pairs.items() if number > 1)


def name_attacked(
    z: Floats, system: System, missing: Sequence[frozenset[int]], threshold: float = 0.0
) -> list[Verdict]:
    """The verdicts on F frames from (F, M) scores z, NaN where not measured, and the missing sensors of each.

    A frame is a finding where the best attack set explains it better than no attack by more than `threshold`. The
    verdict's `margin` is the gap between the best attack set and the runner-up, or the largest z where three sensors
    tell no attacks apart; `evidence` are the fired pair checks, the strongest first; `named` is Algorithm 2's answer on
    the same states. `reason` says why no sensor of a finding is named, and where no camera pair can check the LiDAR.
    """
    verdicts: list[Verdict | None] = [None] * len(z)
    z = without_missing(z, system, missing)
    for absent, frames in _frames_by_missing(missing).items():
        for frame, verdict in zip(frames, _name_in_group(z[frames], system, absent, threshold), strict=True):
            verdicts[frame] = verdict
    return [verdict for verdict in verdicts if verdict is not None]


def attack_scores(z: Floats, system: System, missing: Sequence[frozenset[int]]) -> Floats:
    """(F,) the numbers that `name_attacked` compares with its threshold, from the same (F, M) z and missing sensors."""
    scores = np.full(len(z), -np.inf)
    z = without_missing(z, system, missing)
    for absent, frames in _frames_by_missing(missing).items():
        sets = allowed_attack_sets(sensor for sensor in system.sensors if sensor not in absent)
        scores[frames] = _attack_score(z[frames], attack_set_costs(z[frames], system.pair_checks, sets))
    return scores


def without_missing(z: Floats, system: System, missing: Sequence[frozenset[int]]) -> Floats:
    """A copy of (F, M) scores with NaN for the pair checks that need a sensor missing in their frame."""
    masked = np.array(z, dtype=np.float64)
    unmeasured = {
        absent: [not absent.isdisjoint(pair_check.needed) for pair_check in system.pair_checks]
        for absent in set(missing)
        if absent
    }
    for frame, absent in enumerate(missing):
        if absent:
            masked[frame, unmeasured[absent]] = np.nan
    return masked


def _frames_by_missing(missing: Sequence[frozenset[int]]) -> dict[frozenset[int], list[int]]:
    groups: dict[frozenset[int], list[int]] = {}
    for frame, absent in enumerate(missing):
        groups.setdefault(absent, []).append(frame)
    return groups


def _attack_score(z: Floats, costs: AttackSetCosts) -> Floats:
    """(F,) how much better the best attack set explains each frame than no attack does.

    With three sensors, which tell no attacks apart, it is the largest z; -inf where nothing was measured.
    """
    if len(costs.sets) > 1:
        return costs.score
    return np.asarray(np.nanmax(z, axis=1, initial=-np.inf))


def _name_in_group(z: Floats, system: System, absent: frozenset[int], threshold: float) -> list[Verdict]:
    """The verdicts on frames that all lack the same sensors."""
    present = [sensor for sensor in system.sensors if sensor not in absent]
    outside = tuple(sensor for sensor in system.sensors if sensor in absent)
    sets = allowed_attack_sets(present)
    costs = attack_set_costs(z, system.pair_checks, sets)
    score = _attack_score(z, costs)
    gap = costs.gap if len(sets) > 1 else score
    ranked = np.argsort(costs.cost, axis=1, kind="stable")[:, : 1 + ATTACK_SET_COST.alternatives]
    measured = np.count_nonzero(~np.isnan(z), axis=1)
    named = cache(lambda e: _algorithm_2(e, system, present))
    remarks = _remarks(z, system, present)
    verdicts = []
    for f, e in enumerate(_states(z, system)):
        if not measured[f]:
            verdicts.append(Verdict(VerdictKind.NOT_AUDITABLE, e, out_of_system=outside, reason=_NO_CHECK))
            continue
        verdict = Verdict(
            kind=VerdictKind.CLEAN,
            e=e,
            named=named(e),
            out_of_system=outside,
            gap=float(gap[f]),
            reason=remarks[f],
            evidence=_evidence(z[f], system),
            alternatives=_alternatives(costs, f, ranked[f]),
        )
        if score[f] > threshold:
            verdict = _finding(verdict, costs.sets[ranked[f, 0]], z[f], system.pair_checks, len(present))
        verdicts.append(verdict)
    return verdicts


def _finding(
    verdict: Verdict, attacked: tuple[int, ...], z: Floats, pair_checks: Sequence[PairCheck], N: int
) -> Verdict:
    """The verdict on a frame that is a finding: with the attacked sensors, or with the reason why none is named."""
    doubt = _doubt(z, attacked, verdict.gap or 0.0, pair_checks, N)
    if not doubt:
        return replace(verdict, kind=VerdictKind.ATTACKED, attacked=attacked)
    likeliest = (Alternative(attacked, 0.0),) if N >= FEWEST_SENSORS else ()
    return replace(
        verdict,
        kind=VerdictKind.UNIDENTIFIED,
        reason="; ".join(filter(None, (doubt, verdict.reason))),
        alternatives=(*likeliest, *verdict.alternatives),
    )


def _doubt(z: Floats, attacked: tuple[int, ...], gap: float, pair_checks: Sequence[PairCheck], N: int) -> str:
    """Why the best attack set cannot be named; empty where it can."""
    if N < FEWEST_SENSORS:
        return f"an attack on one of {N} sensors cannot be attributed"
    fired = [(float(v), e) for v, e in zip(z, pair_checks, strict=True) if v > 0]
    if sum(v for v, e in fired if not covers(e, attacked)) > ATTACK_SET_COST.most_uncovered:
        return f"no attack on at most {N - 3} of {N} sensors explains what was measured"
    if gap < ATTACK_SET_COST.penalty_per_sensor:
        return "two attacks explain the frame equally well"
    return ""


def _remarks(z: Floats, system: System, present: Sequence[int]) -> list[str]:
    """What each verdict does not cover: invented points, where the LiDAR is present and no LiDAR conflict is measured.

    There no two cameras see enough of its points or lie far enough apart, or no clean frames gave a threshold.
    """
    if LIDAR not in present:
        return [""] * len(z)
    conflicts = [e.check is Check.LIDAR_CONFLICT for e in system.pair_checks]
    unchecked = np.logical_and.reduce(np.isnan(z[:, conflicts]), axis=1)
    return [_LIDAR_UNCHECKED if lidar_unchecked else "" for lidar_unchecked in unchecked.tolist()]


def _states(z: Floats, system: System) -> list[str]:
    """The e vector of each frame: '1' where a pair check inside the triple fired, '-' where it was not measured."""
    above, measured = triple_states(z > 0, ~np.isnan(z), system.pair_checks, system.triples)
    marks = np.where(measured, np.where(above, ABOVE, NOT_ABOVE), NOT_MEASURED)
    return ["".join(row) for row in marks.tolist()]


def _algorithm_2(e: str, system: System, present: Sequence[int]) -> tuple[int, ...] | None:
    if len(present) < FEWEST_SENSORS:
        return None
    found = identify(e, system.triples, present)
    return None if found.undetermined else found.attacked


def _evidence(z: Floats, system: System) -> tuple[Evidence, ...]:
    """The fired pair checks, the strongest first."""
    fired = [(float(z[place]), system.pair_checks[place]) for place in np.flatnonzero(z > 0)]
    return tuple(Evidence(e.check.value, e.i, None, e.k, v) for v, e in sorted(fired, key=lambda one: -one[0]))


def _alternatives(costs: AttackSetCosts, frame: int, ranked: Indices) -> tuple[Alternative, ...]:
    """All attack sets but the best of those ranked, with how much worse they are."""
    cost = costs.cost[frame]
    best = cost[ranked[0]]
    return tuple(Alternative(costs.sets[s], float(cost[s] - best)) for s in ranked[1:].tolist())
