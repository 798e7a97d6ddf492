"""How well the LiDAR agrees with stereo over the whole picture: as it is, moved as one, biased, or a frame late.

An attack changes a portion of the view, a fault all of it: where one constant makes most points agree that did not, a
sensor has turned; where stereo of the frame before does, the LiDAR lags. Only those disparities are asked at which the
two pictures are alike.
"""

from dataclasses import dataclass
from math import nan

import numpy as np
from numpy.typing import NDArray

from auditor.evidence.lidar import LidarView
from auditor.evidence.likeness import Likeness
from auditor.evidence.stereo import StereoMap
from auditor.rig import Rig
from auditor.symptoms import Agreement

_POINTS = 2500
_FEWEST = 200
_AGREE_PX = 1
_LARGEST_BIAS_PX = 24
_SHIFTS_PX = (-16, -12, -8, -4, 4, 8, 12, 16)
_RANGE_MARGIN_PX = 3.0
_ALIKE = 0.7
_HALF = 2

Floats = NDArray[np.float32]
Indices = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class SureMap:
    """(h, w) disparities at half resolution, in full-resolution pixels; NaN where the pair's pictures are not alike."""

    disparity_px: Floats
    range_px: int

    @classmethod
    def of(cls, stereo: StereoMap, alike: Likeness) -> "SureMap":
        """Keep what the pictures confirm."""
        step = _HALF // stereo.step
        sure = alike.comparable & (alike.alike > _ALIKE)
        return cls(np.where(sure, stereo.disparity_px[::step, ::step], np.float32(np.nan)), stereo.range_px)


def agreement(view: LidarView, stereo: SureMap, before: SureMap | None, rig: Rig, witness: int) -> Agreement:
    """Compare about 2,500 points with DM_{j,k}, of this frame and of the one before; all NaN where too few can be."""
    every = slice(None, None, max(view.row.size // _POINTS, 1))
    d0 = view.disparity_px(rig, witness)[every]
    row, column = view.row[every], view.column[every]
    inside = d0 < stereo.range_px - _RANGE_MARGIN_PX
    d0, row, column = d0[inside], row[inside], column[inside]
    now = _differences(stereo, row, column, d0)
    if np.count_nonzero(~np.isnan(now)) < _FEWEST:
        return Agreement()
    bias, biased = _bias(now)
    moved = [(_agreeing(_differences(stereo, row, column + s, d0)), float(s), 0.0) for s in _SHIFTS_PX]
    moved += [(_agreeing(_differences(stereo, row + s, column, d0)), 0.0, float(s)) for s in _SHIFTS_PX]
    turned, right_px, down_px = max(moved)
    return Agreement(
        compared=float(np.count_nonzero(~np.isnan(now))),
        agreeing=_agreeing(now),
        bias_px=bias,
        biased=biased,
        right_px=right_px,
        down_px=down_px,
        turned=turned,
        late_gain=_gain(now, _differences(before, row, column, d0)) if before else nan,
    )


def _differences(stereo: SureMap, row: Indices, column: Indices, d0: Floats) -> Floats:
    """(M,) DM_{j,k} less DM_{0,k} at full-resolution pixels, NaN where stereo is not sure."""
    height, width = stereo.disparity_px.shape
    row, column = row // _HALF, column // _HALF
    inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
    ds = stereo.disparity_px[np.where(inside, row, 0), np.where(inside, column, 0)]
    return np.asarray(np.where(inside, ds - d0, np.nan), dtype=np.float32)


def _agreeing(difference: Floats) -> float:
    """The share of those asked that agree; 0 where too few were."""
    asked = int(np.count_nonzero(~np.isnan(difference)))
    return float(np.count_nonzero(np.abs(difference) <= _AGREE_PX)) / asked if asked >= _FEWEST else 0.0


def _gain(now: Floats, before: Floats) -> float:
    both = ~np.isnan(now) & ~np.isnan(before)
    return _agreeing(before[both]) - _agreeing(now[both]) if np.count_nonzero(both) >= _FEWEST else nan


def _bias(difference: Floats) -> tuple[float, float]:
    """The constant with which most points agree, in whole pixels, and their share."""
    near = difference[np.abs(difference) < _LARGEST_BIAS_PX]
    counts = np.bincount(np.rint(near).astype(np.intp) + _LARGEST_BIAS_PX, minlength=3)
    bias = int(np.argmax(np.convolve(counts, np.ones(3), mode="same"))) - _LARGEST_BIAS_PX
    return float(bias), _agreeing(difference - np.float32(bias))
