"""Which attacks explain which checks, and at what penalty: joint soft identification."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auditor.identification.parameters import EXPLANATION
from auditor.model.checks import LIDAR_CHECKS, Check, PairCheck
from auditor.model.rig import LIDAR, Triple

Bools = NDArray[np.bool_]


def explains(pair_check: PairCheck, attacked: Collection[int]) -> bool:
    """Whether an attack on these sensors can raise the element (Eq. 7, over the sensors it can accuse)."""
    return not set(pair_check.nameable).isdisjoint(attacked)


def explained(pair_check: PairCheck, attacked: Collection[int]) -> float:
    """How well an attack on these sensors accounts for the raised element, 0 to 1.

    A contradiction says that two cameras agree: an attack on one of them seldom looks like that, say a picture shifted
    sideways, and accounts for most of it, but not for all.
    """
    if not explains(pair_check, attacked):
        return 0.0
    by_a_camera = pair_check.check is Check.LIDAR_CONFLICT and LIDAR not in attacked
    return EXPLANATION.conflict_by_a_camera if by_a_camera else 1.0


def expects(pair_check: PairCheck, attacked: Collection[int]) -> float:
    """How surely an attack on these sensors raises the element, 0 to 1.

    A contradiction needs two good cameras and a bad LiDAR. A camera's attack shows as unlikeness, but may be one that
    keeps its pictures alike; light, empty strips and scattered points are witnesses of one kind of attack each: their
    silence says nothing.
    """
    if pair_check.check is Check.LIDAR_CONFLICT:
        return float(LIDAR in attacked and pair_check.i not in attacked and pair_check.k not in attacked)
    if pair_check.check is Check.PHOTOMETRIC_INCONSISTENCY:
        return EXPLANATION.photometric_expected if explains(pair_check, attacked) else 0.0
    return 0.0


def triple_states(
    fired: Bools, measured: Bools, pair_checks: Sequence[PairCheck], triples: Sequence[Triple]
) -> tuple[Bools, Bools]:
    """The paper's triples, (F, T) raised and measured, from the same of (F, M) elements.

    A triple's state is the OR of the elements inside it. One with the LiDAR is measured where its pair may contradict
    it, one of cameras where both pairs of the reference were matched; a raised one always is. Algorithm 2 is given
    these states.
    """
    inside = np.array([[set(e.nameable) <= set(t) for t in triples] for e in pair_checks], dtype=np.bool_)
    needed = np.array([[e in _needed(t) for t in triples] for e in pair_checks], dtype=np.bool_)
    found = (measured[:, :, None] & needed).sum(axis=1)
    above = np.asarray((fired[:, :, None] & inside).any(axis=1))
    return above, np.asarray(above | (found == [len(_needed(t)) for t in triples]))


def _needed(triple: Triple) -> tuple[PairCheck, ...]:
    i, j, k = triple
    if i == LIDAR:
        return (PairCheck(Check.LIDAR_CONFLICT, j, k),)
    return (PairCheck(Check.PHOTOMETRIC_INCONSISTENCY, i, k), PairCheck(Check.PHOTOMETRIC_INCONSISTENCY, j, k))


PENALTY_PER_SENSOR = EXPLANATION.penalty_per_sensor
"""Of each attacked sensor, in margins: between two explanations as good the smaller one is taken."""


Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Explanations:
    """`cost[f, s]`: how badly frame f disagrees with attack set s, (F, S); `sets[0]` is the empty one."""

    sets: tuple[tuple[int, ...], ...]
    cost: Floats

    @property
    def best(self) -> NDArray[np.intp]:
        """(F,) index of the cheapest set of each frame."""
        return np.asarray(self.cost.argmin(axis=1), dtype=np.intp)

    @property
    def score(self) -> Floats:
        """(F,) how much better the best attack explains a frame than no attack does; raised where > 0."""
        attacks = self.cost[:, 1:].min(axis=1, initial=np.inf)
        return np.asarray(self.cost[:, 0] - attacks)

    @property
    def lead(self) -> Floats:
        """(F,) how much worse the second-best attack set is than the best; infinite where there is only one."""
        if len(self.sets) < 2:
            return np.full(len(self.cost), np.inf)
        two = np.partition(self.cost, 1, axis=1)
        return np.asarray(two[:, 1] - two[:, 0])

    def ranked(self, frame: int) -> list[tuple[tuple[int, ...], float]]:
        """All attack sets of one frame with their costs, best first."""
        order = np.argsort(self.cost[frame], kind="stable")
        return [(self.sets[s], float(self.cost[frame, s])) for s in order]


def explain(z: Floats, pair_checks: Sequence[PairCheck], sets: Sequence[tuple[int, ...]]) -> Explanations:
    """Weigh every attack set against (F, M) margins z, NaN where not measured.

    A set pays z for each raised element as far as it does not account for it (`explained`), |z| for each element that
    it should have raised and did not (as surely as `demands` says), and a small price for each sensor. A LiDAR that
    lacks points, or has some here and there, need not be contradicted by the others.
    """
    fired, silent = np.nan_to_num(np.maximum(z, 0)), np.nan_to_num(np.maximum(-z, 0))
    own = np.array([e.check in LIDAR_CHECKS for e in pair_checks], dtype=np.bool_)
    denied = np.array([e.check is Check.LIDAR_CONFLICT for e in pair_checks], dtype=np.bool_)
    silent[np.ix_(fired[:, own].any(axis=1), denied)] = 0
    unexplained = np.array([[1 - explained(e, s) for s in sets] for e in pair_checks], dtype=np.float64)
    expected_silent = np.array([[expects(e, s) for s in sets] for e in pair_checks], dtype=np.float64)
    if not pair_checks:
        unexplained = expected_silent = np.zeros((0, len(sets)))
    penalty = PENALTY_PER_SENSOR * np.array([len(s) for s in sets], dtype=np.float64)
    return Explanations(tuple(sets), fired @ unexplained + silent @ expected_silent + penalty)
