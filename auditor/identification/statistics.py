"""The statistics of the sensor checks, from counts on grids; and means of scores over the temporal window."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from auditor.identification.parameters import TEMPORAL_WINDOW, WINDOWED_MEAN
from auditor.model.arrays import Floats, Floats32, Indices, Integers
from auditor.model.checks import FEWEST_VOTERS, LIDAR_CHECKS, Check, CountedPair, SensorCheck
from auditor.model.measurement import LIGHT_STEPS, Cells

Grid = NDArray[np.integer]
"""Counts of pixels or points a cell: (rows, columns)."""

NANOSECONDS = 1_000_000_000


@dataclass(frozen=True)
class Window:
    """A window of `rows` x `columns` cells, to whose pixels `pseudo_count` consistent ones are added.

    So a window with few pixels has a small mean; with fewer than `fewest` it has none.
    """

    rows: int
    columns: int
    pseudo_count: int
    fewest: int


@dataclass(frozen=True, eq=False)
class WindowMeans:
    """(rows, columns) the mean of each window of a grid, NaN where it has too few pixels."""

    means: Floats32

    @property
    def shape(self) -> tuple[int, ...]:
        """Rows and columns."""
        return self.means.shape


CONFLICT_WINDOW = Window(
    *WINDOWED_MEAN.conflict_window, WINDOWED_MEAN.conflict_pseudo_count, WINDOWED_MEAN.conflict_fewest
)
"""Of cells of the LiDAR's directions. 40 points are half of what 64 beams usually give; for fewer see `fitted`."""

IMAGE_WINDOW = Window(*WINDOWED_MEAN.image_window, WINDOWED_MEAN.image_pseudo_count, WINDOWED_MEAN.image_fewest)
"""Of cells of 8 x 8 px: 48 x 64 px of half-resolution pixels."""


def sensor_statistics(
    sensor_checks: Sequence[SensorCheck],
    cells: Mapping[CountedPair, Cells],
    shares: Mapping[SensorCheck, float],
) -> tuple[float | None, ...]:
    """The statistic of each sensor check in a frame, 0 to 1, None where it was not measured.

    `cells` holds the counts of the checks that are counted on grids, `shares` the statistics of the others.
    """
    windows = {counted: window_means_of(counted, grid) for counted, grid in cells.items()}
    conflicts = {(c.i, c.k): means for c, means in windows.items() if c.check is Check.LIDAR_CONFLICT}
    others = {
        check: {(c.sensor, c.other): means for c, means in windows.items() if c.check is check}
        for check in (Check.ADDED_LIGHT, Check.PHOTOMETRIC_INCONSISTENCY)
    }
    darker = {place: WindowMeans(-means.means) for place, means in others[Check.ADDED_LIGHT].items()}
    by_check = others | {Check.REMOVED_LIGHT: darker}

    def statistic(one: SensorCheck) -> float | None:
        if one.check in LIDAR_CHECKS:
            return shares.get(one)
        if one.check is Check.LIDAR_CONFLICT:
            pairs = [means for pair, means in conflicts.items() if set(pair) <= set(one.others)]
            return _conflict(pairs) if pairs else None
        voters = [by_check[one.check].get((one.sensor, other)) for other in one.others]
        known = [means for means in voters if means is not None]
        return vote(one.check, known) if len(known) == len(voters) else None

    return tuple(statistic(one) for one in sensor_checks)


def window_means_of(counted: CountedPair, cells: Cells) -> WindowMeans:
    """The mean residual, or the share of inconsistent pixels or points, of each window of a grid."""
    lidar = counted.check is Check.LIDAR_CONFLICT
    window = fitted(CONFLICT_WINDOW, cells.valid) if lidar else IMAGE_WINDOW
    N, B = window_sums(cells.valid, window), window_sums(cells.total, window)
    steps = LIGHT_STEPS if counted.check is Check.ADDED_LIGHT else 1
    means = B / ((N + window.pseudo_count) * np.float32(steps))
    means[window.fewest > N] = np.nan
    return WindowMeans(means.astype(np.float32))


def vote(check: Check, voters: Sequence[WindowMeans]) -> float | None:
    """The largest over all windows of what a camera's voters say of it there; None where no window has enough voters.

    Two at least must have compared the window, where there are two. Light only adds, and a voter that is attacked
    itself says the opposite or nothing: so added light is the mean of two voters, and of more the geometric mean of
    their mean and of the smallest. For removed light and inconsistencies, which an attacked voter shows as well, it is
    the smallest.
    """
    values = np.stack([one.means for one in voters])
    known = ~np.isnan(values)
    count = known.sum(axis=0)
    enough = count >= min(FEWEST_VOTERS, len(voters))
    if not enough.any():
        return None
    values = values[:, enough]
    smallest = np.fmin.reduce(values)
    if check is Check.ADDED_LIGHT:
        mean = np.nansum(values, axis=0) / count[enough]
        found = mean if len(voters) <= FEWEST_VOTERS else np.sqrt(np.maximum(mean, 0) * np.maximum(smallest, 0))
    else:
        found = smallest
    return max(float(found.max()), 0.0)


def _conflict(pairs: Sequence[WindowMeans]) -> float | None:
    """The largest mean of the pairs that compared enough points in a direction, two of them where there are two."""
    values = np.stack([one.means for one in pairs])
    count = (~np.isnan(values)).sum(axis=0)
    enough = count >= min(FEWEST_VOTERS, len(pairs))
    if not enough.any():
        return None
    return float((np.nansum(values[:, enough], axis=0) / count[enough]).max())


def strongest_window(means: WindowMeans) -> tuple[float, int, int] | None:
    """The largest mean, and the first cell (row, column) of its window; None where no window has enough pixels."""
    if np.isnan(means.means).all():
        return None
    row, column = np.unravel_index(int(np.nanargmax(means.means)), means.shape)
    return float(means.means[row, column]), int(row), int(column)


def fitted(window: Window, valid: Grid) -> Window:
    """The window for LiDARs of fewer beams: its pseudo-count is half of a dense window's count, 15 points at least.

    `valid` are the frame's own (rows, columns) counts; dense is the 90th percentile of the windows that hold any:
    neither the sky nor an attacked part of the view moves it much. It is never larger than that of `window`, and the
    fewest points shrink with it.
    """
    sums = window_sums(valid, window)
    held = sums[sums > 0]
    dense = float(np.quantile(held, WINDOWED_MEAN.dense_quantile)) if held.size else 0.0
    pseudo_count = max(round(WINDOWED_MEAN.share_of_dense * dense), WINDOWED_MEAN.smallest_pseudo_count)
    pseudo_count = min(pseudo_count, window.pseudo_count)
    return replace(window, pseudo_count=pseudo_count, fewest=window.fewest * pseudo_count // window.pseudo_count)


def window_sums(grid: Grid, window: Window) -> Integers:
    """The sum of every whole window, from a summed-area table; none where the grid is smaller than a window."""
    table = np.zeros((grid.shape[0] + 1, grid.shape[1] + 1), dtype=np.int32)
    table[1:, 1:] = grid.cumsum(axis=0, dtype=np.int32).cumsum(axis=1)
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
