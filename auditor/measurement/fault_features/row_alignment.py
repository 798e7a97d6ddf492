"""Row alignment: whether the points of one image lie on the same rows of another, of this frame or the one before.

Rectified cameras that see one moment see every point on one row. A tilted camera moves all rows by a constant; one that
lags moves them as the scene has moved since. Points are followed to the other camera and to the frame before (pyramidal
Lucas-Kanade), and each hypothesis is scored by the share of points that it puts on one row.
"""

from collections.abc import Mapping
from math import nan

import cv2
import numpy as np

from auditor.measurement.parameters import HALF, ROW_ALIGNMENT
from auditor.model.arrays import Floats32, Image, Mask, Points, median_of, quantile_of
from auditor.model.checks import Pair
from auditor.model.fault_features import RowMatches

_LEVELS = 3  # of the pyramid: beyond these no corner is found again
_ITERATIONS = 10  # at most: it bounds the work
_ACCURACY_PX = 0.05  # half px, at which the search ends
_FEWEST = 15  # points followed: shares of fewer say nothing


_ROWS, _COLUMNS = ROW_ALIGNMENT.blocks
_AROUND = np.ones([2 * side - 1 for side in ROW_ALIGNMENT.window_px], dtype=np.uint8)  # of the pyramid's second level
_ACCURACY = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, _ITERATIONS, _ACCURACY_PX)


def corners(half: Image, sees: Mask | None = None) -> Points:
    """(P, 2) columns and rows of the strongest corner of each of 6 x 20 blocks, without the weakest three in ten.

    In a view that the camera does not see whole, only where it `sees`: (H, W) at full resolution.
    """
    strength = cv2.cornerMinEigenVal(half, ROW_ALIGNMENT.corner_px)
    if sees is not None:
        inner = cv2.erode(sees[::HALF, ::HALF].astype(np.uint8), _AROUND)
        strength[inner == 0] = 0
    height, width = (size // count for size, count in zip(half.shape, (_ROWS, _COLUMNS), strict=True))
    if height == 0 or width == 0:
        return np.zeros((0, 2), dtype=np.float32)
    cut = strength[: height * _ROWS, : width * _COLUMNS].reshape(_ROWS, height, _COLUMNS, width)
    blocks = cut.transpose(0, 2, 1, 3).reshape(_ROWS, _COLUMNS, height * width)
    place = blocks.argmax(axis=2)
    row = np.arange(_ROWS)[:, None] * height + place // width
    column = np.arange(_COLUMNS) * width + place % width
    strongest = blocks.max(axis=2)
    strengths = strongest if sees is None else strongest[strongest > 0]
    weakest = quantile_of(np.sort(strengths, axis=None), 1 - ROW_ALIGNMENT.kept_share) if strengths.size else 0.0
    kept = (strongest >= weakest) & (strongest > 0)
    return np.stack([column[kept], row[kept]], axis=1).astype(np.float32)


def register(
    points: Mapping[int, Points],
    now: Mapping[int, Image],
    before: Mapping[int, Image],
    disparities_px: Mapping[Pair, Floats32],
) -> dict[Pair, RowMatches]:
    """Follow the points (P, 2) of each reference k to each of its source cameras, and both to the frame before.

    `now` and `before` are half-resolution grey images. `disparities_px` holds DM_{i,k} at the points, (P,)
    half-resolution pixels, where following begins. A pair of which fewer than 15 points can be followed is left out;
    the lag of cameras that `before` lacks is not measured.
    """
    flows = {k: _follow(now[k], before[k], points[k], points[k]) for k in points if k in before}
    rows = {}
    for (i, k), disparity in disparities_px.items():
        start = points[k].copy()
        start[:, 0] -= np.nan_to_num(disparity)
        match, tracked = _follow(now[k], now[i], points[k], start)
        back_k = flows.get(k)
        back_i = _follow(now[i], before[i], match, match) if i in before else None
        for back in (back_i, back_k):
            tracked = tracked & back[1] if back else tracked
        if np.count_nonzero(tracked) >= _FEWEST:
            apart = match[:, 1] - points[k][:, 1]
            # Where i lags it shows the scene of the frame before, where k's points lay then; and the other way round.
            lagged_i = _share(match[:, 1] - back_k[0][:, 1], tracked) if back_k else nan
            lagged_k = _share(back_i[0][:, 1] - points[k][:, 1], tracked) if back_i else nan
            rows[i, k] = _features(apart, tracked, lagged_i, lagged_k)
    return rows


def _features(apart: Points, tracked: Mask, lagged_i: float, lagged_k: float) -> RowMatches:
    offset = median_of(np.sort(apart[tracked]))
    return RowMatches(
        tracked=float(np.count_nonzero(tracked)),
        row_aligned=_share(apart, tracked),
        offset_px=float(HALF * offset),
        offset_share=_share(apart - offset, tracked),
        lagged_i=lagged_i,
        lagged_k=lagged_k,
    )


def _share(residual: Points, among: Mask) -> float:
    return float(np.mean(np.abs(residual[among]) <= ROW_ALIGNMENT.same_row_px))


def _follow(source: Image, target: Image, points: Points, start: Points) -> tuple[Points, Mask]:
    """Where (P, 2) points of one image lie in another, and which of them were found."""
    if len(points) == 0:
        return points, np.zeros(0, dtype=np.bool_)
    moved, status, residue = cv2.calcOpticalFlowPyrLK(
        source,
        target,
        points[:, None],
        start[:, None].copy(),
        winSize=ROW_ALIGNMENT.window_px,
        maxLevel=_LEVELS,
        criteria=_ACCURACY,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    good = (status[:, 0] > 0) & (residue[:, 0] < ROW_ALIGNMENT.largest_residue)
    return np.asarray(moved[:, 0], dtype=np.float32), np.asarray(good)
