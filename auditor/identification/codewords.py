"""Which attacks can have made an e vector: Eq. 7 read backwards."""

from collections.abc import Collection, Iterable, Sequence
from itertools import combinations

from auditor.identification.states import ABOVE, NOT_ABOVE, NOT_MEASURED
from auditor.rig import Triple


def codeword(attacked: Collection[int], triples: Sequence[Triple]) -> str:
    """The e vector of an attack (Eq. 7): an element is '1' where a sensor of its triple is attacked."""
    return "".join(ABOVE if any(sensor in attacked for sensor in triple) else NOT_ABOVE for triple in triples)


def allowed_attack_sets(sensors: Iterable[int]) -> tuple[tuple[int, ...], ...]:
    """The attacks that N sensors can tell apart: no sensor, and up to N - 3 of them; smallest first."""
    system = sorted(sensors)
    return tuple(attacked for size in range(max(len(system) - 3, 0) + 1) for attacked in combinations(system, size))


def disagreements(e: str, attacked: Collection[int], triples: Sequence[Triple]) -> int:
    """How many measured elements of e differ from the codeword of an attack."""
    return sum(
        state not in (NOT_MEASURED, expected) for state, expected in zip(e, codeword(attacked, triples), strict=True)
    )
