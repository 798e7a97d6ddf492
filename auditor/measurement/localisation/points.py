"""The damaged points of the LiDAR: those in conflict with two cameras, and their neighbours on the same surface."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.measurement.checks.lidar_conflict import VerifiedConflicts
from auditor.measurement.count_grid import CELL_PX
from auditor.measurement.disparity.lidar import LidarView
from auditor.model.arrays import Mask, Points
from auditor.model.measurement import Solid
from auditor.model.rig import Rig

_WINDOW = (7, 7)  # cells
_WINDOW_FEWEST = 30  # points
_WINDOW_SHARE = 0.4  # of a window's points, in conflict
_FEWEST = 15  # points of a layer
_LAYERS = 3  # at most
_LAYER_SHARE = 0.15  # of the points in conflict: fewer are no surface
_THINNEST_M = 0.08  # either way
_THICKEST_M = 0.25  # either way: a wall stands on a road (docs/decisions.md, regions)
_DEVIATIONS = 4  # median absolute ones, either way
_GAP = (3, 3)  # cells closed
_PART_SHARE = 0.2  # of the part with most points in conflict
_APART_M = 1.0  # side of a cell, seen from above: things in cells that do not touch are two


def damaged_points(view: LidarView, verified_conflicts: Sequence[VerifiedConflicts], rig: Rig) -> Mask:
    """(M,) mask of the view's points, from the verified conflicts of its pairs.

    Where points in conflict are dense they are split into layers of equal depth, and each layer grows over its
    connected points: behind parts of a wall the images have no texture, so points there cannot be in conflict.
    """
    camera = rig.camera(view.reference)
    shape = -(-camera.height_px // CELL_PX), -(-camera.width_px // CELL_PX)
    row, column = view.row // CELL_PX, view.column // CELL_PX
    conflicting = np.logical_or.reduce([of_pair.lidar_conflicts for of_pair in verified_conflicts])
    comparable = np.logical_or.reduce([of_pair.valid for of_pair in verified_conflicts])
    inconsistent, valid = (_window_sums(row[mask], column[mask], shape) for mask in (conflicting, comparable))
    dense = (valid >= _WINDOW_FEWEST) & (inconsistent >= _WINDOW_SHARE * valid)
    left = conflicting & dense[row, column]
    damaged = np.zeros(left.size, dtype=np.bool_)
    depth = _depth(view.point_m, rig)
    fewest = max(_FEWEST, _LAYER_SHARE * np.count_nonzero(left))
    for _ in range(_LAYERS):
        if np.count_nonzero(left) < fewest:
            break
        middle, thickness = _densest_layer(depth[left])
        layer = np.abs(depth - middle) <= thickness
        seeds = left & layer
        if np.count_nonzero(seeds) < fewest:
            break
        damaged |= _connected(layer, seeds, row, column, shape)
        left &= ~layer
    return damaged


def among(points: Points, others: Points) -> Mask:
    """(N,) mask of the (N, 3) points that are one of the (M, 3) others, to the last bit."""
    keys = {point.tobytes() for point in others}
    return np.array([point.tobytes() in keys for point in points], dtype=np.bool_)


def things(points: Points, rig: Rig) -> list[Points]:
    """The (N, 3) points of the LiDAR frame, those of each thing by themselves: things lie apart seen from above."""
    assert rig.lidar is not None
    cells = np.floor(points @ rig.lidar.rig_SE3_lidar[[0, 2], :3].T / _APART_M).astype(np.intp)
    column, row = (cells - cells.min(axis=0, initial=0)).T
    grid = np.zeros((row.max(initial=0) + 1, column.max(initial=0) + 1), dtype=np.uint8)
    grid[row, column] = 1
    count, numbers = cv2.connectedComponents(grid)
    return [points[numbers[row, column] == number] for number in range(1, count)]


def solid_around(points: Points, rig: Rig) -> Solid:
    """The smallest upright box around (N, 3) points of the LiDAR frame, N at least 1."""
    assert rig.lidar is not None
    rotation = rig.lidar.rig_SE3_lidar[:3, :3].astype(np.float32)
    right, down, forward = (points @ rotation.T).T
    (middle_right, middle_forward), (across, along), degrees = cv2.minAreaRect(np.stack([right, forward], axis=1))
    # Of the two ways to name the sides the one whose width faces the sensor most.
    if abs(degrees) > 45:
        across, along, degrees = along, across, degrees - 90
    centre = np.array([middle_right, (down.min() + down.max()) / 2, middle_forward]) @ rotation
    size = float(across), float(down.max() - down.min()), float(along)
    yaw_deg = (90 - degrees) % 180 - 90  # a box looks the same from behind
    return Solid((float(centre[0]), float(centre[1]), float(centre[2])), size, float(yaw_deg))


def _depth(points: Points, rig: Rig) -> Points:
    """(N,) metres straight ahead of the LiDAR."""
    assert rig.lidar is not None
    return np.asarray(points @ rig.lidar.rig_SE3_lidar[2, :3].astype(np.float32))


def _window_sums(row: NDArray[np.int32], column: NDArray[np.int32], shape: tuple[int, int]) -> cv2.typing.MatLike:
    """How many points lie in the window around each cell."""
    counts = np.bincount(row * shape[1] + column, minlength=shape[0] * shape[1]).reshape(shape)
    return cv2.boxFilter(
        counts.astype(np.float32), cv2.CV_32F, _WINDOW, normalize=False, borderType=cv2.BORDER_CONSTANT
    )


def _densest_layer(depth: Points) -> tuple[float, float]:
    """The middle of the depth at which most points lie, and how far from it they still belong to one surface."""
    ascending = np.sort(depth)
    ends = np.searchsorted(ascending, ascending + np.float32(2 * _THICKEST_M), side="right")
    first = int(np.argmax(ends - np.arange(ascending.size)))
    inside = ascending[first : ends[first]]
    middle = float(np.median(inside))
    spread = _DEVIATIONS * float(np.median(np.abs(inside - middle)))
    return middle, min(max(spread, _THINNEST_M), _THICKEST_M)


def _connected(
    layer: Mask, seeds: Mask, row: NDArray[np.int32], column: NDArray[np.int32], shape: tuple[int, int]
) -> Mask:
    """The points of a layer in those connected parts of it that hold most of the seeds."""
    grid = np.zeros(shape, dtype=np.uint8)
    grid[row[layer], column[layer]] = 1
    _, part = cv2.connectedComponents(cv2.morphologyEx(grid, cv2.MORPH_CLOSE, np.ones(_GAP, np.uint8)))
    counts = np.bincount(part[row[seeds], column[seeds]])
    kept = np.flatnonzero(counts >= _PART_SHARE * counts.max())
    return np.asarray(layer & np.isin(part[row, column], kept))
