"""Brightness differences: light or darkness that one of two cameras alone sees. This check needs no disparities."""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from auditor.measurement.disparity.lidar import RangeMask
from auditor.measurement.parameters import BRIGHTNESS_DIFFERENCE, GAIN_FIT
from auditor.model.arrays import Floats32, Image, Mask

_ROWS, _COLUMNS = BRIGHTNESS_DIFFERENCE.rows, BRIGHTNESS_DIFFERENCE.columns
_BRIGHTER, _DARKER = BRIGHTNESS_DIFFERENCE.brighter_by, BRIGHTNESS_DIFFERENCE.darker_by
_SHIFTS = BRIGHTNESS_DIFFERENCE.columns_searched  # 0 to 5 cells: up to 80 px of an image 1242 px wide
_NEAR_SHIFTS = BRIGHTNESS_DIFFERENCE.columns_searched_near
_USUAL_SHIFT = BRIGHTNESS_DIFFERENCE.usual_shift  # where most of a street's partners lie
_WHITE = np.float32(255)


def fit_gain(target: Floats32, source: Floats32) -> tuple[np.float32, np.float32]:
    """Gain and offset that take source to target: least squares over the six tenths that fit best, repeated.

    Both are grey levels of one shape. Saturated ones are left out; where too few are left the cameras are taken to be
    equal.
    """
    usable = np.maximum(source, target) < GAIN_FIT.saturated
    x, y = source[usable], target[usable]
    if x.size < GAIN_FIT.fewest:
        return np.float32(1), np.float32(0)
    gain, offset = np.float32(1), np.float32(np.median(y) - np.median(x))
    keep = int(GAIN_FIT.kept_share * x.size)
    for _ in range(GAIN_FIT.rounds):
        best = np.argpartition(np.abs(gain * x + offset - y), keep)[:keep]
        mean_x, mean_y = x[best].mean(), y[best].mean()
        spread = x[best] - mean_x
        gain = np.clip(np.dot(spread, y[best] - mean_y) / max(np.dot(spread, spread), np.float32(1)), *GAIN_FIT.gains)
        offset = mean_y - gain * mean_x
    return np.float32(gain), np.float32(offset)


@dataclass(frozen=True)
class BrightnessDifference:
    """How much cameras i < k are each brighter than the other one.

    Each is the largest share, 0 to 1, of brighter cells in any window of 6 x 6. Light thrown into a camera makes its
    own share large, darkness the other's: a pair cannot tell the two apart.
    """

    brighter_i: float
    brighter_k: float


def coarse(half: Image) -> Floats32:
    """(24, 78) means of a grey image."""
    return np.asarray(cv2.resize(half, (_COLUMNS, _ROWS), interpolation=cv2.INTER_AREA), dtype=np.float32)


def coarse_mask(half: Mask) -> Mask:
    """(24, 78) cells of which any pixel is set in a half-resolution mask."""
    return np.asarray(cv2.resize(half.astype(np.float32), (_COLUMNS, _ROWS), interpolation=cv2.INTER_AREA) > 0)


def range_mask(width_px: int) -> RangeMask:
    """The range mask for images of that width: the partner of what is nearer lies more than 5 columns away."""
    cell_px = width_px / _COLUMNS
    return RangeMask((_SHIFTS - 1) * cell_px, round((_NEAR_SHIFTS - 1) * cell_px))


def compare_brightness(coarse_i: Floats32, coarse_k: Floats32, near: Mask | None = None) -> BrightnessDifference:
    """Compare the (24, 78) grids of a right camera i and a left camera k.

    What lies in column u of k lies up to 5 columns farther left in i. A camera is brighter where one of its cells is
    more than 75 grey levels brighter than all its possible partners in the other image, and where a cell of the other
    is more than 40 darker than all its possible partners: light covers the dark object. Gain and offset between the
    cameras are fitted to the cells that agree best; cells whose partners lie outside the other image do not count. What
    is `near` (24, 78) may be up to 15 columns away, and occluded: there darker cells do not count.
    """
    gain, offset = fit_gain(coarse_k[:, _USUAL_SHIFT:], coarse_i[:, :-_USUAL_SHIFT])
    least_i = np.minimum(gain * coarse_i + offset, _WHITE)
    most_i = np.where(coarse_i < GAIN_FIT.saturated, least_i, _WHITE)  # a saturated cell has no upper limit
    far = True if near is None else ~near
    brighter_i = least_i - _around(cv2.dilate, coarse_k, _NEAR_SHIFTS, ahead=True) > _BRIGHTER
    brighter_i |= far & (least_i - _around(cv2.dilate, coarse_k, _SHIFTS, ahead=True) > _BRIGHTER)
    brighter_k = coarse_k - _around(cv2.dilate, most_i, _NEAR_SHIFTS, ahead=False) > _BRIGHTER
    brighter_k |= far & (coarse_k - _around(cv2.dilate, most_i, _SHIFTS, ahead=False) > _BRIGHTER)
    darker_i = far & (_around(cv2.erode, coarse_k, _SHIFTS, ahead=True) - most_i > _DARKER)
    darker_k = far & (_around(cv2.erode, least_i, _SHIFTS, ahead=False) - coarse_k > _DARKER)
    for of_i in (brighter_i, darker_i):
        of_i[:, _COLUMNS - _SHIFTS + 1 :] = False
    for of_k in (brighter_k, darker_k):
        of_k[:, : _SHIFTS - 1] = False
    # Where one camera is darker, the other is brighter at the usual shift.
    brighter_i[:, :-_USUAL_SHIFT] |= darker_k[:, _USUAL_SHIFT:]
    brighter_k[:, _USUAL_SHIFT:] |= darker_i[:, :-_USUAL_SHIFT]
    return BrightnessDifference(_largest_share(brighter_i), _largest_share(brighter_k))


def _around(extreme: Callable[..., cv2.typing.MatLike], grid: Floats32, columns: int, *, ahead: bool) -> Floats32:
    """For each cell the extreme value within one row and so many columns, rightwards (ahead) or leftwards."""
    rows = BRIGHTNESS_DIFFERENCE.rows_searched
    anchor = (0 if ahead else columns - 1, rows // 2)
    return np.asarray(extreme(grid, np.ones((rows, columns), dtype=np.uint8), anchor=anchor), dtype=np.float32)


def _largest_share(cells: Mask) -> float:
    shares = cv2.boxFilter(
        cells.astype(np.float32), cv2.CV_32F, BRIGHTNESS_DIFFERENCE.window, borderType=cv2.BORDER_CONSTANT
    )
    return float(np.max(shares))
