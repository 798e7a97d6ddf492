"""Counts of valid and inconsistent pixels on a coarse grid: enough to judge portions of an image again."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.evidence.adjudication import LidarElement
from auditor.evidence.comparing import inconsistent
from auditor.evidence.stereo import StereoMap

CELL_PX = 8
"""Width and height of a cell in full-resolution pixels."""

Grid = NDArray[np.uint8]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Cells:
    """One triple's counts in cells of 8 x 8 full-resolution pixels, (rows, columns) uint8 each."""

    valid: Grid
    inconsistent: Grid


def cells_of_lidar(element: LidarElement, height_px: int, width_px: int) -> Cells:
    """Count a LiDAR element's points; 64 a cell at most."""
    rows, columns = -(-height_px // CELL_PX), -(-width_px // CELL_PX)
    cell = element.row // CELL_PX * columns + element.column // CELL_PX
    grids = (
        np.bincount(cell[mask], minlength=rows * columns).astype(np.uint8).reshape(rows, columns)
        for mask in (element.valid, element.inconsistent)
    )
    return Cells(*grids)


def cells_of_cameras(
    first: StereoMap, second: StereoMap, first_baseline_m: float, second_baseline_m: float
) -> Cells:
    """Compare two cameras' maps (Eq. 2, at the smaller baseline) where there is texture, and count grid pixels."""
    common_m = min(first_baseline_m, second_baseline_m)
    valid = first.valid & second.valid & (first.textured | second.textured)
    over = valid & inconsistent(
        first.disparity_px * np.float32(common_m / first_baseline_m),
        second.disparity_px * np.float32(common_m / second_baseline_m),
    )
    return Cells(_count(valid, CELL_PX // first.step), _count(over, CELL_PX // first.step))


def _count(mask: Mask, side: int) -> Grid:
    """How many of each side x side pixels are set; what is missing at the right and lower edge is not."""
    height, width = mask.shape
    rows, columns = -(-height // side), -(-width // side)
    padded = cv2.copyMakeBorder(
        mask.view(np.uint8), 0, rows * side - height, 0, columns * side - width, cv2.BORDER_CONSTANT, value=0
    )
    sums = cv2.boxFilter(padded, cv2.CV_16U, (side, side), anchor=(0, 0), normalize=False)
    return np.asarray(sums[::side, ::side], dtype=np.uint8)
