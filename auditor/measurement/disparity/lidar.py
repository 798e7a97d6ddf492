"""The LiDAR in a camera's view: Eq. 1 through full projection matrices; what a source camera sees; the range mask."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.measurement.parameters import COUNT_GRID, HALF, LIDAR_PROJECTION, MATCHER_RANGE
from auditor.measurement.point_parameters import LOST_RETURNS
from auditor.model.arrays import Floats32, Indices, Mask, Points
from auditor.model.frames import PointCloud
from auditor.model.optics.geometry import Matrix
from auditor.model.rig import Camera, Rig

_REACH_STEP = 7  # points, of which one tells how near and far a cloud reaches: it bounds the work


@dataclass(frozen=True, eq=False)
class LidarView:
    """The LiDAR's points as reference camera k sees them, one a pixel, occluded ones dropped.

    `column` and `row` are (M,) integer pixels; `u_px` the (M,) exact column; `point_m` the (M, 3) points in the LiDAR
    frame; `returns` counts the points in view before any was dropped, and `in_view_m` (returns, 3) are these; `span_px`
    are the leftmost and rightmost columns that the LiDAR's field reaches, in the image or beyond it; `looks_ahead` is
    whether it has hardly a point behind the camera, as one whose field ends there; `rig` is what the points were
    projected by; `cloud_m` (N, 3) are all points, those that the camera does not see as well.
    """

    reference: int
    column: NDArray[np.int32]
    row: NDArray[np.int32]
    u_px: Floats32
    point_m: Points
    returns: int
    rig: Rig
    in_view_m: Points
    span_px: tuple[float, float]
    looks_ahead: bool
    cloud_m: Points
    _disparities: dict[int, Floats32] = field(default_factory=dict, init=False, repr=False)
    _places: dict[tuple[int, int], Indices] = field(default_factory=dict, init=False, repr=False)

    def place(self, step: int, width: int) -> Indices:
        """(M,) the points' pixels, row by row, in an image of that width whose pixels are `step` of these wide."""
        if (step, width) not in self._places:
            self._places[step, width] = (self.row // step * width + self.column // step).astype(np.intp)
        return self._places[step, width]

    @cached_property
    def range_m(self) -> Floats32:
        """(M,) how far the points are from the LiDAR."""
        squares = self.point_m * self.point_m
        return np.asarray(np.sqrt(squares[:, 0] + squares[:, 1] + squares[:, 2]))

    @cached_property
    def below_m(self) -> Floats32:
        """(M,) how far the points are below the LiDAR, by the rig's axes."""
        assert self.rig.lidar is not None
        return np.asarray(self.point_m @ self.rig.lidar.rig_SE3_lidar[1, :3].astype(np.float32))

    @cached_property
    def reach_m(self) -> tuple[float, float]:
        """How near and how far the points of the cloud are, but for a few of them, wherever they lie."""
        some = self.cloud_m[::_REACH_STEP]
        return bulk_of(np.asarray(np.sqrt(np.einsum("nc,nc->n", some, some))))

    @cached_property
    def rounding_m(self) -> float:
        """What the coordinates of its points were rounded to."""
        return rounding_step_m(self.point_m)

    @cached_property
    def in_rig_axes_m(self) -> Points:
        """(3, returns) the points in view by the rig's axes, to the right, down and ahead, from the LiDAR."""
        assert self.rig.lidar is not None
        return np.asarray(self.rig.lidar.rig_SE3_lidar[:3, :3].astype(np.float32) @ self.in_view_m.T)

    @cached_property
    def directions(self) -> tuple[Indices, Indices, Mask]:
        """Row and column of the points (M,) by their direction from the LiDAR in the rig's axes, and which have any.

        So all pairs have counts at the same places. Directions beyond the grid are left out.
        """
        assert self.rig.lidar is not None
        x, y, z = self.rig.lidar.rig_SE3_lidar[:3, :3].astype(np.float32) @ self.point_m.T
        rows, columns = COUNT_GRID.lidar_cells
        row, column = (
            np.floor(angle / COUNT_GRID.lidar_cell).astype(np.intp) + count // 2
            for angle, count in ((np.arctan2(y, np.hypot(x, z)), rows), (np.arctan2(x, z), columns))
        )
        return row, column, (row >= 0) & (row < rows) & (column >= 0) & (column < columns)

    @cached_property
    def level_m(self) -> Floats32:
        """(returns,) how far the points in view are from the LiDAR without what is down."""
        x, _, z = self.in_rig_axes_m
        return np.asarray(np.hypot(x, z))

    @cached_property
    def road_m(self) -> float:
        """How far the road is below the LiDAR: the median of what lies steeply below; without any no road is known.

        There most of what returns is the road.
        """
        y = self.in_rig_axes_m[1]
        below = y[y > LOST_RETURNS.steeply * self.level_m]
        return float(np.median(below)) if below.size else np.inf

    def disparity_px(self, source: int) -> Floats32:
        """DM_{0,k} at a source camera: (M,) column in view k minus column in the source's view; not to be written to.

        Both columns come from full projection matrices: f b / z is off by up to a pixel where the cameras' optical
        centres differ in z. Every check of a frame needs them, so they are kept.
        """
        if source not in self._disparities:
            u_source, _, _ = _project(_projection(self.rig, self.rig.camera(source)), self.point_m)
            self._disparities[source] = self.u_px - u_source
            self._disparities[source].setflags(write=False)
        return self._disparities[source]


def lidar_view(cloud: PointCloud, rig: Rig, reference: int) -> LidarView:
    """Project a cloud into camera `reference`, keep the nearest point of each pixel, drop occluded points."""
    camera = rig.camera(reference)
    P = _projection(rig, camera)
    every = points = cloud.xyz_m
    depth = points @ P[2, :3] + P[2, 3]
    looks_ahead = int(np.count_nonzero(depth < 0)) <= LIDAR_PROJECTION.beside_span * len(points)
    points = points.take(np.flatnonzero(depth > LIDAR_PROJECTION.nearest_m), axis=0)
    u, v, depth = _project(P, points)
    column, row = np.rint(u).astype(np.int32), np.rint(v).astype(np.int32)
    in_view = (column >= 0) & (column < camera.width_px) & (row >= 0) & (row < camera.height_px)
    inside = np.flatnonzero(in_view)
    in_view_m = points.take(inside, axis=0)
    kept = _nearest(camera, column[inside], row[inside], depth[inside], inside)
    kept = kept[_not_occluded(camera, column[kept], row[kept], depth[kept])]
    point_m, span = points.take(kept, axis=0), bulk_of(u)
    return LidarView(
        reference, column[kept], row[kept], u[kept], point_m, inside.size, rig, in_view_m, span, looks_ahead, every
    )


def _nearest(
    camera: Camera, column: NDArray[np.int32], row: NDArray[np.int32], depth: Floats32, points: Indices
) -> Indices:
    """Of (M,) points in view the nearest of each pixel, pixel by pixel, row by row."""
    pixel = row * camera.width_px + column
    least = np.full(camera.height_px * camera.width_px, np.inf, dtype=np.float32)
    np.minimum.at(least, pixel, depth)
    chosen = np.flatnonzero(depth == least.take(pixel))
    taken = np.sort(pixel[chosen])
    if (taken[1:] == taken[:-1]).any():  # several of a pixel are equally near: the last of all from far to near stays
        chosen, taken = np.argsort(-depth), np.unique(taken)
    owner = least.view(np.int32)  # the same memory again: new one would have to be cleared
    owner[pixel[chosen]] = chosen
    return points.take(owner.take(taken))


def rounding_step_m(point_m: Points) -> float:
    """What the coordinates (M, 3) were rounded to: the least step between two values of one; 0 where there is none.

    It is a millimetre or less where they were not rounded, for a scan has thousands of points.
    """
    steps = np.diff(np.sort(point_m.T.copy()))
    least = float(np.where(steps > 0, steps, np.inf).min(initial=np.inf))
    return least if least < np.inf else 0.0


def bulk_of(values: Floats32) -> tuple[float, float]:
    """The least and the largest of some values of points (M,), but for a few of them; 0 without any."""
    if not values.size:
        return 0.0, 0.0
    few = int(LIDAR_PROJECTION.beside_span * values.size)
    # One at a time: NumPy takes several times as long for both.
    first, last = (float(np.partition(values, place)[place]) for place in (few, values.size - 1 - few))
    return first, last


def _not_occluded(camera: Camera, column: NDArray[np.int32], row: NDArray[np.int32], depth: Floats32) -> Mask:
    """(M,) mask of the points with no much nearer neighbour: the LiDAR sits above and looks over near edges."""
    if not row.size:
        return np.zeros(0, dtype=np.bool_)
    disparity = np.float32(camera.focal_px * LIDAR_PROJECTION.baseline_m) / depth
    top, bottom = int(row.min()), int(row.max())  # above them there is nothing
    pixel = (row - top) * camera.width_px + column
    dense = np.zeros((bottom + 1 - top, camera.width_px), dtype=np.float32)
    dense.ravel()[pixel] = disparity
    nearest = np.asarray(cv2.dilate(dense, np.ones(LIDAR_PROJECTION.reference_window_px, dtype=np.uint8)))
    return np.asarray(nearest.take(pixel) - disparity <= LIDAR_PROJECTION.nearer_by_px)


def _projection(rig: Rig, camera: Camera) -> Floats32:
    assert rig.lidar is not None
    P: Matrix = camera.projection @ rig.lidar.rig_SE3_lidar
    return P.astype(np.float32)


def _project(P: Floats32, points: Floats32) -> tuple[Floats32, Floats32, Floats32]:
    """Columns and rows in pixels, and depths in metres, of (N, 3) points."""
    u, v, depth = P[:, :3] @ points.T + P[:, 3:]
    return u / depth, v / depth, depth


def visible_to_source(view: LidarView, rig: Rig, source: int, d0_px: Floats32) -> Mask:
    """(M,) mask of the points of a view that no much nearer point occludes from a source camera.

    `d0_px` is DM_{0,k} at that source. A point is occluded where another, within 7 x 3 half-resolution pixels of the
    source image, is nearer by more than 3 px at a baseline of 0.6 m. Points outside the source image are not visible.
    """
    # The z-buffer of the source camera is kept at half resolution.
    camera = rig.camera(source)
    scale = np.float32(LIDAR_PROJECTION.baseline_m / rig.baseline_m(source, view.reference))
    height, width = -(-camera.height_px // HALF), -(-camera.width_px // HALF)
    # Rectified images share their rows, so the point's row in the reference is its row in the source as well.
    row = np.minimum(view.row // HALF, height - 1)
    column = np.rint((view.u_px - d0_px) / HALF).astype(np.intp)
    inside = (column >= 0) & (column < width)
    column = np.clip(column, 0, width - 1)
    nearness = np.where(inside, d0_px * scale, 0).astype(np.float32)
    place = row * width + column
    nearest = np.zeros((height, width), dtype=np.float32)
    np.maximum.at(nearest.ravel(), place, nearness)
    nearest = np.asarray(
        cv2.dilate(nearest, np.ones(LIDAR_PROJECTION.source_window_px, dtype=np.uint8)), dtype=np.float32
    )
    return np.asarray(inside & (nearest.take(place) - nearness <= LIDAR_PROJECTION.nearer_by_px))


class RangeMask(NamedTuple):
    """Points of disparities above `limit_px` are masked, with what they occlude: up to `hides_px` to their left."""

    limit_px: float
    hides_px: int


def out_of_range(view: LidarView, isolated: Mask, source: int, range_mask: RangeMask, shape: tuple[int, int]) -> Mask:
    """(h, w) half-resolution mask of where the LiDAR sees something nearer than the range mask's limit.

    16 px around it are masked, and what it can occlude from the source. `isolated` points (M,) occlude nothing: in
    light rain a few dozen drops would mask most of the view.
    """
    near = view.disparity_px(source) > range_mask.limit_px
    near &= ~isolated
    mask = np.zeros(shape, dtype=np.uint8)
    if near.any():
        row, column = view.row[near] // HALF, view.column[near] // HALF
        mask[row, column] = 1
        mask = np.asarray(cv2.dilate(mask, np.ones(MATCHER_RANGE.around_px, dtype=np.uint8)), dtype=np.uint8)
        leftward = np.ones((1, range_mask.hides_px // HALF), dtype=np.uint8)
        mask = np.asarray(cv2.dilate(mask, leftward, anchor=(0, 0)), dtype=np.uint8)
    return mask.astype(np.bool_)
