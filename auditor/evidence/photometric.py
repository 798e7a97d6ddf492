"""A witness that needs no geometry: light in one camera that no other camera sees."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

ROWS, COLUMNS = 24, 78
_MARK = 45.0  # grey levels
_SHIFTS = 6  # cells: 0 to 5, that is up to 80 px on a 1242 px wide image
_ROUNDS = 6
_KEPT_SHARE = 0.6
_GAINS = (0.5, 2.0)

Grid = NDArray[np.float32]


@dataclass(frozen=True)
class Photometry:
    """Shares of the cells of two cameras i < k that stand out against everything that the other sees nearby.

    `brighter_i`: brighter in S_i; `darker_i`: darker in S_i; the same for S_k.
    """

    brighter_i: float
    brighter_k: float
    darker_i: float
    darker_k: float


def coarse(half: NDArray[np.uint8]) -> Grid:
    """(24, 78) means of a half-resolution grey image."""
    return np.asarray(cv2.resize(half, (COLUMNS, ROWS), interpolation=cv2.INTER_AREA), dtype=np.float32)


def compare_light(coarse_i: Grid, coarse_k: Grid) -> Photometry:
    """Compare the (24, 78) grids of a right camera i and a left camera k.

    What lies in column u of k lies 0 to 5 cells to the left of it in i. The cameras' gain and offset are fitted to the
    cells that agree best; those whose partners lie outside the other image are not looked at.
    """
    gain, offset = _affine(coarse_k[:, _SHIFTS:], coarse_i[:, : COLUMNS - _SHIFTS])
    fitted_i = gain * coarse_i + offset
    inner_i, inner_k = np.s_[:, : COLUMNS - _SHIFTS + 1], np.s_[:, _SHIFTS - 1 :]
    brightest_i, brightest_k = _most(fitted_i, to_the_left=True), _most(coarse_k, to_the_left=False)
    darkest_i, darkest_k = -_most(-fitted_i, to_the_left=True), -_most(-coarse_k, to_the_left=False)
    return Photometry(
        brighter_i=float(np.mean((fitted_i - brightest_k)[inner_i] > _MARK)),
        brighter_k=float(np.mean((coarse_k - brightest_i)[inner_k] > _MARK)),
        darker_i=float(np.mean((darkest_k - fitted_i)[inner_i] > _MARK)),
        darker_k=float(np.mean((darkest_i - coarse_k)[inner_k] > _MARK)),
    )


def _most(grid: Grid, *, to_the_left: bool) -> Grid:
    """For each cell the largest value within one row and 0 to 5 columns to one side of it."""
    anchor = (_SHIFTS - 1 if to_the_left else 0, 1)
    return np.asarray(cv2.dilate(grid, np.ones((3, _SHIFTS), dtype=np.uint8), anchor=anchor), dtype=np.float32)


def _affine(target: Grid, source: Grid) -> tuple[np.float32, np.float32]:
    """Gain and offset that take source to target, by least squares over the cells that fit best (trimmed, repeated)."""
    x, y = source.ravel(), target.ravel()
    gain, offset = np.float32(1), np.float32(np.median(y) - np.median(x))
    keep = int(_KEPT_SHARE * x.size)
    for _ in range(_ROUNDS):
        best = np.argpartition(np.abs(gain * x + offset - y), keep)[:keep]
        mean_x, mean_y = x[best].mean(), y[best].mean()
        spread = x[best] - mean_x
        gain = np.clip(np.dot(spread, y[best] - mean_y) / max(np.dot(spread, spread), np.float32(1)), *_GAINS)
        offset = mean_y - gain * mean_x
    return np.float32(gain), np.float32(offset)
