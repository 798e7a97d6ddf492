"""From disparity errors to the attacked sensors: Eq. 6, Eq. 7 read backwards, and Algorithm 2 by Lemmas 1 and 2."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from auditor.model.arrays import Flags
from auditor.model.rig import Triple

ABOVE, NOT_ABOVE, NOT_MEASURED = "1", "0", "-"
"""The states of an element of e (Eq. 6): E > theta, E <= theta, or no E."""

FEWEST_SENSORS = 4
"""N sensors tolerate N - 3 attacked ones, so with three an attack has no name."""

FEWEST_COMPARED = 3
"""The sensors of a triple: fewer cannot be compared."""

MOST_LISTED = 2
"""Attack sets that a verdict lists beside the best."""


@dataclass(frozen=True)
class Identification:
    """Algorithm 2's answer: the attacked sensors, and those that unmeasured elements leave open. Both ascending."""

    attacked: tuple[int, ...]
    undetermined: tuple[int, ...] = ()


def identify(e: str, triples: Sequence[Triple], sensors: Iterable[int]) -> Identification:
    """Identify the attacked among `sensors`, those that took part.

    `e` has one character for each of `triples`: '0', '1', or '-' where not measured. Triples of other sensors are
    ignored. With a LiDAR and all n cameras this is Algorithm 2 as printed; otherwise its S_n is the leftmost camera
    that took part, and so on down.
    """
    states = dict(zip(triples, e, strict=True))
    system = sorted(sensors)
    attacked: list[int] = []
    while True:
        *sources, k = system
        elements = {(i, j): states.get(Triple(i, j, k), NOT_MEASURED) for i, j in combinations(sources, 2)}
        zero = next((pair for pair, state in elements.items() if state == NOT_ABOVE), None)
        if zero is not None:
            found = _lemma_1(zero, elements, sources)
            return Identification(tuple(sorted((*attacked, *found.attacked))), found.undetermined)
        if len(system) < FEWEST_SENSORS or NOT_MEASURED in elements.values():
            return Identification(tuple(sorted(attacked)), tuple(system))
        attacked.append(k)  # Lemma 2: all elements are 1, therefore s_k = 1
        if len(system) == FEWEST_SENSORS:
            return Identification(tuple(sorted(attacked)))
        system = sources


def _lemma_1(zero: tuple[int, int], elements: Mapping[tuple[int, int], str], sources: Sequence[int]) -> Identification:
    """e_{i0,j0,k} = 0: S_i0, S_j0 and S_k are not attacked; each other source then has s_i = e_{i,i0,k} = e_{i,j0,k}.

    The second form stands in where the first was not measured.
    """
    i0, j0 = zero
    s: dict[int, str] = {}
    for i in sources:
        if i in zero:
            continue
        by_i0, by_j0 = elements[min(i, i0), max(i, i0)], elements[min(i, j0), max(i, j0)]
        s[i] = by_j0 if by_i0 == NOT_MEASURED else by_i0
    return Identification(
        attacked=tuple(i for i, state in s.items() if state == ABOVE),
        undetermined=tuple(i for i, state in s.items() if state == NOT_MEASURED),
    )


def codeword(attacked: Collection[int], triples: Sequence[Triple]) -> str:
    """The e vector of an attack (Eq. 7): an element is '1' where a sensor of its triple is attacked."""
    return "".join(ABOVE if any(sensor in attacked for sensor in triple) else NOT_ABOVE for triple in triples)


def disagreements(e: str, attacked: Collection[int], triples: Sequence[Triple]) -> int:
    """How many measured elements of e differ from the codeword of an attack."""
    return sum(
        state not in (NOT_MEASURED, expected) for state, expected in zip(e, codeword(attacked, triples), strict=True)
    )


def without(e: str, triples: Sequence[Triple], absent: frozenset[int]) -> str:
    """The e vector with '-' for every triple that an absent sensor belongs to."""
    return "".join(
        NOT_MEASURED if not absent.isdisjoint(triple) else state for state, triple in zip(e, triples, strict=True)
    )


def listed(sensors: Sequence[int]) -> str:
    """Sensors in words: S_1, S_2 and S_3."""
    names = [f"S_{sensor}" for sensor in sensors]
    return " and ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))


def sensors_where(sensors: Sequence[int], chosen: Flags) -> list[frozenset[int]]:
    """The chosen sensors of each frame, such as the missing ones, from (F, S) flags."""
    if not chosen.any():
        return [frozenset()] * len(chosen)
    patterns, which = np.unique(chosen, axis=0, return_inverse=True)
    sets = [frozenset(s for s, there in zip(sensors, row, strict=True) if there) for row in patterns.tolist()]
    return [sets[index] for index in which.ravel().tolist()]
