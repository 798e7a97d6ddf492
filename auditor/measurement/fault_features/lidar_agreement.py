"""How well the LiDAR agrees with stereo over the whole view: as it is, moved by one offset, biased, or lagging.

An attack changes a portion of the view, a fault all of it: where most points agree only with one constant added, a
sensor is rotated; where they agree with stereo of the frame before, the LiDAR lags. Only disparities at which the two
images are consistent are used.
"""

from dataclasses import dataclass
from math import nan

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.measurement.checks.photometric_consistency import PairConsistency
from auditor.measurement.disparity.lidar import LidarView
from auditor.measurement.disparity.stereo import StereoMap
from auditor.measurement.parameters import HALF, LIDAR_AGREEMENT, MATCHER_RANGE, PATCH_CORRELATION
from auditor.model.arrays import Floats32, Indices
from auditor.model.fault_features import Agreement

FEWEST = 200
"""Points compared: shares of fewer say nothing."""
_LARGEST_BIAS_PX = 24  # of disparity: cameras that are farther off fit nowhere

_SHIFTS = [*((by, 0) for by in LIDAR_AGREEMENT.shifts_px), *((0, by) for by in LIDAR_AGREEMENT.shifts_px)]
BORDER = max(LIDAR_AGREEMENT.shifts_px) // HALF
"""By how many half-resolution pixels points are moved at most."""


@dataclass(frozen=True, eq=False)
class LidarComparison:
    """The comparable data of the LiDAR and a camera pair in one view of one frame.

    `sure_px`: DM_{j,k} (h, w) at half resolution, in full-resolution pixels, NaN where the pair's images are not
    consistent, and in a border of BORDER pixels around it: points may be moved out of the view. `row`, `column` and
    `d0_px` (M,): about 2,500 LiDAR points, full-resolution pixels.
    """

    sure_px: Floats32
    row: NDArray[np.int32]
    column: NDArray[np.int32]
    d0_px: Floats32

    @classmethod
    def of(cls, view: LidarView, stereo: StereoMap, consistency: PairConsistency, source: int) -> "LidarComparison":
        """Keep consistent disparities, and points within the matcher's range."""
        step = HALF // stereo.step
        sure = consistency.comparable & (consistency.ncc > PATCH_CORRELATION.consistent)
        every = slice(None, None, max(view.row.size // LIDAR_AGREEMENT.points, 1))
        d0 = view.disparity_px(source)[every]
        near = d0 < stereo.range_px - MATCHER_RANGE.margin_px
        height, width = sure.shape
        sure_px = np.full((height + 2 * BORDER, width + 2 * BORDER), np.nan, dtype=np.float32)
        inner = sure_px[BORDER:-BORDER, BORDER:-BORDER]
        cv2.copyTo(stereo.disparity_px[::step, ::step], sure.view(np.uint8), inner)  # far faster than `np.where`
        return cls(sure_px, view.row[every][near], view.column[every][near], d0[near])


def agreement(now: LidarComparison, before: LidarComparison | None) -> Agreement:
    """Compare the LiDAR's points with stereo of this frame and of the one before; all NaN where too few can be."""
    difference = differences(now, now.sure_px)
    compared = np.count_nonzero(~np.isnan(difference))
    if compared < FEWEST:
        return Agreement()
    bias, biased = _bias(difference)
    moved = np.stack([differences(now, now.sure_px, right, down) for right, down in _SHIFTS])
    best = int(np.argmax(_only(moved, difference) - _only(difference, moved)))
    (right, down), most = _SHIFTS[best], moved[best]
    least = _moved_little(now, difference, most, right, down)
    earlier = None if before is None else differences(now, before.sure_px)
    return Agreement(
        compared=float(compared),
        agreeing=_agreeing(difference),
        bias_px=bias,
        biased=biased,
        right_px=float(right),
        down_px=float(down),
        rotated=_agreeing(most),
        rotated_only=float(_only(most, least)),
        unrotated_only=float(_only(least, most)),
        before_only=nan if earlier is None else float(_only(earlier, difference)),
        now_only=nan if earlier is None else float(_only(difference, earlier)),
    )


def _moved_little(now: LidarComparison, unmoved: Floats32, moved: Floats32, right: int, down: int) -> Floats32:
    """The differences that those of `moved` points are held against: of points as they are, or moved by a little.

    A LiDAR whose points agree at least as well once moved by the tolerated offset is as vehicles are built.
    """
    by = LIDAR_AGREEMENT.tolerated_px
    little = differences(now, now.sure_px, right=int(np.sign(right)) * by, down=int(np.sign(down)) * by)
    return unmoved if _only(moved, little) > _only(little, moved) else little


def differences(points: LidarComparison, sure_px: Floats32, right: int = 0, down: int = 0) -> Floats32:
    """(M,) disparities of stereo less the LiDAR's, its points moved by some pixels; NaN where stereo is not sure."""
    row, column = (points.row + down) // HALF + BORDER, (points.column + right) // HALF + BORDER
    return np.asarray(sure_px.take(row * sure_px.shape[1] + column) - points.d0_px)


def _agreeing(difference: Floats32) -> float:
    """The share of the compared points that agree; 0 where too few were compared."""
    compared = int(np.count_nonzero(~np.isnan(difference)))
    agreeing = float(np.count_nonzero(np.abs(difference) <= LIDAR_AGREEMENT.agree_px))
    return agreeing / compared if compared >= FEWEST else 0.0


def _only(these: Floats32, others: Floats32) -> Indices:
    """How many points, (..., M), agree by these differences and are far off by the others, where both are known."""
    agree, differ = np.abs(these) <= LIDAR_AGREEMENT.agree_px, np.abs(others) > LIDAR_AGREEMENT.differ_px
    return np.asarray(np.count_nonzero(agree & differ, axis=-1))


def _bias(difference: Floats32) -> tuple[float, float]:
    """The constant with which most points agree, in whole pixels, and their share."""
    largest, window = _LARGEST_BIAS_PX, LIDAR_AGREEMENT.bias_window_px
    near = difference[np.abs(difference) < largest]
    counts = np.bincount(np.rint(near).astype(np.intp) + largest, minlength=window)
    bias = int(np.argmax(np.convolve(counts, np.ones(window), mode="same"))) - largest
    return float(bias), _agreeing(difference - np.float32(bias))
