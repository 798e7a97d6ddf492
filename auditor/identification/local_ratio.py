"""The local ratio: the largest share of inconsistent pixels in any window of the cell grid."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from auditor.elements import Element, Witness
from auditor.results import Cells

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

_DENSE_QUANTILE = 0.9
_SHARE_OF_DENSE = 0.4


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
    cells: Mapping[Element, Cells],
    shares: Mapping[Element, float],
) -> tuple[float | None, ...]:
    """The statistic of each element in a frame, None where it was not measured.

    `cells` holds the counts of the elements that have them, `shares` those statistics that come ready: light and
    emptiness.
    """
    return tuple(_ratio(element, cells[element]) if element in cells else shares.get(element) for element in elements)


def _ratio(element: Element, cells: Cells) -> float | None:
    window = WINDOWS[element.witness]
    if element.witness is Witness.CONTRADICTED:
        window = fitted(window, cells.valid)
    found = local_ratio(cells.valid, cells.against, window)
    return found.ratio if found else None


def fitted(window: Window, valid: Grid) -> Window:
    """The window for LiDARs of fewer beams: four tenths of a dense window's count are enough, 30 points at least.

    `valid` are the frame's own (rows, columns) counts; dense is the 90th percentile of the windows that hold any, which
    neither the sky nor an attacked part of the view moves much. It is never made harder than `window`.
    """
    sums = _window_sums(valid, window)
    held = sums[sums > 0]
    dense = float(np.quantile(held, _DENSE_QUANTILE)) if held.size else 0.0
    fewest = max(round(_SHARE_OF_DENSE * dense), FEWEST_POINTS)
    return replace(window, fewest_valid=min(fewest, window.fewest_valid))


def _window_sums(grid: Grid, window: Window) -> NDArray[np.int64]:
    """The sum of every whole window, from a summed-area table; none where the grid is smaller than a window."""
    table = np.zeros((grid.shape[0] + 1, grid.shape[1] + 1), dtype=np.int64)
    table[1:, 1:] = grid.cumsum(axis=0, dtype=np.int64).cumsum(axis=1)
    r, c = min(window.rows, grid.shape[0] + 1), min(window.columns, grid.shape[1] + 1)
    return np.asarray(table[r:, c:] - table[:-r, c:] - table[r:, :-c] + table[:-r, :-c])
