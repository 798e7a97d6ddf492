"""From disparity errors to the attacked sensors: Eq. 6, Eq. 7 read backwards, and Algorithm 2 by Lemmas 1 and 2."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np
from numpy.typing import NDArray

from auditor.identification.parameters import EXPLANATION
from auditor.model.rig import Triple

ABOVE = "1"


NOT_ABOVE = "0"


NOT_MEASURED = "-"


def without(e: str, triples: Sequence[Triple], absent: frozenset[int]) -> str:
    """The e vector with '-' for every triple that an absent sensor belongs to."""
    return "".join(
        NOT_MEASURED if not absent.isdisjoint(triple) else state for state, triple in zip(e, triples, strict=True)
    )


def sensors_where(sensors: Sequence[int], chosen: NDArray[np.bool_]) -> list[frozenset[int]]:
    """The sensors of each frame that are chosen, say as missing, from (F, S) flags; few of these sets differ."""
    patterns, which = np.unique(chosen, axis=0, return_inverse=True)
    sets = [frozenset(s for s, there in zip(sensors, row, strict=True) if there) for row in patterns.tolist()]
    return [sets[index] for index in which.ravel().tolist()]


MOST_SETS = EXPLANATION.most_sets
"""Attack sets that are listed at most; of more sensors only the sets of the fewest attacked ones are."""


def codeword(attacked: Collection[int], triples: Sequence[Triple]) -> str:
    """The e vector of an attack (Eq. 7): an element is '1' where a sensor of its triple is attacked."""
    return "".join(ABOVE if any(sensor in attacked for sensor in triple) else NOT_ABOVE for triple in triples)


def allowed_attack_sets(sensors: Iterable[int]) -> tuple[tuple[int, ...], ...]:
    """The attacks that N sensors can tell apart: no sensor, then one, up to N - 3 of them.

    No more than MOST_SETS are listed, whole sizes.
    """
    system = sorted(sensors)
    sets: list[tuple[int, ...]] = []
    for size in range(max(len(system) - 3, 0) + 1):
        if len(sets) + comb(len(system), size) > MOST_SETS:
            break
        sets.extend(combinations(system, size))
    return tuple(sets)


def disagreements(e: str, attacked: Collection[int], triples: Sequence[Triple]) -> int:
    """How many measured elements of e differ from the codeword of an attack."""
    return sum(
        state not in (NOT_MEASURED, expected) for state, expected in zip(e, codeword(attacked, triples), strict=True)
    )


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
        *sources, k = system
        pair_checks = {(i, j): states.get(Triple(i, j, k), NOT_MEASURED) for i, j in combinations(sources, 2)}
        zero = next((pair for pair, state in pair_checks.items() if state == NOT_ABOVE), None)
        if zero is not None:
            found = _lemma_1(zero, pair_checks, sources)
            return Identification(tuple(sorted((*attacked, *found.attacked))), found.undetermined)
        if len(system) < FEWEST_SENSORS or NOT_MEASURED in pair_checks.values():
            return Identification(tuple(sorted(attacked)), tuple(system))
        attacked.append(k)  # Lemma 2: all elements are 1, therefore s_k = 1
        if len(system) == FEWEST_SENSORS:
            return Identification(tuple(sorted(attacked)))
        system = sources


def _lemma_1(
    zero: tuple[int, int], pair_checks: Mapping[tuple[int, int], str], sources: Sequence[int]
) -> Identification:
    """e_{i0,j0,k} = 0 clears S_i0, S_j0 and S_k; each other witness then has s_i = e_{i,i0,k} = e_{i,j0,k}.

    The second form stands in where the first was not measured.
    """
    i0, j0 = zero
    s: dict[int, str] = {}
    for i in sources:
        if i in zero:
            continue
        by_i0, by_j0 = pair_checks[min(i, i0), max(i, i0)], pair_checks[min(i, j0), max(i, j0)]
        s[i] = by_j0 if by_i0 == NOT_MEASURED else by_i0
    return Identification(
        attacked=tuple(i for i, state in s.items() if state == ABOVE),
        undetermined=tuple(i for i, state in s.items() if state == NOT_MEASURED),
    )
