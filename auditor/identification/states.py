"""Disparity errors become disparity error states: Eq. 6 and Algorithm 1's last step."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

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


def sensors_where(sensors: Sequence[int], chosen: NDArray[np.bool_]) -> list[frozenset[int]]:
    """The sensors of each frame that are chosen, say as missing, from (F, S) flags; few of these sets differ."""
    patterns, which = np.unique(chosen, axis=0, return_inverse=True)
    sets = [frozenset(s for s, there in zip(sensors, row, strict=True) if there) for row in patterns.tolist()]
    return [sets[index] for index in which.ravel().tolist()]


def _state(E: float | None, theta: float | None) -> str:
    if E is None or theta is None or math.isnan(E):
        return NOT_MEASURED
    above = E > theta  # noqa: SIM300  # Eq. 6 as printed
    return ABOVE if above else NOT_ABOVE
