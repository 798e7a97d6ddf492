"""The figures of a real frame and of a judged stretch are those that were worked out before."""

import os
from collections.abc import Iterator

import pytest

from tests.golden.values import FRAME, STRETCH, one_frame, one_stretch, read

pytestmark = pytest.mark.skipif(
    "AUDITOR_TEST_DATA" not in os.environ, reason="AUDITOR_TEST_DATA is not set: no real recorded data"
)

TOLERANCE = 1e-6
"""Counts are equal. Sums of single-precision numbers may be made in another order by another NumPy: 1e-7 a sum."""


def leaves(value: object, where: str = "") -> Iterator[tuple[str, object]]:
    """Every number and word in a nested value, by its place; floats are equal up to the tolerance."""
    if isinstance(value, dict | list):
        parts = value.items() if isinstance(value, dict) else enumerate(value)
        yield where, len(value)
        for name, part in parts:
            yield from leaves(part, f"{where}/{name}")
    else:
        yield (
            where,
            pytest.approx(value, rel=TOLERANCE, abs=TOLERANCE, nan_ok=True) if isinstance(value, float) else value,
        )


def test_a_real_frame_has_its_golden_counts_and_statistics():
    assert dict(leaves(one_frame())) == dict(leaves(read(FRAME)))


def test_a_judged_stretch_has_its_golden_verdicts_margins_and_gaps():
    assert dict(leaves(one_stretch())) == dict(leaves(read(STRETCH)))
