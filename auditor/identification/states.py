"""Disparity error states, the characters of an e vector (Eq. 6)."""

from collections.abc import Sequence

from auditor.rig import Triple

ABOVE = "1"
NOT_ABOVE = "0"
NOT_MEASURED = "-"


def without(e: str, triples: Sequence[Triple], absent: frozenset[int]) -> str:
    """The e vector with '-' for every triple that an absent sensor belongs to."""
    return "".join(
        NOT_MEASURED if not absent.isdisjoint(triple) else state for state, triple in zip(e, triples, strict=True)
    )
