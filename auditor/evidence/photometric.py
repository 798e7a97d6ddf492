"""A witness that needs no geometry: light in one camera that the other does not see."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

_ROWS, _COLUMNS = 24, 78
_MARK = 75.0  # grey levels
_WINDOW = 6  # cells, about 96 px
_SHIFTS = 6  # 0 to 5 cells: up to 80 px of an image 1242 px wide
_USUAL_SHIFT = 2  # cells: where most of a street's partners lie
_ROUNDS = 6
_KEPT_SHARE = 0.6
_SATURATED = 250.0
_FEWEST_CELLS = 100
_GAINS = (0.5, 2.0)

Grid = NDArray[np.float32]


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


def compare_light(coarse_i: Grid, coarse_k: Grid) -> Light:
    """Compare the (24, 78) grids of a right camera i and a left camera k.

    A cell stands out where it is more than 75 grey levels brighter than every cell of the other camera within one row
    and 0 to 5 columns: what lies in column u of k lies farther left in i. Gain and offset between the cameras are
    fitted to the cells that agree best; cells whose partners lie outside the other image are not looked at.
    """
    gain, offset = _affine(coarse_k[:, _USUAL_SHIFT:], coarse_i[:, :-_USUAL_SHIFT])
    fitted_i = gain * coarse_i + offset
    brighter_i = (fitted_i - _brightest(coarse_k, ahead=True))[:, : _COLUMNS - _SHIFTS + 1] > _MARK
    brighter_k = (coarse_k - _brightest(fitted_i, ahead=False))[:, _SHIFTS - 1 :] > _MARK
    return Light(_largest_share(brighter_i), _largest_share(brighter_k))


def _brightest(grid: Grid, *, ahead: bool) -> Grid:
    """For each cell the largest value within one row and 0 to 5 columns to the right (ahead) or left of it."""
    anchor = (0 if ahead else _SHIFTS - 1, 1)
    return np.asarray(cv2.dilate(grid, np.ones((3, _SHIFTS), dtype=np.uint8), anchor=anchor), dtype=np.float32)


def _largest_share(cells: NDArray[np.bool_]) -> float:
    shares = cv2.boxFilter(cells.astype(np.float32), cv2.CV_32F, (_WINDOW, _WINDOW), borderType=cv2.BORDER_CONSTANT)
    return float(np.max(shares))


def _affine(target: Grid, source: Grid) -> tuple[np.float32, np.float32]:
    """Gain and offset that take source to target: least squares over the cells that fit best, repeated.

    Saturated cells say nothing of either; where hardly any other is left the cameras are taken to be equal.
    """
    told = np.maximum(source, target) < _SATURATED
    x, y = source[told], target[told]
    if x.size < _FEWEST_CELLS:
        return np.float32(1), np.float32(0)
    gain, offset = np.float32(1), np.float32(np.median(y) - np.median(x))
    keep = int(_KEPT_SHARE * x.size)
    for _ in range(_ROUNDS):
        best = np.argpartition(np.abs(gain * x + offset - y), keep)[:keep]
        mean_x, mean_y = x[best].mean(), y[best].mean()
        spread = x[best] - mean_x
        gain = np.clip(np.dot(spread, y[best] - mean_y) / max(np.dot(spread, spread), np.float32(1)), *_GAINS)
        offset = mean_y - gain * mean_x
    return np.float32(gain), np.float32(offset)
