"""The local ratio: the largest share of inconsistent pixels in any window of the cell grid."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Grid = NDArray[np.integer]


@dataclass(frozen=True)
class Window:
    """A window of `rows` x `columns` cells that counts where it holds at least `fewest_valid` valid pixels."""

    rows: int
    columns: int
    fewest_valid: int


@dataclass(frozen=True)
class LocalRatio:
    """The largest B / N, and the first cell (row, column) of the window it was found in."""

    ratio: float
    row: int
    column: int


def local_ratio(valid: Grid, inconsistent: Grid, window: Window) -> LocalRatio | None:
    """The largest share B / N of inconsistent among valid pixels over all windows with enough of them.

    `valid` and `inconsistent` are (rows, columns) counts a cell. None where no window has enough valid pixels.
    """
    N, B = _window_sums(valid, window), _window_sums(inconsistent, window)
    enough = window.fewest_valid <= N
    if not enough.any():
        return None
    ratio = np.where(enough, B / np.maximum(N, 1), -1.0)
    row, column = np.unravel_index(int(np.argmax(ratio)), ratio.shape)
    return LocalRatio(float(ratio[row, column]), int(row), int(column))


def _window_sums(grid: Grid, window: Window) -> NDArray[np.int64]:
    """The sum of every whole window, from a summed-area table; none where the grid is smaller than a window."""
    table = np.zeros((grid.shape[0] + 1, grid.shape[1] + 1), dtype=np.int64)
    table[1:, 1:] = grid.cumsum(axis=0, dtype=np.int64).cumsum(axis=1)
    r, c = min(window.rows, grid.shape[0] + 1), min(window.columns, grid.shape[1] + 1)
    return np.asarray(table[r:, c:] - table[:-r, c:] - table[r:, :-c] + table[:-r, :-c])
