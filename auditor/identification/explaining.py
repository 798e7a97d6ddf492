"""What an attack on some sensors makes of the elements: which it can raise and which it should have raised."""

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from auditor.elements import Element, Witness
from auditor.identification.parameters import EXPLANATION
from auditor.rig import LIDAR, Triple

Bools = NDArray[np.bool_]


def explains(element: Element, attacked: Collection[int]) -> bool:
    """Whether an attack on these sensors can raise the element (Eq. 7, over the sensors it can accuse)."""
    return not set(element.accusable).isdisjoint(attacked)


def explained(element: Element, attacked: Collection[int]) -> float:
    """How well an attack on these sensors accounts for the raised element, 0 to 1.

    A contradiction says that two cameras agree: an attack on one of them seldom looks like that, say a picture shifted
    sideways, and accounts for most of it, but not for all.
    """
    if not explains(element, attacked):
        return 0.0
    by_a_camera = element.witness is Witness.CONTRADICTED and LIDAR not in attacked
    return EXPLANATION.conflict_by_a_camera if by_a_camera else 1.0


def demands(element: Element, attacked: Collection[int]) -> float:
    """How surely an attack on these sensors raises the element, 0 to 1.

    A contradiction needs two good cameras and a bad LiDAR. A camera's attack shows as unlikeness, but may be one that
    keeps its pictures alike; light, empty strips and scattered points are witnesses of one kind of attack each: their
    silence says nothing.
    """
    if element.witness is Witness.CONTRADICTED:
        return float(LIDAR in attacked and element.i not in attacked and element.k not in attacked)
    if element.witness is Witness.UNLIKE:
        return EXPLANATION.photometric_expected if explains(element, attacked) else 0.0
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
