"""Joint identification: from the normalised scores of all pair checks to the sensors that are named as attacked."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from auditor.identification.algorithm2 import (
    ABOVE,
    FEWEST_COMPARED,
    FEWEST_SENSORS,
    NOT_ABOVE,
    NOT_MEASURED,
    allowed_attack_sets,
    identify,
    listed,
)
from auditor.identification.attack_sets import AttackSetCosts, attack_set_costs, compared, covers, triple_states
from auditor.identification.parameters import ATTACK_SET_COST
from auditor.model.arrays import Flags, Floats, Indices
from auditor.model.checks import LIDAR_CHECKS, Check, PairCheck
from auditor.model.rig import LIDAR, Triple
from auditor.model.verdict import Alternative, Evidence, Verdict, VerdictKind

_LIDAR_UNCHECKED = "no camera pair can check the LiDAR here: points that it invents pass unnoticed"


@dataclass(frozen=True)
class System:
    """What a rig's frames are judged by: its pair checks, triples and sensors, in their fixed orders.

    `fallback` is the triple for frames in which none of `triples` was measured.
    """

    pair_checks: tuple[PairCheck, ...]
    triples: tuple[Triple, ...]
    sensors: tuple[int, ...]
    fallback: Triple | None = None

    @property
    def in_several_pairs(self) -> frozenset[int]:
        """The cameras matched with more than one other: a fault in one of them shows in all its pairs."""
        pairs = Counter(s for e in self.pair_checks if e.check is Check.PHOTOMETRIC_INCONSISTENCY for s in (e.i, e.k))
        return frozenset(sensor for sensor, number in pairs.items() if number > 1)

    @cached_property
    def of_fallback(self) -> Flags:
        """(M,) the pair checks that are there for the fallback's sake: disparities of its two cameras, and its view."""
        if self.fallback is None:
            return np.zeros(len(self.pair_checks), dtype=np.bool_)
        _, j, k = self.fallback
        return np.array(
            [
                e.check is not Check.BRIGHTNESS_DIFFERENCE and (e.i, e.k) in ((j, k), (LIDAR, k))
                for e in self.pair_checks
            ],
            dtype=np.bool_,
        )

    def unused(self, absent: frozenset[int]) -> Flags:
        """(M,) the pair checks that do not count in frames without these sensors.

        They are those that need one of them, and the LiDAR's own checks in the fallback's view while any other
        reference camera is there.
        """
        lacking = np.array([not absent.isdisjoint(e.needed) for e in self.pair_checks], dtype=np.bool_)
        if {triple.k for triple in self.triples} <= absent:
            return lacking
        lidar_checks = np.array([e.check in LIDAR_CHECKS for e in self.pair_checks], dtype=np.bool_)
        return np.asarray(lacking | (self.of_fallback & lidar_checks))


def name_attacked(
    z: Floats, system: System, missing: Sequence[frozenset[int]], threshold: float = 0.0
) -> list[Verdict]:
    """The verdicts on F frames from (F, M) scores z, NaN where not measured, and the missing sensors of each.

    A frame is a finding where the best attack set explains it better than no attack by more than `threshold`. The
    verdict's `margin` is the gap between the best attack set and the runner-up, or the largest z where three sensors
    tell no attacks apart; `evidence` are the fired pair checks, the strongest first; `named` is Algorithm 2's answer on
    the same states. `reason` says why no sensor of a finding is named, without which sensors a frame was judged, and
    where no camera pair can check the LiDAR. A frame without a finding in which no three sensors were compared is not
    auditable.
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
    """A copy of (F, M) scores with NaN for the pair checks that do not count with the sensors missing in a frame."""
    masked = np.array(z, dtype=np.float64)
    for absent, frames in _frames_by_missing(missing).items():
        masked[np.array(frames, dtype=np.intp)[:, None], system.unused(absent)] = np.nan
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
    named = cache(lambda e: _algorithm_2(e, system, present))
    states, audited = _states(z, system, absent)
    remarks = _remarks(z, system, present, states)
    why_not = _why_not_compared(system, present, outside)
    verdicts = []
    for f, e in enumerate(states):
        if not audited[f] and score[f] <= threshold:
            verdicts.append(Verdict(VerdictKind.NOT_AUDITABLE, e, out_of_system=outside, reason=why_not))
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


def _remarks(z: Floats, system: System, present: Sequence[int], states: Sequence[str]) -> list[str]:
    """With which sensors each verdict was reached where these are not all, and what it does not cover.

    It does not cover invented points where the LiDAR is present and no LiDAR conflict is measured: there no two cameras
    see enough of its points or lie far enough apart, or no clean frames gave a threshold.
    """
    outside = [sensor for sensor in system.sensors if sensor not in present]
    without = f"judged without {listed(outside)}" if outside else ""
    conflicts = [e.check is Check.LIDAR_CONFLICT for e in system.pair_checks]
    unchecked = np.logical_and.reduce(np.isnan(z[:, conflicts]), axis=1) & (LIDAR in present)
    alone = f"only {listed(system.fallback)} were compared" if system.fallback else ""
    return [
        "; ".join(filter(None, (without, alone if by_fallback else "", _LIDAR_UNCHECKED if lidar_unchecked else "")))
        for by_fallback, lidar_unchecked in zip(
            (len(e) > len(system.triples) for e in states), unchecked.tolist(), strict=True
        )
    ]


def _why_not_compared(system: System, present: Sequence[int], outside: Sequence[int]) -> str:
    """Why no three of the sensors present were compared in a frame."""
    missing = f"{listed(outside)} missing: " if outside else ""
    if len(present) < FEWEST_COMPARED:
        return f"{missing}three sensors have to be compared, and only {listed(present) or 'none'} were there"
    possible = {
        e for e, unused in zip(system.pair_checks, system.unused(frozenset(outside)), strict=True) if not unused
    }
    cameras = [sensor for sensor in present if sensor != LIDAR]
    if len(cameras) < FEWEST_COMPARED and not any(e.check is Check.LIDAR_CONFLICT for e in possible):
        return f"{missing}{listed(cameras)} lie too close together to check the LiDAR, and no third camera was there"
    return (
        f"{missing}too little of what any three of {listed(present)} see could be compared, or nothing had a threshold"
    )


def _states(z: Floats, system: System, absent: frozenset[int]) -> tuple[list[str], Flags]:
    """The e vector of each frame, and whether (F,) three sensors were compared in it.

    '1' stands where a pair check inside the triple fired, '-' where it was not measured. The fallback's state follows
    where no triple of the sensors present was measured, and it was; the checks that are there for its sake do not
    change the state of any other triple.
    """
    fired, measured = z > 0, ~np.isnan(z)
    usual = ~system.of_fallback
    above, known = triple_states(fired & usual, measured & usual, system.pair_checks, system.triples)
    there = np.array([absent.isdisjoint(triple) for triple in system.triples], dtype=np.bool_)
    by_triples = (known & there).any(axis=1)
    audited: Flags = np.asarray(compared(measured & usual, system.pair_checks, system.triples).any(axis=1))
    e = ["".join(row) for row in _marks(above, known).tolist()]
    if system.fallback is None or not absent.isdisjoint(system.fallback):
        return e, audited
    last = [system.fallback]
    above, known = triple_states(fired, measured, system.pair_checks, last)
    by_fallback = np.flatnonzero(~by_triples & known[:, 0])
    marks = _marks(above, known)[by_fallback, 0].tolist()
    for frame, mark in zip(by_fallback.tolist(), marks, strict=True):
        e[frame] = NOT_MEASURED * len(system.triples) + mark
    audited[by_fallback] |= compared(measured, system.pair_checks, last)[by_fallback, 0]
    return e, audited


def _marks(above: Flags, known: Flags) -> NDArray[np.str_]:
    return np.where(known, np.where(above, ABOVE, NOT_ABOVE), NOT_MEASURED)


def _algorithm_2(e: str, system: System, present: Sequence[int]) -> tuple[int, ...] | None:
    if len(present) < FEWEST_SENSORS:
        return None
    found = identify(e[: len(system.triples)], system.triples, present)
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
