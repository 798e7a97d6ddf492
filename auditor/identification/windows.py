"""Margins averaged over a moment: attacks last, most mistakes do not."""

import numpy as np
from numpy.typing import NDArray

NANOSECONDS = 1_000_000_000
GAP_PERIODS = 2.5

Floats = NDArray[np.float64]


def window_means(z: Floats, stamp_ns: NDArray[np.int64], seconds: float) -> Floats:
    """(F, M) means of the measured margins within `seconds` / 2 of each frame, never across a gap.

    `z` is (F, M), NaN where not measured, of frames in the order of their stamps (F,). A gap is a step of more than 2.5
    times the median step. Where nothing in the window was measured the mean is NaN.
    """
    step = np.diff(stamp_ns)
    gap = step > GAP_PERIODS * np.median(step) if step.size else np.zeros(0, dtype=np.bool_)
    run = np.concatenate([[0], np.cumsum(gap)])
    first_of_run = np.searchsorted(run, run, side="left")
    end_of_run = np.searchsorted(run, run, side="right")
    half = int(seconds * NANOSECONDS / 2)
    first = np.maximum(np.searchsorted(stamp_ns, stamp_ns - half, side="left"), first_of_run)
    end = np.minimum(np.searchsorted(stamp_ns, stamp_ns + half, side="right"), end_of_run)
    measured = ~np.isnan(z)
    total = np.vstack([np.zeros((1, z.shape[1])), np.cumsum(np.where(measured, z, 0), axis=0)])
    count = np.vstack([np.zeros((1, z.shape[1])), np.cumsum(measured, axis=0)])
    number = count[end] - count[first]
    return np.where(number > 0, (total[end] - total[first]) / np.maximum(number, 1), np.nan)
