"""Counts on a coarse grid, from which every portion of an image can be judged again without the image."""

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.measurement.checks.lidar_conflict import VerifiedConflicts
from auditor.measurement.checks.photometric_consistency import PairConsistency
from auditor.measurement.parameters import COUNT_GRID
from auditor.model.measurement import Cells

CELL_PX = COUNT_GRID.cell_px
"""Width and height of a cell in full-resolution pixels."""

_HALF_SIDE = CELL_PX // 2


def cells_of_points(conflicts: VerifiedConflicts, height_px: int, width_px: int) -> Cells:
    """Count LiDAR points, valid and in conflict, in an image of that size."""
    rows, columns = -(-height_px // CELL_PX), -(-width_px // CELL_PX)
    cell = conflicts.row // CELL_PX * columns + conflicts.column // CELL_PX
    valid, inconsistent = (
        np.bincount(cell[mask], minlength=rows * columns).astype(np.uint8).reshape(rows, columns)
        for mask in (conflicts.valid, conflicts.lidar_conflicts)
    )
    return Cells(valid, inconsistent)


def cells_of_consistency(pair: PairConsistency, near: NDArray[np.bool_] | None = None) -> Cells:
    """Count half-resolution pixels, comparable and inconsistent: at most 16 a cell.

    Those of the range mask `near` (h, w) are left out: there something is nearer than the matcher's range, or occludes
    what the reference sees (`lidar.out_of_range`).
    """
    if near is None:
        return Cells(_count(pair.comparable), _count(pair.inconsistent))
    return Cells(_count(pair.comparable & ~near), _count(pair.inconsistent & ~near))


def _count(mask: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """How many of each 4 x 4 pixels are set; beyond the right and lower edge none is."""
    height, width = mask.shape
    below, beside = -height % _HALF_SIDE, -width % _HALF_SIDE
    padded = cv2.copyMakeBorder(mask.view(np.uint8), 0, below, 0, beside, cv2.BORDER_CONSTANT, value=(0,))
    sums = cv2.boxFilter(padded, cv2.CV_8U, (_HALF_SIDE, _HALF_SIDE), anchor=(0, 0), normalize=False)
    return np.ascontiguousarray(sums[::_HALF_SIDE, ::_HALF_SIDE], dtype=np.uint8)
