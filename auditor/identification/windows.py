"""Margins averaged over a moment: attacks last, most mistakes do not."""

import numpy as np
from numpy.typing import NDArray

from auditor.identification.parameters import TEMPORAL_WINDOW

NANOSECONDS = 1_000_000_000
GAP_PERIODS = TEMPORAL_WINDOW.gap_periods

Floats = NDArray[np.float64]


def runs_of(stamp_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """(F,) the number of the run that each successive frame belongs to: runs end at gaps.

    A gap is a step of more than 2.5 times the median step, or one back: there the clock was set.
    """
    step = np.diff(stamp_ns, prepend=stamp_ns[:1])
    usual = np.median(step[1:]) if step.size > 1 else 0
    return np.asarray(np.cumsum((step < 0) | (step > GAP_PERIODS * usual)))


def window_means(
    z: Floats, stamp_ns: NDArray[np.int64], seconds: float, runs: NDArray[np.int64] | None = None
) -> Floats:
    """(F, M) means of the measured margins within `seconds` / 2 of each frame, never across two runs.

    `z` is (F, M), NaN where not measured, of successive frames with their stamps (F,); `runs` (F,) numbers their runs
    in ascending order where they are known, else they are `runs_of` the stamps. Where nothing in the window was
    measured the mean is NaN.
    """
    half = int(seconds * NANOSECONDS / 2)
    run = runs_of(stamp_ns) if runs is None else runs
    step = np.diff(stamp_ns, prepend=stamp_ns[:1])
    time_ns = np.cumsum(np.where(np.diff(run, prepend=run[:1]) > 0, 2 * half + 1, step))
    first_of_run = np.searchsorted(run, run, side="left")
    end_of_run = np.searchsorted(run, run, side="right")
    first = np.maximum(np.searchsorted(time_ns, time_ns - half, side="left"), first_of_run)
    end = np.minimum(np.searchsorted(time_ns, time_ns + half, side="right"), end_of_run)
    measured = ~np.isnan(z)
    total = np.vstack([np.zeros((1, z.shape[1])), np.cumsum(np.where(measured, z, 0), axis=0)])
    count = np.vstack([np.zeros((1, z.shape[1])), np.cumsum(measured, axis=0)])
    number = count[end] - count[first]
    return np.where(number > 0, (total[end] - total[first]) / np.maximum(number, 1), np.nan)
