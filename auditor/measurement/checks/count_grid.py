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
from auditor.model.arrays import Floats32, Indices, Mask
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
    inside = (row >= 0) & (row < _ROWS) & (column >= 0) & (column < _COLUMNS)
    cell = np.where(inside, row * _COLUMNS + column, 0)
    valid, total = (
        _bytes(np.bincount(cell[mask & inside], minlength=_ROWS * _COLUMNS), _ROWS, _COLUMNS)
        for mask in (conflicts.valid, conflicts.lidar_conflicts)
    )
    return Cells(valid.astype(np.uint8), total)


def cells_of_pair(matches: Matches, valid: Mask, amount: Floats32, steps: int, grid: ImageGrid) -> PairCells:
    """Count half-resolution pixels that are `valid` (h, w), and the sum of their `amount` (h, w), in `steps` a unit.

    `amount` is zero where it is not valid; in the source its sign is the other one. Both cameras' images have the
    same grid.
    """
    row, column = np.nonzero(valid)
    there = np.clip(np.rint(matches.column[row, column]).astype(np.intp), 0, valid.shape[1] - 1)
    weight = amount[row, column] * np.float32(steps)
    source = _added_up(_place(grid, row, there), weight, grid)
    if grid.place is not None:
        return PairCells(source, _added_up(_place(grid, row, column), weight, grid))
    counts, sums = (_block_sums(one) for one in (valid.astype(np.float32), amount * np.float32(steps)))
    return PairCells(source, Cells(counts.astype(np.uint8), _rounded(sums)))


def opposite(cells: PairCells) -> PairCells:
    """The same counts with the source's sums turned round: what is brighter in one camera is darker in the other."""
    return PairCells(Cells(cells.source.valid, -cells.source.total), cells.reference)


def _place(grid: ImageGrid, row: Indices, column: Indices) -> Indices:
    if grid.place is None:
        return np.asarray(row // _HALF_SIDE * grid.columns + column // _HALF_SIDE)
    return np.asarray(grid.place[row, column])


def _added_up(place: Indices, weight: Floats32, grid: ImageGrid) -> Cells:
    if grid.place is not None:
        place, weight = place[place >= 0], weight[place >= 0]
    size = grid.rows * grid.columns
    counts, sums = np.bincount(place, minlength=size), np.bincount(place, weights=weight, minlength=size)
    shape = grid.rows, grid.columns
    return Cells(_bytes(counts, *shape).astype(np.uint8), _rounded(sums.reshape(shape).astype(np.float32)))


def _bytes(counts: NDArray[np.integer], rows: int, columns: int) -> NDArray[np.int8]:
    return np.asarray(np.minimum(counts, _MOST).astype(np.int8).reshape(rows, columns))


def _rounded(sums: NDArray[np.floating]) -> NDArray[np.int8]:
    return np.asarray(np.clip(np.rint(sums), -_MOST, _MOST).astype(np.int8))


def _block_sums(values: Floats32) -> Floats32:
    """The sums of each 4 x 4 values; beyond the right and lower edge all are zero."""
    height, width = values.shape
    below, beside = -height % _HALF_SIDE, -width % _HALF_SIDE
    padded = cv2.copyMakeBorder(values, 0, below, 0, beside, cv2.BORDER_CONSTANT, value=(0,))
    sums = cv2.boxFilter(padded, cv2.CV_32F, (_HALF_SIDE, _HALF_SIDE), anchor=(0, 0), normalize=False)
    return np.ascontiguousarray(sums[::_HALF_SIDE, ::_HALF_SIDE], dtype=np.float32)
