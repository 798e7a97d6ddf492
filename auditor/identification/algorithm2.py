"""Algorithm 2: from the e vector to the attacked sensors, by Lemmas 1 and 2."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from auditor.identification.states import ABOVE, NOT_ABOVE, NOT_MEASURED
from auditor.rig import Triple

FEWEST_SENSORS = 4
"""N sensors tolerate N - 3 attacked ones, so with three an attack has no name."""


@dataclass(frozen=True)
class Identification:
    """Algorithm 2's answer: the sensors it accuses, and those that unmeasured elements leave open. Both ascending."""

    attacked: tuple[int, ...]
    undetermined: tuple[int, ...] = ()


def identify(e: str, triples: Sequence[Triple], sensors: Iterable[int]) -> Identification:
    """Identify the attacked among `sensors`, those that took part.

    `e` has one character for each of `triples`: '0', '1', or '-' where not measured. Triples of other sensors are not
    looked at. With a LiDAR and all n cameras this is Algorithm 2 as printed; otherwise its S_n is the leftmost camera
    that took part, and so on down.
    """
    states = dict(zip(triples, e, strict=True))
    system = sorted(sensors)
    attacked: list[int] = []
    while True:
        *witnesses, k = system
        elements = {(i, j): states.get(Triple(i, j, k), NOT_MEASURED) for i, j in combinations(witnesses, 2)}
        zero = next((pair for pair, state in elements.items() if state == NOT_ABOVE), None)
        if zero is not None:
            found = _lemma_1(zero, elements, witnesses)
            return Identification(tuple(sorted((*attacked, *found.attacked))), found.undetermined)
        if len(system) < FEWEST_SENSORS or NOT_MEASURED in elements.values():
            return Identification(tuple(sorted(attacked)), tuple(system))
        attacked.append(k)  # Lemma 2: all elements are 1, therefore s_k = 1
        if len(system) == FEWEST_SENSORS:
            return Identification(tuple(sorted(attacked)))
        system = witnesses


def _lemma_1(
    zero: tuple[int, int], elements: Mapping[tuple[int, int], str], witnesses: Sequence[int]
) -> Identification:
    """e_{i0,j0,k} = 0 clears S_i0, S_j0 and S_k; each other witness then has s_i = e_{i,i0,k} = e_{i,j0,k}.

    The second form stands in where the first was not measured.
    """
    i0, j0 = zero
    s: dict[int, str] = {}
    for i in witnesses:
        if i in zero:
            continue
        by_i0, by_j0 = elements[min(i, i0), max(i, i0)], elements[min(i, j0), max(i, j0)]
        s[i] = by_j0 if by_i0 == NOT_MEASURED else by_i0
    return Identification(
        attacked=tuple(i for i, state in s.items() if state == ABOVE),
        undetermined=tuple(i for i, state in s.items() if state == NOT_MEASURED),
    )
