"""The elements of the robust method: what one witness says of one camera pair, and what an attack would make it say."""

from collections.abc import Collection, Iterable, Sequence
from enum import StrEnum
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auditor.rig import LIDAR, Triple

Bools = NDArray[np.bool_]


class Witness(StrEnum):
    """Who says something.

    CONTRADICTED: both cameras of a pair deny the LiDAR. UNLIKE, LIGHT: the two cameras do not see the same. EMPTY: a
    strip of the LiDAR's view has no points.
    """

    CONTRADICTED = "contradicted"
    UNLIKE = "unlike"
    LIGHT = "light"
    EMPTY = "empty"


class Element(NamedTuple):
    """One witness's statistic of the camera pair i < k; of EMPTY, whose i is the LiDAR, of the view of k."""

    witness: Witness
    i: int
    k: int

    @property
    def needed(self) -> tuple[int, ...]:
        """The sensors without which it cannot be measured."""
        return (LIDAR, self.i, self.k) if self.witness is Witness.CONTRADICTED else (self.i, self.k)

    @property
    def accusable(self) -> tuple[int, ...]:
        """The sensors one of which must be attacked where the element is raised."""
        return (LIDAR,) if self.witness is Witness.EMPTY else self.needed


def elements_of(
    cameras: int,
    matched: Iterable[tuple[int, int]],
    contradicting: Iterable[tuple[int, int]],
    views: Iterable[int],
) -> tuple[Element, ...]:
    """All elements in fixed order: pairs that may deny the LiDAR, pairs matched, every pair's light, the LiDAR's views.

    `views` are the reference cameras that the LiDAR is projected into; none without one.
    """
    return (
        *(Element(Witness.CONTRADICTED, i, k) for i, k in contradicting),
        *(Element(Witness.UNLIKE, i, k) for i, k in matched),
        *(Element(Witness.LIGHT, i, k) for i, k in combinations(range(1, cameras + 1), 2)),
        *(Element(Witness.EMPTY, LIDAR, k) for k in views),
    )


def explains(element: Element, attacked: Collection[int]) -> bool:
    """Whether an attack on these sensors can raise the element (Eq. 7, over the sensors it can accuse)."""
    return not set(element.accusable).isdisjoint(attacked)


def demands(element: Element, attacked: Collection[int]) -> float:
    """How surely an attack on these sensors raises the element, 0 to 1.

    A contradiction needs two good cameras and a bad LiDAR. A camera's attack shows as unlikeness, but may be one that
    keeps its pictures alike; light and empty strips are witnesses of one kind of attack: their silence says nothing.
    """
    if element.witness is Witness.CONTRADICTED:
        return float(LIDAR in attacked and element.i not in attacked and element.k not in attacked)
    if element.witness is Witness.UNLIKE:
        return 0.5 if explains(element, attacked) else 0.0
    return 0.0


def triple_states(
    raised: Bools, measured: Bools, elements: Sequence[Element], triples: Sequence[Triple]
) -> tuple[Bools, Bools]:
    """The paper's triples, (F, T) raised and measured, from the same of (F, M) elements.

    A triple's state is the OR of the elements inside it. One with the LiDAR is measured where its pair may contradict
    it, one of cameras where both pairs of the reference were matched; a raised one always is. Algorithm 2 is given
    these states.
    """
    inside = np.array([[set(e.accusable) <= set(t) for t in triples] for e in elements], dtype=np.bool_)
    needed = np.array([[e in _needed(t) for t in triples] for e in elements], dtype=np.bool_)
    found = (measured[:, :, None] & needed).sum(axis=1)
    above = np.asarray((raised[:, :, None] & inside).any(axis=1))
    return above, np.asarray(above | (found == [len(_needed(t)) for t in triples]))


def _needed(triple: Triple) -> tuple[Element, ...]:
    i, j, k = triple
    if i == LIDAR:
        return (Element(Witness.CONTRADICTED, j, k),)
    return (Element(Witness.UNLIKE, i, k), Element(Witness.UNLIKE, j, k))
