"""Disparity error states, the characters of an e vector (Eq. 6)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from auditor.rig import Triple

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
