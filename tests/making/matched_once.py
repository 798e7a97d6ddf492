"""Pairs that several measurements share are matched once: SGBM gives equal images equal disparities."""

from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import blake2b

import numpy as np
import pytest
from numpy.typing import NDArray

from auditor.measurement.disparity.matchers import SgbmMatcher


@contextmanager
def matched_once() -> Iterator[None]:
    """Inside, SGBM of this process remembers what it matched by the pixels of both images."""
    known: dict[tuple[SgbmMatcher, bytes], NDArray[np.float32]] = {}
    really = SgbmMatcher.match

    def match(matcher: SgbmMatcher, left: NDArray[np.uint8], right: NDArray[np.uint8]) -> NDArray[np.float32]:
        pixels = blake2b(repr((left.shape, right.shape)).encode())
        for image in (left, right):
            pixels.update(np.ascontiguousarray(image))
        key = matcher, pixels.digest()
        if key not in known:
            known[key] = really(matcher, left, right)
        return known[key].copy()

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(SgbmMatcher, "match", match)
        yield
