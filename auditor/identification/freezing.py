"""Sensors that stand still while others go on."""

import numpy as np
from numpy.typing import NDArray

from auditor.identification.parameters import FROZEN
from auditor.results import NO_FINGERPRINT

MIN_FRAMES = FROZEN.least_repeats
"""Frames that must be equal to the one before them: a single repeat happens when frames tick faster than a sensor."""

Bools = NDArray[np.bool_]


def frozen(prints: NDArray[np.int64], present: Bools) -> Bools:
    """(F, S) whether a sensor stands still in a frame, from the fingerprints (F, S) of F successive frames.

    Its data equal those of the frame before, two times running at least, while another sensor's changed at each of
    these steps. Where all stand still the recording does, and nobody is accused. A sensor that is not `present` (F, S)
    is not frozen, nor one without a fingerprint.
    """
    known = present & (prints != NO_FINGERPRINT)
    both = known[1:] & known[:-1]
    changed = both & (prints[1:] != prints[:-1])
    still = np.zeros(present.shape, dtype=np.bool_)
    still[1:] = both & ~changed & changed.any(axis=1, keepdims=True)
    return np.asarray(_runs_of(still, MIN_FRAMES))


def _runs_of(still: Bools, length: int) -> Bools:
    """The entries that belong to a run of at least `length` down a column."""
    starts = np.ones((max(len(still) - length + 1, 0), still.shape[1]), dtype=np.bool_)
    for step in range(length):
        starts &= still[step : step + len(starts)]
    result = np.zeros_like(still)
    for step in range(length):
        result[step : step + len(starts)] |= starts
    return result
