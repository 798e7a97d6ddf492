"""Sensors that stand still while others go on."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

MIN_FRAMES = 2
"""Frames that must be equal to the one before them: a single repeat happens when frames tick faster than a sensor."""


def frozen(prints: Sequence[Mapping[int, int]], sensors: Sequence[int]) -> NDArray[np.bool_]:
    """(F, S) whether a sensor stands still in a frame, from the fingerprints of F successive frames.

    Its data equal those of the frame before, two times running at least, while another sensor's changed at each of
    these steps. Where all stand still the recording does, and nobody is accused. A missing sensor is not frozen.
    """
    shape = (len(prints), len(sensors))
    seen = np.array([[s in frame for s in sensors] for frame in prints], dtype=np.bool_).reshape(shape)
    value = np.array([[frame.get(s, 0) for s in sensors] for frame in prints], dtype=np.int64).reshape(shape)
    both = seen[1:] & seen[:-1]
    changed = both & (value[1:] != value[:-1])
    still = np.zeros(shape, dtype=np.bool_)
    still[1:] = both & ~changed & changed.any(axis=1, keepdims=True)
    return np.asarray(_runs_of(still, MIN_FRAMES))


def _runs_of(still: NDArray[np.bool_], length: int) -> NDArray[np.bool_]:
    """The entries that belong to a run of at least `length` down a column."""
    starts = np.ones((max(len(still) - length + 1, 0), still.shape[1]), dtype=np.bool_)
    for step in range(length):
        starts &= still[step : step + len(starts)]
    result = np.zeros_like(still)
    for step in range(length):
        result[step : step + len(starts)] |= starts
    return result
