"""Attack sets and pair checks: which attacks make which checks fire, and how badly each attack fits a frame.

This is the soft form of Eq. 7 read backwards. Algorithm 2 decides from states 0 and 1; here every pair check counts
with its normalised score z, and the attack set of the lowest cost is the best explanation.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from auditor.identification.parameters import ATTACK_SET_COST
from auditor.model.arrays import Flags, Floats, Indices
from auditor.model.checks import LIDAR_CHECKS, Check, PairCheck
from auditor.model.rig import LIDAR, Triple


def covers(pair_check: PairCheck, attacked: Collection[int]) -> bool:
    """Whether an attack on these sensors can make the pair check fire (Eq. 7, over its nameable sensors)."""
    return not set(pair_check.nameable).isdisjoint(attacked)


def covered_share(pair_check: PairCheck, attacked: Collection[int]) -> float:
    """How much of a fired pair check's z an attack on these sensors covers, 0 to 1.

    A LiDAR conflict means that two cameras agree with each other. An attack on one of the cameras seldom looks like
    that (a shifted image does), so it covers most of the conflict, and not all.
    """
    if not covers(pair_check, attacked):
        return 0.0
    by_a_camera = pair_check.check is Check.LIDAR_CONFLICT and LIDAR not in attacked
    return ATTACK_SET_COST.conflict_by_a_camera if by_a_camera else 1.0


def expects(pair_check: PairCheck, attacked: Collection[int]) -> float:
    """How surely an attack on these sensors makes the pair check fire, 0 to 1.

    A LiDAR conflict needs an attacked LiDAR and two cameras that are not attacked. An attack on a camera usually makes
    its pairs inconsistent, but need not. A brightness difference, point dropout and isolated points are each the mark
    of one kind of attack: that they do not fire excludes nothing.
    """
    if pair_check.check is Check.LIDAR_CONFLICT:
        return float(LIDAR in attacked and pair_check.i not in attacked and pair_check.k not in attacked)
    if pair_check.check is Check.PHOTOMETRIC_INCONSISTENCY:
        return ATTACK_SET_COST.photometric_expected if covers(pair_check, attacked) else 0.0
    return 0.0


@dataclass(frozen=True, eq=False)
class AttackSetCosts:
    """`cost[f, s]`: how badly frame f disagrees with attack set s, (F, S); `sets[0]` is the empty one."""

    sets: tuple[tuple[int, ...], ...]
    cost: Floats

    @property
    def best(self) -> Indices:
        """(F,) index of the cheapest set of each frame."""
        return np.asarray(self.cost.argmin(axis=1), dtype=np.intp)

    @property
    def score(self) -> Floats:
        """(F,) how much better the best attack explains a frame than no attack does."""
        attacks = self.cost[:, 1:].min(axis=1, initial=np.inf)
        return np.asarray(self.cost[:, 0] - attacks)

    @property
    def gap(self) -> Floats:
        """(F,) how much worse the second-best attack set is than the best; infinite where there is only one."""
        if len(self.sets) < 2:
            return np.full(len(self.cost), np.inf)
        two = np.partition(self.cost, 1, axis=1)
        return np.asarray(two[:, 1] - two[:, 0])


def attack_set_costs(z: Floats, pair_checks: Sequence[PairCheck], sets: Sequence[tuple[int, ...]]) -> AttackSetCosts:
    """The cost of every attack set in every frame, from (F, M) normalised scores z, NaN where not measured.

    A set costs the z of each fired pair check as far as it does not cover it (`covered_share`), the |z| of each pair
    check that did not fire as surely as the set expects it (`expects`), and a small penalty per sensor. Where a check
    of the LiDAR alone fires, LiDAR conflicts are not expected: a LiDAR that lacks points, or has isolated ones, need
    not disagree with the cameras.
    """
    fired, not_fired = np.nan_to_num(np.maximum(z, 0)), np.nan_to_num(np.maximum(-z, 0))
    lidar_checks = np.array([e.check in LIDAR_CHECKS for e in pair_checks], dtype=np.bool_)
    conflicts = np.array([e.check is Check.LIDAR_CONFLICT for e in pair_checks], dtype=np.bool_)
    not_fired[np.ix_(fired[:, lidar_checks].any(axis=1), conflicts)] = 0
    uncovered = np.array([[1 - covered_share(e, s) for s in sets] for e in pair_checks], dtype=np.float64)
    expected = np.array([[expects(e, s) for s in sets] for e in pair_checks], dtype=np.float64)
    if not pair_checks:
        uncovered = expected = np.zeros((0, len(sets)))
    penalty = ATTACK_SET_COST.penalty_per_sensor * np.array([len(s) for s in sets], dtype=np.float64)
    return AttackSetCosts(tuple(sets), fired @ uncovered + not_fired @ expected + penalty)


def triple_states(
    fired: Flags, measured: Flags, pair_checks: Sequence[PairCheck], triples: Sequence[Triple]
) -> tuple[Flags, Flags]:
    """The states of the paper's triples, (F, T) above and measured, from (F, M) fired and measured pair checks.

    A triple is above where a pair check inside it fired. A triple with the LiDAR is measured where the LiDAR conflict
    of its cameras is; one of cameras where both pairs with the reference were compared; one that is above always is.
    These states are the input of Algorithm 2.
    """
    inside = np.array([[set(e.nameable) <= set(t) for t in triples] for e in pair_checks], dtype=np.bool_)
    above = np.asarray((fired[:, :, None] & inside).any(axis=1))
    return above, np.asarray(above | compared(measured, pair_checks, triples))


def compared(measured: Flags, pair_checks: Sequence[PairCheck], triples: Sequence[Triple]) -> Flags:
    """(F, T) whether the disparities of all three sensors of a triple were compared, from (F, M) measured pair checks.

    A brightness difference compares no disparities, and a check of the LiDAR alone no sensors.
    """
    needed = np.array([[e in _needed(t) for t in triples] for e in pair_checks], dtype=np.bool_)
    found = (measured[:, :, None] & needed.reshape(len(pair_checks), len(triples))).sum(axis=1)
    return np.asarray(found == np.array([len(_needed(t)) for t in triples], dtype=np.intp))


def _needed(triple: Triple) -> tuple[PairCheck, ...]:
    i, j, k = triple
    if i == LIDAR:
        return (PairCheck(Check.LIDAR_CONFLICT, j, k),)
    return (PairCheck(Check.PHOTOMETRIC_INCONSISTENCY, i, k), PairCheck(Check.PHOTOMETRIC_INCONSISTENCY, j, k))
