"""The windowed ratio of inconsistent pixels on the cell grid, and scores averaged over a temporal window."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from auditor.identification.parameters import LOCAL_RATIO, TEMPORAL_WINDOW
from auditor.model.checks import Check, PairCheck
from auditor.model.measurement import Cells

Grid = NDArray[np.integer]


@dataclass(frozen=True)
class Window:
    """A window of `rows` x `columns` cells, to whose pixels `prior` innocent ones are added: few prove little."""

    rows: int
    columns: int
    pseudo_count: int


WINDOWS: Mapping[Check, Window] = {
    Check.LIDAR_CONFLICT: Window(*LOCAL_RATIO.conflict_window, LOCAL_RATIO.conflict_pseudo_count),
    Check.PHOTOMETRIC_INCONSISTENCY: Window(*LOCAL_RATIO.photometric_window, LOCAL_RATIO.photometric_pseudo_count),
}
"""By witness, of cells of 8 x 8 px: 48 x 48 px of LiDAR points, 48 x 64 px of half-resolution pixels.

The others bring statistics of their own. 40 points are half of what 64 beams usually give; for fewer beams
see `fitted`.
"""


@dataclass(frozen=True)
class WindowedRatio:
    """The largest B / (N + prior), and the first cell (row, column) of the window it was found in."""

    ratio: float
    row: int
    column: int


def windowed_ratio(valid: Grid, inconsistent: Grid, window: Window) -> WindowedRatio | None:
    """The largest share B / (N + prior) of pixels that stand against somebody over all windows.

    `valid` N and `against` B are (rows, columns) counts a cell. None where no window has as many valid pixels as the
    prior.
    """
    N, B = _window_sums(valid, window), _window_sums(inconsistent, window)
    if N.max(initial=0) < window.pseudo_count:
        return None
    ratio = B / (N + window.pseudo_count)
    row, column = np.unravel_index(int(np.argmax(ratio)), ratio.shape)
    return WindowedRatio(float(ratio[row, column]), int(row), int(column))


def windowed_ratios(
    pair_checks: Sequence[PairCheck],
    cells: Mapping[PairCheck, Cells],
    shares: Mapping[PairCheck, float],
) -> tuple[float | None, ...]:
    """The statistic of each element in a frame, None where it was not measured.

    `cells` holds the counts of the elements that have them, `shares` those statistics that come ready.
    """
    return tuple(
        _ratio(pair_check, cells[pair_check]) if pair_check in cells else shares.get(pair_check)
        for pair_check in pair_checks
    )


def _ratio(pair_check: PairCheck, cells: Cells) -> float | None:
    window = WINDOWS[pair_check.check]
    if pair_check.check is Check.LIDAR_CONFLICT:
        window = fitted(window, cells.valid)
    found = windowed_ratio(cells.valid, cells.inconsistent, window)
    return found.ratio if found else None


def fitted(window: Window, valid: Grid) -> Window:
    """The window for LiDARs of fewer beams: its prior is half of a dense window's count, 15 points at least.

    `valid` are the frame's own (rows, columns) counts; dense is the 90th percentile of the windows that hold any, which
    neither the sky nor an attacked part of the view moves much. The prior is never larger than `window`'s.
    """
    sums = _window_sums(valid, window)
    held = sums[sums > 0]
    dense = float(np.quantile(held, LOCAL_RATIO.dense_quantile)) if held.size else 0.0
    pseudo_count = max(round(LOCAL_RATIO.share_of_dense * dense), LOCAL_RATIO.smallest_pseudo_count)
    return replace(window, pseudo_count=min(pseudo_count, window.pseudo_count))


def _window_sums(grid: Grid, window: Window) -> NDArray[np.int64]:
    """The sum of every whole window, from a summed-area table; none where the grid is smaller than a window."""
    table = np.zeros((grid.shape[0] + 1, grid.shape[1] + 1), dtype=np.int64)
    table[1:, 1:] = grid.cumsum(axis=0, dtype=np.int64).cumsum(axis=1)
    r, c = window.rows, window.columns
    return np.asarray(table[r:, c:] - table[:-r, c:] - table[r:, :-c] + table[:-r, :-c])


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


def window_bounds(
    stamp_ns: NDArray[np.int64], seconds: float, runs: NDArray[np.int64]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """(F,) the first frame within `seconds` / 2 of each frame of its run, and the frame after the last."""
    half = int(seconds * NANOSECONDS / 2)
    step = np.diff(stamp_ns, prepend=stamp_ns[:1])
    time_ns = np.cumsum(np.where(np.diff(runs, prepend=runs[:1]) > 0, 2 * half + 1, step))
    first = np.maximum(np.searchsorted(time_ns, time_ns - half, side="left"), np.searchsorted(runs, runs, side="left"))
    end = np.minimum(np.searchsorted(time_ns, time_ns + half, side="right"), np.searchsorted(runs, runs, side="right"))
    return first, end


def window_means(
    z: Floats, stamp_ns: NDArray[np.int64], seconds: float, runs: NDArray[np.int64] | None = None
) -> Floats:
    """(F, M) means of the measured margins within `seconds` / 2 of each frame, never across two runs.

    `z` is (F, M), NaN where not measured, of successive frames with their stamps (F,); `runs` (F,) numbers their runs
    in ascending order where they are known, else they are `runs_of` the stamps. Where nothing in the window was
    measured the mean is NaN.
    """
    first, end = window_bounds(stamp_ns, seconds, runs_of(stamp_ns) if runs is None else runs)
    measured = ~np.isnan(z)
    total = np.vstack([np.zeros((1, z.shape[1])), np.cumsum(np.where(measured, z, 0), axis=0)])
    count = np.vstack([np.zeros((1, z.shape[1])), np.cumsum(measured, axis=0)])
    number = count[end] - count[first]
    return np.where(number > 0, (total[end] - total[first]) / np.maximum(number, 1), np.nan)
