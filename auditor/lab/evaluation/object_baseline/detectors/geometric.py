"""Objects without a network: points that stand above the ground, clustered in a camera's view.

The points come from the LiDAR or from a disparity map; both are treated alike, so that any difference comes from
the sensors. Objects have no kind.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.lab.evaluation.object_baseline.detectors.interface import Detection, ImageBox
from auditor.measurement.disparity.lidar import LidarView
from auditor.measurement.disparity.stereo import StereoMap
from auditor.model.arrays import Floats, Indices
from auditor.model.rig import Camera, Rig

GEOMETRIC = "geometric"

SETTINGS = {"version": 1}
"""The version is raised whenever the same points would give other boxes."""

CELL_PX = 8
DEPTH_RATIO = 1.06
NEAREST_M, FARTHEST_M = 3.0, 40.0
LOWEST_M, HIGHEST_M = 0.3, 2.0
MIN_HEIGHT_M, MIN_WIDTH_M, MIN_VOXELS = 0.5, 0.3, 6
TRIMMED_PERCENT = 2.0

_HYPOTHESES, _GROUND_POINTS = 200, 1500
_STEEPEST = 0.15
_CAMERA_HEIGHTS_M = (0.5, 4.0)
_GROUND_TOLERANCE_M = 0.12


@dataclass(frozen=True, eq=False)
class ViewPoints:
    """The points of one sensor in a view: (M,) columns and rows in pixels, (M,) depths in metres.

    A cell of CELL_PX x CELL_PX pixels at one depth counts from `per_cell` points on.
    """

    u_px: Floats
    v_px: Floats
    depth_m: Floats
    per_cell: int = 1


def lidar_points(view: LidarView, rig: Rig) -> ViewPoints:
    """The LiDAR's points in a view."""
    assert rig.lidar is not None
    P = rig.camera(view.reference).projection @ rig.lidar.rig_SE3_lidar
    depth = view.point_m @ P[2, :3] + P[2, 3]
    return ViewPoints(view.u_px.astype(np.float64), view.row.astype(np.float64), depth)


def stereo_points(stereo: StereoMap, focal_px: float, baseline_m: float) -> ViewPoints:
    """The points of a disparity map where there is texture (Eq. 1)."""
    usable = stereo.valid & stereo.textured & (stereo.disparity_px > 0)
    row, column = np.nonzero(usable)
    depth = focal_px * baseline_m / stereo.disparity_px[row, column].astype(np.float64)
    u, v = (np.asarray(index * stereo.step, dtype=np.float64) for index in (column, row))
    return ViewPoints(u, v, depth, per_cell=(CELL_PX // stereo.step) ** 2 // 4)


def find_objects(points: ViewPoints, camera: Camera) -> tuple[Detection, ...]:
    """Clusters of points above the ground, as boxes in the camera's image; none where no ground is found."""
    u, v, z = points.u_px, points.v_px, points.depth_m
    K = camera.intrinsics
    x, y = (u - K[0, 2]) * z / K[0, 0], (v - K[1, 2]) * z / K[1, 1]
    near = (z > NEAREST_M) & (z < FARTHEST_M)
    u, v, x, y, z = u[near], v[near], x[near], y[near], z[near]
    ground = _ground(x, y, z)
    if ground is None:
        return ()
    height = np.stack([x, z, np.ones_like(x)], axis=1) @ ground - y
    above = (height > LOWEST_M) & (height < HIGHEST_M)
    u, v, x, z, height = u[above], v[above], x[above], z[above], height[above]
    cluster = _clusters(u, v, z, camera, points.per_cell)
    objects = (_object(u[of_it], v[of_it], x[of_it], height[of_it]) for of_it in _members(cluster))
    return tuple(Detection(box) for box in objects if box is not None)


def _ground(x: Floats, y: Floats, z: Floats) -> Floats | None:
    """(a, b, c) of the plane y = a x + b z + c that most points lie on; the draw of hypotheses is always the same."""
    step = max(len(x) // _GROUND_POINTS, 1)
    x, y, z = x[::step], y[::step], z[::step]
    if len(x) < 3:
        return None
    chosen = np.random.default_rng(0).integers(0, len(x), (_HYPOTHESES, 3))
    rows = np.stack([x[chosen], z[chosen], np.ones(chosen.shape)], axis=2)
    solvable = np.abs(np.linalg.det(rows)) > 1e-3
    planes = np.linalg.solve(rows[solvable], y[chosen][solvable][..., None])[..., 0]
    level = (np.abs(planes[:, :2]) < _STEEPEST).all(axis=1)
    level &= (planes[:, 2] > _CAMERA_HEIGHTS_M[0]) & (planes[:, 2] < _CAMERA_HEIGHTS_M[1])
    planes = planes[level]
    if not len(planes):
        return None
    distance = np.abs(planes @ np.stack([x, z, np.ones_like(x)]) - y)
    best: Floats = planes[np.argmax(np.count_nonzero(distance < _GROUND_TOLERANCE_M, axis=1))]
    return best


def _clusters(u: Floats, v: Floats, z: Floats, camera: Camera, per_cell: int) -> NDArray[np.int32]:
    """(M,) number of the cluster of each point, 0 for none: neighbours in column and in the logarithm of depth."""
    columns, rows = camera.width_px // CELL_PX + 1, camera.height_px // CELL_PX + 1
    bins = int(np.log(FARTHEST_M / NEAREST_M) / np.log(DEPTH_RATIO)) + 1
    column, row = (u / CELL_PX).astype(np.intp), (v / CELL_PX).astype(np.intp)
    depth = (np.log(z / NEAREST_M) / np.log(DEPTH_RATIO)).astype(np.intp)
    voxels = np.zeros((bins, columns, rows), dtype=np.int32)
    inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    np.add.at(voxels, (depth[inside], column[inside], row[inside]), 1)
    occupied = np.count_nonzero(voxels >= per_cell, axis=2)
    _, labels = cv2.connectedComponents((occupied >= 2).astype(np.uint8), connectivity=8)
    large = np.bincount(labels.ravel(), weights=occupied.ravel()) >= MIN_VOXELS
    large[0] = False
    number: NDArray[np.int32] = np.where(inside, labels[depth, np.clip(column, 0, columns - 1)], 0)
    return np.where(large[number], number, 0).astype(np.int32)


def _members(cluster: NDArray[np.int32]) -> list[Indices]:
    """The points of each cluster."""
    return [np.flatnonzero(cluster == number) for number in np.unique(cluster) if number]


def _object(u: Floats, v: Floats, x: Floats, height: Floats) -> ImageBox | None:
    """The box of a cluster without its outermost points; None where it is too small to be an object."""
    ends = (TRIMMED_PERCENT, 100 - TRIMMED_PERCENT)
    (left, right), (top, bottom), (first, last), (low, high) = (np.percentile(of, ends) for of in (u, v, x, height))
    if high - low < MIN_HEIGHT_M or last - first < MIN_WIDTH_M:
        return None
    return ImageBox(float(left), float(top), float(right), float(bottom))
