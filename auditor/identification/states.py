"""Disparity errors become disparity error states: Eq. 6 and Algorithm 1's last step."""

import math
from collections.abc import Sequence

from auditor.rig import Triple
from auditor.thresholds import Thresholds

ABOVE = "1"
NOT_ABOVE = "0"
NOT_MEASURED = "-"


def state_vector(errors: Sequence[float | None], thresholds: Thresholds, triples: Sequence[Triple]) -> str:
    """The e vector (Eq. 6), one character a triple: '1' where E > theta, '0' where not, '-' where not measured.

    `errors` are the disparity errors E in the order of `triples`; None, NaN, and a triple without theta are '-'.
    """
    return "".join(_state(E, thresholds.theta.get(triple)) for E, triple in zip(errors, triples, strict=True))


def without(e: str, triples: Sequence[Triple], absent: frozenset[int]) -> str:
    """The e vector with '-' for every triple that an absent sensor belongs to."""
    return "".join(
        NOT_MEASURED if not absent.isdisjoint(triple) else state for state, triple in zip(e, triples, strict=True)
    )


def _state(E: float | None, theta: float | None) -> str:
    if E is None or theta is None or math.isnan(E):
        return NOT_MEASURED
    above = E > theta  # noqa: SIM300  # Eq. 6 as printed
    return ABOVE if above else NOT_ABOVE
