"""Which attacks can have made an e vector: Eq. 7 read backwards."""

from collections.abc import Collection, Iterable, Sequence
from itertools import combinations
from math import comb

from auditor.identification.parameters import EXPLANATION
from auditor.identification.states import ABOVE, NOT_ABOVE, NOT_MEASURED
from auditor.rig import Triple

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
