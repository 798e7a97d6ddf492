"""Margins averaged over a moment: attacks last, most mistakes do not."""

import numpy as np
from numpy.typing import NDArray

from auditor.identification.parameters import TEMPORAL_WINDOW

NANOSECONDS = 1_000_000_000
GAP_PERIODS = TEMPORAL_WINDOW.gap_periods

Floats = NDArray[np.float64]


def window_means(z: Floats, stamp_ns: NDArray[np.int64], seconds: float) -> Floats:
    """(F, M) means of the measured margins within `seconds` / 2 of each frame, never across a gap.

    `z` is (F, M), NaN where not measured, of successive frames with their stamps (F,). A gap is a step of more than 2.5
    times the median step, or one back: there the clock was set. Where nothing in the window was measured the mean is
    NaN.
    """
    half = int(seconds * NANOSECONDS / 2)
    step = np.diff(stamp_ns, prepend=stamp_ns[:1])
    usual = np.median(step[1:]) if step.size > 1 else 0
    run = np.cumsum((step < 0) | (step > GAP_PERIODS * usual))
    time_ns = np.cumsum(np.maximum(step, 0))
    first_of_run = np.searchsorted(run, run, side="left")
    end_of_run = np.searchsorted(run, run, side="right")
    first = np.maximum(np.searchsorted(time_ns, time_ns - half, side="left"), first_of_run)
    end = np.minimum(np.searchsorted(time_ns, time_ns + half, side="right"), end_of_run)
    measured = ~np.isnan(z)
    total = np.vstack([np.zeros((1, z.shape[1])), np.cumsum(np.where(measured, z, 0), axis=0)])
    count = np.vstack([np.zeros((1, z.shape[1])), np.cumsum(measured, axis=0)])
    number = count[end] - count[first]
    return np.where(number > 0, (total[end] - total[first]) / np.maximum(number, 1), np.nan)
