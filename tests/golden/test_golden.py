"""The figures of a real frame and of a judged stretch are those that were worked out before."""

import os

import pytest

from tests.golden.values import one_frame, one_stretch, read

pytestmark = pytest.mark.skipif(
    "AUDITOR_TEST_DATA" not in os.environ, reason="AUDITOR_TEST_DATA is not set: no real recorded data"
)


def test_a_real_frame_has_its_golden_counts_and_statistics():
    assert one_frame() == read()["frame"]


def test_a_judged_stretch_has_its_golden_verdicts_margins_and_gaps():
    assert one_stretch() == read()["stretch"]
