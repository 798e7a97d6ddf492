"""Lost returns: surfaces that two cameras see where the LiDAR, which scans there, has no return at all.

Spoofers make a LiDAR lose an object or a whole sector. Black paint and glass lose returns as well, here and there: some
beams beside come back, from a tyre, a frame, a number plate. So a surface counts as lost only where no beam returns
within a third of a metre around, whatever its distance.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from auditor.measurement.checks.count_grid import cells_of_directions
from auditor.measurement.checks.photometric_consistency import PairConsistency
from auditor.measurement.disparity.lidar import LidarView
from auditor.measurement.disparity.stereo import StereoMap
from auditor.measurement.parameters import COUNT_GRID, HALF, MATCHER_RANGE
from auditor.measurement.point_parameters import LOST_RETURNS
from auditor.model.arrays import Floats32, Indices, Mask
from auditor.model.measurement import Cells

_FINER = LOST_RETURNS.finer
_RADIANS = COUNT_GRID.lidar_cell / _FINER
_ROWS, _COLUMNS = (size * _FINER for size in COUNT_GRID.lidar_cells)


@dataclass(frozen=True, eq=False)
class ScannedView:
    """Where a LiDAR scans, on a grid of directions finer than the count grid, in the rig's axes.

    `empty_rad` (rows, columns) is how far each direction is from the nearest one with a return; `scanned` (rows,) are
    the rows between the LiDAR's uppermost and lowest beams; `span_px` are the columns of the view within its field.
    """

    empty_rad: Floats32
    scanned: Mask
    span_px: tuple[float, float]


def scanned_view(view: LidarView) -> ScannedView:
    """Where the LiDAR of a view scans, by the frame's own points; those that the camera does not see count as well."""
    assert view.rig.lidar is not None
    place = _places(view.rig.lidar.rig_SE3_lidar[:3, :3].astype(np.float32) @ view.in_view_m.T)
    missed = np.ones((_ROWS, _COLUMNS), dtype=np.uint8)
    missed.ravel()[place[place >= 0]] = 0
    empty = cv2.distanceTransform(missed, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return ScannedView(np.asarray(empty * np.float32(_RADIANS)), _scanned_rows(missed == 0), view.span_px)


def count_lost_returns(
    view: LidarView, scanned: ScannedView, stereo: StereoMap, consistency: PairConsistency, source: int
) -> Cells:
    """Count the surface samples that a pair sees, and those whose returns are lost, by direction from the LiDAR.

    Samples are two a cell of the count grid, across and down. A sample is a surface where both cameras see it, with
    texture and a consistent match, nearer than the farthest distance that is looked at.
    """
    place, range_m = _surfaces(view, scanned, stereo, consistency, source)
    valid = place >= 0
    valid[valid] = scanned.scanned[place[valid] // _COLUMNS]
    place, range_m = place[valid], range_m[valid]
    empty = scanned.empty_rad.ravel()[place]
    # Of a LiDAR with few beams most directions lie between two of them.
    usual = LOST_RETURNS.gap_medians * float(np.median(empty)) if empty.size else 0.0
    lost = empty > np.maximum(LOST_RETURNS.around_m / range_m, max(LOST_RETURNS.narrowest, usual))
    return cells_of_directions(place // _COLUMNS // _FINER, place % _COLUMNS // _FINER, lost)


def _surfaces(
    view: LidarView, scanned: ScannedView, stereo: StereoMap, consistency: PairConsistency, source: int
) -> tuple[Indices, Floats32]:
    """(M,) places on the finer grid, -1 outside, and distances from the LiDAR of the surfaces that a pair sees."""
    rig, camera = view.rig, view.rig.camera(view.reference)
    assert rig.lidar is not None
    focal_times_baseline = camera.focal_px * rig.baseline_m(source, view.reference)
    every = max(round(camera.focal_px * _RADIANS / HALF), 1)
    some = (slice(every // 2, None, every),) * 2
    grid = HALF // stereo.step
    disparity, textured = stereo.disparity_px[::grid, ::grid][some], stereo.textured[::grid, ::grid][some]
    surface = consistency.matches.seen[some] & textured & (consistency.ncc[some] > LOST_RETURNS.consistent)
    surface &= (disparity > focal_times_baseline / LOST_RETURNS.farthest_m) & (
        disparity < stereo.range_px - MATCHER_RANGE.margin_px
    )
    row, column = ((HALF * (at * every + every // 2) + (HALF - 1) / 2).astype(np.float32) for at in np.nonzero(surface))
    inside = (column >= scanned.span_px[0]) & (column <= scanned.span_px[1])
    row, column = row[inside], column[inside]
    depth = (focal_times_baseline / disparity[surface][inside]).astype(np.float32)
    # X = K^-1 (z (u, v, 1) - p), with P = (K | p), seen from the LiDAR.
    inverse = np.linalg.inv(camera.projection[:, :3])
    start = inverse @ camera.projection[:, 3] + rig.lidar.rig_SE3_lidar[:3, 3]
    points = inverse.astype(np.float32) @ (np.stack([column, row, np.ones_like(row)]) * depth)
    points -= start.astype(np.float32)[:, None]
    return _places(points), np.sqrt(np.einsum("cm,cm->m", points, points))


def _places(points_m: Floats32) -> Indices:
    """(M,) cells of the finer grid, row by row, of directions (3, M) to right, down and forward; -1 outside."""
    x, y, z = points_m
    row = np.floor(np.arctan2(y, np.hypot(x, z)) / np.float32(_RADIANS)).astype(np.intp) + _ROWS // 2
    column = np.floor(np.arctan2(x, z) / np.float32(_RADIANS)).astype(np.intp) + _COLUMNS // 2
    inside = (row >= 0) & (row < _ROWS) & (column >= 0) & (column < _COLUMNS)
    return np.where(inside, row * _COLUMNS + column, -1)


def _scanned_rows(hit: Mask) -> Mask:
    """(rows,) those between the first and the last row of cells in a quarter of whose columns there are returns.

    Those two are left out: a beam at the edge of the field crosses them.
    """
    in_rows = np.logical_or.reduce(hit.reshape(-1, _FINER, _COLUMNS), axis=1)
    used = in_rows[:, in_rows.any(axis=0)]
    crossed = np.flatnonzero(used.mean(axis=1) > LOST_RETURNS.least_crossed) if used.size else np.zeros(0, np.intp)
    scanned = np.zeros(len(in_rows), dtype=np.bool_)
    if crossed.size:
        scanned[crossed[0] + 1 : crossed[-1]] = True
    return np.repeat(scanned, _FINER)
