from collections.abc import Iterator

import pytest

from tests.making.matched_once import matched_once


@pytest.fixture(scope="module", autouse=True)
def _matched_once() -> Iterator[None]:
    """Evaluations of a file's tests attack the same frames alike, whole, in shares, after a kill, and as recordings."""
    with matched_once():
        yield
