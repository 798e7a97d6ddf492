"""Joint soft identification: the attack that explains all elements at once at the lowest cost."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auditor.elements import OF_THE_LIDAR, Element, Witness
from auditor.identification.explaining import demands, explained
from auditor.identification.parameters import EXPLANATION

PRICE = EXPLANATION.penalty_per_sensor
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


def explain(z: Floats, elements: Sequence[Element], sets: Sequence[tuple[int, ...]]) -> Explanations:
    """Weigh every attack set against (F, M) margins z, NaN where not measured.

    A set pays z for each raised element as far as it does not account for it (`explained`), |z| for each element that
    it should have raised and did not (as surely as `demands` says), and a small price for each sensor. A LiDAR that
    lacks points, or has some here and there, need not be contradicted by the others.
    """
    raised, silent = np.nan_to_num(np.maximum(z, 0)), np.nan_to_num(np.maximum(-z, 0))
    own = np.array([e.witness in OF_THE_LIDAR for e in elements], dtype=np.bool_)
    denied = np.array([e.witness is Witness.CONTRADICTED for e in elements], dtype=np.bool_)
    silent[np.ix_(raised[:, own].any(axis=1), denied)] = 0
    unexplained = np.array([[1 - explained(e, s) for s in sets] for e in elements], dtype=np.float64)
    demanded = np.array([[demands(e, s) for s in sets] for e in elements], dtype=np.float64)
    if not elements:
        unexplained = demanded = np.zeros((0, len(sets)))
    price = PRICE * np.array([len(s) for s in sets], dtype=np.float64)
    return Explanations(tuple(sets), raised @ unexplained + silent @ demanded + price)
