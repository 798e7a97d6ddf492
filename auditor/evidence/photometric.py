"""A witness that needs no geometry: light in one camera that the other does not see."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.evidence.gain import fit_gain

_ROWS, _COLUMNS = 24, 78
_WHITE = np.float32(255)
_MARK = 75.0  # grey levels
_WINDOW = 6  # cells, about 96 px
_SHIFTS = 6  # 0 to 5 cells: up to 80 px of an image 1242 px wide
_USUAL_SHIFT = 2  # cells: where most of a street's partners lie

Grid = NDArray[np.float32]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Light:
    """How much of cameras i < k is brighter than everything that the other one sees nearby.

    Each is the largest share, 0 to 1, of such cells in any window of 6 x 6. Light thrown into a camera makes its own
    share large, darkness the other's: a pair cannot tell the two apart.
    """

    brighter_i: float
    brighter_k: float


def coarse(half: NDArray[np.uint8]) -> Grid:
    """(24, 78) means of a grey image."""
    return np.asarray(cv2.resize(half, (_COLUMNS, _ROWS), interpolation=cv2.INTER_AREA), dtype=np.float32)


def coarse_mask(half: Mask) -> Mask:
    """(24, 78) cells of which any pixel is set in a half-resolution mask."""
    return np.asarray(cv2.resize(half.astype(np.float32), (_COLUMNS, _ROWS), interpolation=cv2.INTER_AREA) > 0)


def compare_light(coarse_i: Grid, coarse_k: Grid, near: Mask | None = None) -> Light:
    """Compare the (24, 78) grids of a right camera i and a left camera k.

    A cell stands out where it is more than 75 grey levels brighter than every cell of the other camera within one row
    and 0 to 5 columns: what lies in column u of k lies farther left in i. Gain and offset between the cameras are
    fitted to the cells that agree best; cells whose partners lie outside the other image are not looked at, nor `near`
    ones (24, 78), where something is so near that its partner lies farther away.
    """
    gain, offset = fit_gain(coarse_k[:, _USUAL_SHIFT:], coarse_i[:, :-_USUAL_SHIFT])
    fitted_i = np.minimum(gain * coarse_i + offset, _WHITE)
    brighter_i = fitted_i - _brightest(coarse_k, ahead=True) > _MARK
    brighter_k = coarse_k - _brightest(fitted_i, ahead=False) > _MARK
    if near is not None:
        brighter_i &= ~near
        brighter_k &= ~near
    return Light(_largest_share(brighter_i[:, : _COLUMNS - _SHIFTS + 1]), _largest_share(brighter_k[:, _SHIFTS - 1 :]))


def _brightest(grid: Grid, *, ahead: bool) -> Grid:
    """For each cell the largest value within one row and 0 to 5 columns to the right (ahead) or left of it."""
    anchor = (0 if ahead else _SHIFTS - 1, 1)
    return np.asarray(cv2.dilate(grid, np.ones((3, _SHIFTS), dtype=np.uint8), anchor=anchor), dtype=np.float32)


def _largest_share(cells: NDArray[np.bool_]) -> float:
    shares = cv2.boxFilter(cells.astype(np.float32), cv2.CV_32F, (_WINDOW, _WINDOW), borderType=cv2.BORDER_CONSTANT)
    return float(np.max(shares))
