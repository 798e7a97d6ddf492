"""Clouds compressed by cloudini: those of another program, and every damage of them."""

import base64
import json
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from auditor.errors import DecodingError
from auditor.recordings.decoding.points.cloudini import of_cloudini
from tests.making.cloudini import cloudini

MADE = json.loads(Path(__file__).with_name("cloudini_clouds.json").read_text())
"""Clouds of 30 points as pureini 0.10.0 writes them, and what it reads of them; of each version and encoding."""


def points(packed: bytes) -> np.ndarray:
    return of_cloudini(packed, 10**6, "/points")


@pytest.mark.parametrize("made", MADE, ids=[f"{one['version']} {one['encoding']} {one['fields']}" for one in MADE])
def test_points_are_those_that_another_program_reads(made: dict[str, str]) -> None:
    expected = np.frombuffer(base64.b64decode(made["xyz"]), "<f4").reshape(-1, 3)
    assert np.array_equal(points(base64.b64decode(made["data"])), expected, equal_nan=True)


def test_points_of_several_chunks_are_read_to_the_millimetre() -> None:
    xyz_m = np.random.default_rng(1).normal(0, 30, (33_000, 3)).astype(np.float32)
    xyz_m[[0, 7, 32_768]] = np.nan
    assert points(cloudini(xyz_m)) == pytest.approx(xyz_m, abs=6e-4, nan_ok=True)


@pytest.mark.parametrize("made", MADE, ids=[f"{one['version']} {one['encoding']} {one['fields']}" for one in MADE])
def test_a_cut_cloud_is_damaged(made: dict[str, str]) -> None:
    packed = base64.b64decode(made["data"])
    # Sections behind the points hold what is not read: an end that only they lack is not seen where nothing is packed.
    for length in (*range(len(packed) // 2), *range(len(packed) // 2, len(packed) * 9 // 10, 5)):
        with pytest.raises(DecodingError):
            points(packed[:length])


@given(at=st.integers(0, 10**4), value=st.integers(0, 255), which=st.integers(0, len(MADE) - 1))
@settings(max_examples=300, deadline=None)
def test_no_byte_makes_another_error(at: int, value: int, which: int) -> None:
    packed = bytearray(base64.b64decode(MADE[which]["data"]))
    packed[at % len(packed)] = value
    with suppress(DecodingError):
        assert points(bytes(packed)).shape[1] == 3


def test_more_points_than_the_message_says_are_refused() -> None:
    with pytest.raises(DecodingError, match="100 points, and 99"):
        of_cloudini(cloudini(np.zeros((100, 3), np.float32)), 99, "/points")


def test_a_small_message_does_not_become_a_large_one() -> None:
    packed = cloudini(np.zeros((10, 3), np.float32)).replace(b"width: 10\n", b"width: 1999999999\n")
    with pytest.raises(DecodingError):
        of_cloudini(packed, 10**10, "/points")
    began = time.process_time()
    bomb = base64.b64decode(MADE[-1]["data"]).replace(b"width: 30\n", b"width: 1900000\n")
    with pytest.raises(DecodingError):
        of_cloudini(bomb, 10**7, "/points")
    assert time.process_time() - began < 5
