"""The local ratio: the largest share of inconsistent pixels in any window of the cell grid."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from auditor.elements import Element, Witness

Grid = NDArray[np.integer]


@dataclass(frozen=True)
class Window:
    """A window of `rows` x `columns` cells that counts where it holds at least `fewest_valid` valid pixels."""

    rows: int
    columns: int
    fewest_valid: int


WINDOWS: Mapping[Witness, Window] = {
    Witness.CONTRADICTED: Window(rows=10, columns=10, fewest_valid=120),
    Witness.UNLIKE: Window(rows=7, columns=13, fewest_valid=800),
}
"""By witness, of cells of 8 x 8 px: 80 x 80 px of LiDAR points, 56 x 104 px of half-resolution pixels.

The light and emptiness witnesses bring their own. 120 points are half of what 64 beams usually give; for fewer beams
see `fitted`.
"""

FEWEST_POINTS = 30
"""Of fewer points a share says little, however few beams there are."""


@dataclass(frozen=True)
class LocalRatio:
    """The largest B / N, and the first cell (row, column) of the window it was found in."""

    ratio: float
    row: int
    column: int


def local_ratio(valid: Grid, against: Grid, window: Window) -> LocalRatio | None:
    """The largest share B / N of valid pixels that stand against somebody over all windows with enough of them.

    `valid` and `against` are (rows, columns) counts a cell. None where no window has enough valid pixels.
    """
    N, B = _window_sums(valid, window), _window_sums(against, window)
    enough = window.fewest_valid <= N
    if not enough.any():
        return None
    ratio = np.where(enough, B / np.maximum(N, 1), -1.0)
    row, column = np.unravel_index(int(np.argmax(ratio)), ratio.shape)
    return LocalRatio(float(ratio[row, column]), int(row), int(column))


def local_ratios(
    elements: Sequence[Element],
    cells: Mapping[Element, tuple[Grid, Grid]],
    shares: Mapping[Element, float],
    windows: Mapping[Witness, Window] = WINDOWS,
) -> tuple[float | None, ...]:
    """The statistic of each element in a frame, None where it was not measured.

    `cells` holds (valid, against) counts by element, `shares` those statistics that come ready: light and emptiness.
    """
    ratios: list[float | None] = []
    for element in elements:
        found = local_ratio(*cells[element], windows[element.witness]) if element in cells else None
        ratios.append(found.ratio if found else shares.get(element))
    return tuple(ratios)


def fitted(window: Window, valid: Iterable[Grid]) -> Window:
    """The window for a LiDAR of fewer beams: half of the usual count is enough, 30 points at least.

    `valid` are the (rows, columns) counts of clean frames; usual is the median over the windows that hold any. It is
    never made harder than `window`.
    """
    counts = [sums[sums > 0] for sums in (_window_sums(grid, window) for grid in valid)]
    usual = float(np.median(np.concatenate(counts))) if any(count.size for count in counts) else 0.0
    return replace(window, fewest_valid=min(max(round(usual / 2), FEWEST_POINTS), window.fewest_valid))


def _window_sums(grid: Grid, window: Window) -> NDArray[np.int64]:
    """The sum of every whole window, from a summed-area table; none where the grid is smaller than a window."""
    table = np.zeros((grid.shape[0] + 1, grid.shape[1] + 1), dtype=np.int64)
    table[1:, 1:] = grid.cumsum(axis=0, dtype=np.int64).cumsum(axis=1)
    r, c = min(window.rows, grid.shape[0] + 1), min(window.columns, grid.shape[1] + 1)
    return np.asarray(table[r:, c:] - table[:-r, c:] - table[r:, :-c] + table[:-r, :-c])
