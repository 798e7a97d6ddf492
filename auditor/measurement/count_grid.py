"""Counts on coarse grids, from which every portion of an image can be judged again without the image.

What two cameras compare is counted in both their images: each reference pixel is also counted where its match lies in
the source. So all pairs of one camera have counts at the same places of its own image, whatever their disparities.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, reduce
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.measurement.checks.photometric_consistency import Matches
from auditor.measurement.parameters import COUNT_GRID
from auditor.model.arrays import Floats32, Indices, Mask
from auditor.model.measurement import Cells

CELL_PX = COUNT_GRID.cell_px
"""Width and height of a cell in full-resolution pixels."""

Rows = NDArray[np.signedinteger]
"""Rows or columns of cells or pixels: (M,)."""

_HALF_SIDE = CELL_PX // 2
_MOST = 127
_ROWS, _COLUMNS = COUNT_GRID.lidar_cells


@dataclass(frozen=True, eq=False)
class ImageGrid:
    """The grid of a camera's image, (rows, columns) cells.

    `place` (h * w,) is the cell of each half-resolution pixel of a pair's view, row by row; the number after the last
    cell stands for what lies outside. `of_view`: the pair's view is the camera's, so that cells are 4 x 4 pixels of it.
    """

    rows: int
    columns: int
    place: Indices
    of_view: bool = True

    @classmethod
    def of(cls, height: int, width: int) -> "ImageGrid":
        """The grid of a half-resolution image of that size; the same one each time."""
        return _grid_of(height, width)

    @classmethod
    def elsewhere(cls, height: int, width: int, row: Indices, column: Indices) -> "ImageGrid":
        """The grid of a half-resolution image, for a view whose pixels (h, w) lie in that row and column of it."""
        grid = cls.of(height, width)
        inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
        place = np.where(inside, row // _HALF_SIDE * grid.columns + column // _HALF_SIDE, grid.rows * grid.columns)
        return cls(grid.rows, grid.columns, place.ravel(), of_view=False)


@dataclass(frozen=True, eq=False)
class PairPlaces:
    """The cells in which a pair's half-resolution pixels are counted, row by row (M,).

    `source` are those of their matches in the source's image; those in the reference's are the places of the `grid`.
    """

    source: NDArray[np.signedinteger]
    grid: ImageGrid


@dataclass(frozen=True, eq=False)
class PairCells:
    """What a pair of cameras counts, in the image of its source and in that of its reference."""

    source: Cells
    reference: Cells


class _Sums(NamedTuple):
    """By cell of an image (cells,): how many pixels are valid, and the sum of what is added up, not rounded."""

    valid: NDArray[np.number]
    total: NDArray[np.number]

    def without(self, some: "_Sums") -> "_Sums":
        return _Sums(self.valid - some.valid, self.total - some.total)

    def cells(self, grid: ImageGrid) -> Cells:
        shape = grid.rows, grid.columns
        valid = _bytes(self.valid, *shape).astype(np.uint8)
        return Cells(valid, _rounded(self.total.reshape(shape).astype(np.float32)))


@dataclass(frozen=True, eq=False)
class PairSums:
    """What `PairCells` hold before it is rounded, so that what some of the pixels add can be taken off again.

    All amounts are single-precision numbers of similar size: their sums in double precision are exact.
    """

    source: _Sums
    reference: _Sums
    grid: ImageGrid

    def without(self, some: "PairSums") -> "PairSums":
        """The sums of all other pixels."""
        return replace(self, source=self.source.without(some.source), reference=self.reference.without(some.reference))

    @property
    def cells(self) -> PairCells:
        """The sums as they are kept."""
        return PairCells(self.source.cells(self.grid), self.reference.cells(self.grid))


def cells_of_directions(row: Indices, column: Indices, inconsistent: Mask) -> Cells:
    """Count what lies in rows and columns (M,) of the LiDAR's directions, and which (M,) of it is inconsistent."""
    cell = row * _COLUMNS + column
    valid, total = (
        _bytes(np.bincount(these, minlength=_ROWS * _COLUMNS), _ROWS, _COLUMNS) for these in (cell, cell[inconsistent])
    )
    return Cells(valid.astype(np.uint8), total)


def largest_share(
    place: tuple[Rows, Rows], those: Mask, shape: tuple[int, int], window: tuple[int, int], pseudo_count: int
) -> float:
    """The largest share, 0 to 1, of a window that some of the samples (M,) in it are.

    `place` are the rows and columns of the samples' cells on a grid of a shape; `window` is in rows and columns of
    cells. `pseudo_count` samples that are none of those are added to each window.
    """
    number = place[0] * shape[1] + place[1]

    def in_windows(some: Mask) -> Floats32:
        counts = np.bincount(number[some], minlength=shape[0] * shape[1]).astype(np.float32).reshape(shape)
        summed = cv2.boxFilter(counts, -1, window[::-1], normalize=False, borderType=cv2.BORDER_CONSTANT)
        return np.asarray(summed, dtype=np.float32)

    return float((in_windows(those) / (in_windows(np.ones_like(those)) + np.float32(pseudo_count))).max())


def places_of(matches: Matches, grid: ImageGrid) -> PairPlaces:
    """Where a pair's pixels are counted; both cameras' images have the same grid."""
    height, width = matches.column.shape
    column = np.clip(np.rint(matches.column), 0, width - 1).astype(np.int32)
    if grid.of_view:
        row = np.arange(height, dtype=np.int32)[:, None] // _HALF_SIDE * grid.columns
        return PairPlaces((row + column // _HALF_SIDE).ravel(), grid)
    row = np.arange(height, dtype=np.intp)[:, None] * width
    return PairPlaces(grid.place[(row + column).ravel()], grid)


def sums_of_pair(places: PairPlaces, valid: Mask, amounts: Sequence[Mask | Floats32], steps: int = 1) -> list[PairSums]:
    """Count half-resolution pixels that are `valid` (h, w), and sum each of their `amounts` (h, w), in `steps` a unit.

    Amounts are zero where pixels are not valid.
    """
    grid, within = places.grid, np.flatnonzero(valid)
    counted = (
        _summed(places.source.take(within), grid),
        _block_counts(valid) if grid.of_view else _summed(grid.place.take(within), grid),
    )
    some = [np.flatnonzero(amount if amount.dtype == np.bool_ else amount != 0) for amount in amounts]
    return [_sums(places, its, amount, steps, counted) for its, amount in zip(some, amounts, strict=True)]


def sums_of_some(
    places: PairPlaces, some: Indices, valid: Mask, amounts: Sequence[Mask | Floats32], steps: int = 1
) -> list[PairSums]:
    """What some (M,) of the half-resolution pixels, numbered row by row, add to `sums_of_pair`."""
    within = some[valid.take(some)]
    source, reference = (_summed(place.take(within), places.grid) for place in (places.source, places.grid.place))
    return [_sums(places, some, amount, steps, (source, reference)) for amount in amounts]


def _sums(
    places: PairPlaces,
    some: Indices,
    amount: Mask | Floats32,
    steps: int,
    counted: tuple[NDArray[np.number], NDArray[np.number]],
) -> PairSums:
    """What is counted in the source's image and in the reference's, and the sums of some pixels' amounts (h, w)."""
    weight = np.asarray(amount.take(some) * np.float32(steps), dtype=np.float32)
    source, reference = (_summed(place.take(some), places.grid, weight) for place in (places.source, places.grid.place))
    return PairSums(_Sums(counted[0], source), _Sums(counted[1], reference), places.grid)


def opposite(cells: PairCells) -> PairCells:
    """The same counts with the source's sums turned round: what is brighter in one camera is darker in the other."""
    return PairCells(Cells(cells.source.valid, -cells.source.total), cells.reference)


def _summed(place: NDArray[np.signedinteger], grid: ImageGrid, weight: Floats32 | None = None) -> NDArray[np.number]:
    """(cells,) how many of the places (M,) are each cell's, or the sums of their weights; without what lies outside."""
    cells = grid.rows * grid.columns
    return np.bincount(place, weights=weight, minlength=cells)[:cells]


def _bytes(counts: NDArray[np.number], rows: int, columns: int) -> NDArray[np.int8]:
    return np.asarray(np.minimum(counts, _MOST).astype(np.int8).reshape(rows, columns))


def _rounded(sums: NDArray[np.floating]) -> NDArray[np.int8]:
    return np.asarray(np.clip(np.rint(sums), -_MOST, _MOST).astype(np.int8))


def _block_counts(mask: Mask) -> NDArray[np.number]:
    """(cells,) how many of each 4 x 4 pixels are marked; beyond the right and lower edge none is."""
    height, width = mask.shape
    below, beside = -height % _HALF_SIDE, -width % _HALF_SIDE
    padded = cv2.copyMakeBorder(mask.view(np.uint8), 0, below, 0, beside, cv2.BORDER_CONSTANT, value=(0,))
    in_rows = reduce(np.add, (padded[row::_HALF_SIDE] for row in range(_HALF_SIDE)))
    return np.asarray(reduce(np.add, (in_rows[:, column::_HALF_SIDE] for column in range(_HALF_SIDE)))).ravel()


@lru_cache(maxsize=8)
def _grid_of(height: int, width: int) -> ImageGrid:
    rows, columns = -(-height // _HALF_SIDE), -(-width // _HALF_SIDE)
    row, column = np.indices((height, width), dtype=np.intp) // _HALF_SIDE
    return ImageGrid(rows, columns, (row * columns + column).ravel())
