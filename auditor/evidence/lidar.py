"""The LiDAR in a camera's view: Eq. 1 through full projection matrices."""

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.evidence.parameters import LIDAR_PROJECTION
from auditor.frames import PointCloud
from auditor.geometry import Matrix
from auditor.rig import Camera, Rig


@dataclass(frozen=True, eq=False)
class LidarView:
    """The LiDAR's points as reference camera k sees them, one a pixel, hidden ones dropped.

    `column` and `row` are (M,) integer pixels; `u_px` the (M,) exact column; `point_m` the (M, 3) points in the LiDAR
    frame; `returns` counts the points in view before any was dropped; `rig` is what they were projected by.
    """

    reference: int
    column: NDArray[np.int32]
    row: NDArray[np.int32]
    u_px: NDArray[np.float32]
    point_m: NDArray[np.float32]
    returns: int
    rig: Rig
    _disparities: dict[int, NDArray[np.float32]] = field(default_factory=dict, init=False, repr=False)

    def disparity_px(self, source: int) -> NDArray[np.float32]:
        """DM_{0,k} at a source camera: (M,) column in view k minus column in the source's view; not to be written to.

        Both columns come from full projection matrices: f b / z is off by up to a pixel where the cameras' optical
        centres differ in z. Every check of a frame asks for them, so they are kept.
        """
        if source not in self._disparities:
            u_source, _, _ = _project(_projection(self.rig, self.rig.camera(source)), self.point_m)
            self._disparities[source] = self.u_px - u_source
            self._disparities[source].setflags(write=False)
        return self._disparities[source]


def lidar_view(cloud: PointCloud, rig: Rig, reference: int) -> LidarView:
    """Project a cloud into camera `reference`, keep the nearest point of each pixel, drop what nearer ones hide."""
    camera = rig.camera(reference)
    P = _projection(rig, camera)
    points = cloud.xyz_m
    depth = points @ P[2, :3] + P[2, 3]
    points = points[depth > LIDAR_PROJECTION.nearest_m]
    u, v, depth = _project(P, points)
    column, row = np.rint(u).astype(np.int32), np.rint(v).astype(np.int32)
    in_view = (column >= 0) & (column < camera.width_px) & (row >= 0) & (row < camera.height_px)
    inside = np.flatnonzero(in_view)
    inside = inside[np.argsort(-depth[inside])]  # far to near: of several points in a pixel the last, nearest stays
    owner = np.full((camera.height_px, camera.width_px), -1, dtype=np.int32)
    owner[row[inside], column[inside]] = inside
    kept = owner[owner >= 0]
    kept = kept[_unhidden(camera, column[kept], row[kept], depth[kept])]
    return LidarView(reference, column[kept], row[kept], u[kept], points[kept], inside.size, rig)


def _unhidden(
    camera: Camera, column: NDArray[np.int32], row: NDArray[np.int32], depth: NDArray[np.float32]
) -> NDArray[np.bool_]:
    """(M,) mask of the points with no much nearer neighbour: the LiDAR sits above and looks over near edges."""
    disparity = np.float32(camera.focal_px * LIDAR_PROJECTION.baseline_m) / depth
    dense = np.zeros((camera.height_px, camera.width_px), dtype=np.float32)
    dense[row, column] = disparity
    nearest = cv2.dilate(dense, np.ones(LIDAR_PROJECTION.reference_window_px, dtype=np.uint8))
    return np.asarray(nearest[row, column] - disparity <= LIDAR_PROJECTION.nearer_by_px)


def _projection(rig: Rig, camera: Camera) -> NDArray[np.float32]:
    assert rig.lidar is not None
    P: Matrix = camera.projection @ rig.lidar.rig_SE3_lidar
    return P.astype(np.float32)


def _project(
    P: NDArray[np.float32], points: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Columns and rows in pixels, and depths in metres, of (N, 3) points."""
    u, v, depth = P[:, :3] @ points.T + P[:, 3:]
    return u / depth, v / depth, depth
