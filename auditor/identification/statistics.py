"""The windowed ratio of inconsistent pixels on the count grid, and means of scores over the temporal window."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from auditor.identification.parameters import TEMPORAL_WINDOW, WINDOWED_RATIO
from auditor.model.arrays import Floats, Indices, Integers
from auditor.model.checks import Check, PairCheck
from auditor.model.measurement import Cells

Grid = NDArray[np.integer]
"""Counts of pixels or points a cell: (rows, columns)."""

NANOSECONDS = 1_000_000_000


@dataclass(frozen=True)
class Window:
    """A window of `rows` x `columns` cells, to whose pixels `pseudo_count` consistent ones are added.

    So a window with few pixels has a small ratio.
    """

    rows: int
    columns: int
    pseudo_count: int


@dataclass(frozen=True)
class StrongestWindow:
    """The largest B / (N + pseudo-count), and the first cell (row, column) of the window that has it."""

    ratio: float
    row: int
    column: int


WINDOWS: Mapping[Check, Window] = {
    Check.LIDAR_CONFLICT: Window(*WINDOWED_RATIO.conflict_window, WINDOWED_RATIO.conflict_pseudo_count),
    Check.PHOTOMETRIC_INCONSISTENCY: Window(
        *WINDOWED_RATIO.photometric_window, WINDOWED_RATIO.photometric_pseudo_count
    ),
}
"""By check, of cells of 8 x 8 px: 48 x 48 px of LiDAR points, 48 x 64 px of half-resolution pixels.

The other checks have statistics of their own. 40 points are half of what 64 beams usually give; for fewer beams see
`fitted`.
"""


def windowed_ratios(
    pair_checks: Sequence[PairCheck],
    cells: Mapping[PairCheck, Cells],
    shares: Mapping[PairCheck, float],
) -> tuple[float | None, ...]:
    """The statistic of each pair check in a frame, None where it was not measured.

    `cells` holds the counts of those that are counted on the grid, `shares` the statistics of the others.
    """
    return tuple(
        _ratio(pair_check, cells[pair_check]) if pair_check in cells else shares.get(pair_check)
        for pair_check in pair_checks
    )


def windowed_ratio(valid: Grid, inconsistent: Grid, window: Window) -> StrongestWindow | None:
    """The largest share B / (N + pseudo-count) of inconsistent pixels over all windows.

    `valid` N and `inconsistent` B are (rows, columns) counts a cell. None where no window has as many valid pixels as
    the pseudo-count.
    """
    N, B = _window_sums(valid, window), _window_sums(inconsistent, window)
    if N.max(initial=0) < window.pseudo_count:
        return None
    ratio = B / (N + window.pseudo_count)
    row, column = np.unravel_index(int(np.argmax(ratio)), ratio.shape)
    return StrongestWindow(float(ratio[row, column]), int(row), int(column))


def fitted(window: Window, valid: Grid) -> Window:
    """The window for LiDARs of fewer beams: its pseudo-count is half of a dense window's count, 15 points at least.

    `valid` are the frame's own (rows, columns) counts; dense is the 90th percentile of the windows that hold any:
    neither the sky nor an attacked part of the view moves it much. It is never larger than that of `window`.
    """
    sums = _window_sums(valid, window)
    held = sums[sums > 0]
    dense = float(np.quantile(held, WINDOWED_RATIO.dense_quantile)) if held.size else 0.0
    pseudo_count = max(round(WINDOWED_RATIO.share_of_dense * dense), WINDOWED_RATIO.smallest_pseudo_count)
    return replace(window, pseudo_count=min(pseudo_count, window.pseudo_count))


def _ratio(pair_check: PairCheck, cells: Cells) -> float | None:
    window = WINDOWS[pair_check.check]
    if pair_check.check is Check.LIDAR_CONFLICT:
        window = fitted(window, cells.valid)
    found = windowed_ratio(cells.valid, cells.inconsistent, window)
    return found.ratio if found else None


def _window_sums(grid: Grid, window: Window) -> Integers:
    """The sum of every whole window, from a summed-area table; none where the grid is smaller than a window."""
    table = np.zeros((grid.shape[0] + 1, grid.shape[1] + 1), dtype=np.int64)
    table[1:, 1:] = grid.cumsum(axis=0, dtype=np.int64).cumsum(axis=1)
    r, c = window.rows, window.columns
    return np.asarray(table[r:, c:] - table[:-r, c:] - table[r:, :-c] + table[:-r, :-c])


def runs_of(stamp_ns: Integers) -> Integers:
    """(F,) the number of the run that each successive frame belongs to: runs end at gaps.

    A gap is a step of more than 2.5 times the median step, or one back: there the clock was set.
    """
    step = np.diff(stamp_ns, prepend=stamp_ns[:1])
    usual = np.median(step[1:]) if step.size > 1 else 0
    return np.asarray(np.cumsum((step < 0) | (step > TEMPORAL_WINDOW.gap_periods * usual)))


def window_bounds(stamp_ns: Integers, seconds: float, runs: Integers) -> tuple[Indices, Indices]:
    """(F,) the first frame within `seconds` / 2 of each frame of its run, and the frame after the last."""
    half = int(seconds * NANOSECONDS / 2)
    step = np.diff(stamp_ns, prepend=stamp_ns[:1])
    time_ns = np.cumsum(np.where(np.diff(runs, prepend=runs[:1]) > 0, 2 * half + 1, step))
    first = np.maximum(np.searchsorted(time_ns, time_ns - half, side="left"), np.searchsorted(runs, runs, side="left"))
    end = np.minimum(np.searchsorted(time_ns, time_ns + half, side="right"), np.searchsorted(runs, runs, side="right"))
    return first, end


def window_means(z: Floats, stamp_ns: Integers, seconds: float, runs: Integers | None = None) -> Floats:
    """(F, M) means of the measured scores within `seconds` / 2 of each frame, never across two runs.

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
