"""Eq. 6 and Eq. 7 as they are printed, one element at a time: the package's fast ways are compared with them."""

import math
from collections.abc import Iterable, Sequence
from itertools import combinations

from auditor.identification.paper import disagreements
from auditor.model.calibration import Thresholds
from auditor.model.rig import Triple


def state_vector(errors: Sequence[float], thresholds: Thresholds, triples: Sequence[Triple]) -> str:
    """The e vector (Eq. 6): '1' where E > theta, '0' where not, '-' where E is NaN or the triple has no theta."""
    states = []
    for E, triple in zip(errors, triples, strict=True):
        theta = thresholds.theta.get(triple)
        states.append("-" if theta is None or math.isnan(E) else "1" if E > theta else "0")  # noqa: SIM300
    return "".join(states)


def allowed_attack_sets(sensors: Iterable[int]) -> tuple[tuple[int, ...], ...]:
    """The attacks that N sensors can tell apart: no sensor, then one, up to N - 3 of them."""
    system = sorted(sensors)
    return tuple(attacked for size in range(max(len(system) - 3, 0) + 1) for attacked in combinations(system, size))


def explaining_sets(e: str, triples: Sequence[Triple], sensors: Iterable[int]) -> tuple[tuple[int, ...], ...]:
    """The allowed attack sets whose codeword (Eq. 7) agrees with every measured element of e."""
    return tuple(attacked for attacked in allowed_attack_sets(sensors) if disagreements(e, attacked, triples) == 0)
