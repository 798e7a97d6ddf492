"""Counts on coarse grids, from which every portion of an image can be judged again without the image.

What two cameras compare is counted in both their images: each reference pixel is also counted where its match lies in
the source. So all pairs of one camera have counts at the same places of its own image, whatever their disparities.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.measurement.checks.lidar_conflict import VerifiedConflicts
from auditor.measurement.checks.photometric_consistency import Matches
from auditor.measurement.disparity.lidar import LidarView
from auditor.measurement.parameters import COUNT_GRID
from auditor.model.arrays import Floats32, Image, Indices, Mask
from auditor.model.measurement import Cells

CELL_PX = COUNT_GRID.cell_px
"""Width and height of a cell in full-resolution pixels."""

_HALF_SIDE = CELL_PX // 2
_MOST = 127
_RADIANS = COUNT_GRID.lidar_cell
_ROWS, _COLUMNS = COUNT_GRID.lidar_cells


@dataclass(frozen=True, eq=False)
class ImageGrid:
    """The grid of a camera's image, (rows, columns) cells.

    `place` (h, w) is the cell of each half-resolution pixel of a pair's own view, row by row, -1 outside; None where
    the pair's view is the camera's.
    """

    rows: int
    columns: int
    place: Indices | None = None

    @classmethod
    def of(cls, height: int, width: int) -> "ImageGrid":
        """The grid of a half-resolution image of that size."""
        return cls(-(-height // _HALF_SIDE), -(-width // _HALF_SIDE))

    @classmethod
    def elsewhere(cls, height: int, width: int, row: Indices, column: Indices) -> "ImageGrid":
        """The grid of a half-resolution image, for a view whose pixels (h, w) lie in that row and column of it."""
        grid = cls.of(height, width)
        inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
        place = np.where(inside, row // _HALF_SIDE * grid.columns + column // _HALF_SIDE, -1)
        return cls(grid.rows, grid.columns, place)


@dataclass(frozen=True, eq=False)
class PairPlaces:
    """The cells in which a pair's half-resolution pixels are counted, row by row (M,).

    `source` are those of their matches in the source's image, `reference` those in the reference's; None where the
    pair's view is the camera's. The number after the last cell stands for what lies outside.
    """

    source: Indices
    reference: Indices | None
    grid: ImageGrid


@dataclass(frozen=True, eq=False)
class PairCells:
    """What a pair of cameras counts, in the image of its source and in that of its reference."""

    source: Cells
    reference: Cells


def cells_of_points(conflicts: VerifiedConflicts, view: LidarView) -> Cells:
    """Count LiDAR points, valid and in conflict, by their direction from the LiDAR in the rig's axes.

    So all pairs have counts at the same places. Directions beyond the grid are left out.
    """
    assert view.rig.lidar is not None
    x, y, z = view.rig.lidar.rig_SE3_lidar[:3, :3].astype(np.float32) @ view.point_m.T
    row = np.floor(np.arctan2(y, np.hypot(x, z)) / _RADIANS).astype(np.intp) + _ROWS // 2
    column = np.floor(np.arctan2(x, z) / _RADIANS).astype(np.intp) + _COLUMNS // 2
    inside = (row >= 0) & (row < _ROWS) & (column >= 0) & (column < _COLUMNS) & conflicts.valid
    return cells_of_directions(row[inside], column[inside], conflicts.lidar_conflicts[inside])


def cells_of_directions(row: Indices, column: Indices, inconsistent: Mask) -> Cells:
    """Count what lies in rows and columns (M,) of the LiDAR's directions, and which (M,) of it is inconsistent."""
    cell = row * _COLUMNS + column
    valid, total = (
        _bytes(np.bincount(these, minlength=_ROWS * _COLUMNS), _ROWS, _COLUMNS) for these in (cell, cell[inconsistent])
    )
    return Cells(valid.astype(np.uint8), total)


def places_of(matches: Matches, grid: ImageGrid) -> PairPlaces:
    """Where a pair's pixels are counted; both cameras' images have the same grid."""
    height, width = matches.column.shape
    there = np.clip(np.rint(matches.column).astype(np.intp), 0, width - 1)
    row = np.arange(height, dtype=np.intp)[:, None]
    if grid.place is None:
        return PairPlaces((row // _HALF_SIDE * grid.columns + there // _HALF_SIDE).ravel(), None, grid)
    inside = np.where(grid.place < 0, grid.rows * grid.columns, grid.place).ravel()
    return PairPlaces(inside[(row * width + there).ravel()], inside, grid)


def cells_of_pair(places: PairPlaces, valid: Mask, amount: Mask | Floats32, steps: int = 1) -> PairCells:
    """Count half-resolution pixels that are `valid` (h, w), and the sum of their `amount` (h, w), in `steps` a unit.

    `amount` is zero where it is not valid.
    """
    some = np.flatnonzero(amount != 0)  # of what is true or false they are found sooner
    weight = None if amount.dtype == np.bool_ else amount.ravel()[some] * np.float32(steps)
    source = _counted(places.source, places.grid, valid, some, weight)
    if places.reference is not None:
        return PairCells(source, _counted(places.reference, places.grid, valid, some, weight))
    summed = amount.view(np.uint8) if weight is None else np.asarray(amount * np.float32(steps), np.float32)
    counts, sums = _block_sums(valid.view(np.uint8)), _block_sums(summed)
    return PairCells(source, Cells(counts.astype(np.uint8), _rounded(sums)))


def opposite(cells: PairCells) -> PairCells:
    """The same counts with the source's sums turned round: what is brighter in one camera is darker in the other."""
    return PairCells(Cells(cells.source.valid, -cells.source.total), cells.reference)


def _counted(place: Indices, grid: ImageGrid, valid: Mask, some: Indices, weight: Floats32 | None) -> Cells:
    """Counts of what is valid, and sums of the weights of `some` (M,) pixels, ones where there are none."""
    outside = grid.rows * grid.columns
    counts = np.bincount(place.compress(valid.ravel()), minlength=outside + 1)[:outside]
    sums = np.bincount(place[some], weights=weight, minlength=outside + 1)[:outside]
    shape = grid.rows, grid.columns
    return Cells(_bytes(counts, *shape).astype(np.uint8), _rounded(sums.reshape(shape).astype(np.float32)))


def _bytes(counts: NDArray[np.integer], rows: int, columns: int) -> NDArray[np.int8]:
    return np.asarray(np.minimum(counts, _MOST).astype(np.int8).reshape(rows, columns))


def _rounded(sums: NDArray[np.floating]) -> NDArray[np.int8]:
    return np.asarray(np.clip(np.rint(sums), -_MOST, _MOST).astype(np.int8))


def _block_sums(values: Image | Floats32) -> Floats32:
    """The sums of each 4 x 4 values; beyond the right and lower edge all are zero."""
    height, width = values.shape
    below, beside = -height % _HALF_SIDE, -width % _HALF_SIDE
    padded = cv2.copyMakeBorder(values, 0, below, 0, beside, cv2.BORDER_CONSTANT, value=(0,))
    sums = cv2.boxFilter(padded, cv2.CV_32F, (_HALF_SIDE, _HALF_SIDE), anchor=(0, 0), normalize=False)
    return np.ascontiguousarray(sums[::_HALF_SIDE, ::_HALF_SIDE], dtype=np.float32)
