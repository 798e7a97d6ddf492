"""Which rays may meet a piece: the part of their grid that its corners span."""

import numpy as np
from numpy.typing import NDArray

from auditor.lab.simulation.rays import Rays
from auditor.lab.simulation.surfaces import Surfaces
from auditor.model.arrays import Floats32, Mask

_NEAR_M = 0.2
_SLACK_M = 0.02  # that rounding may add to a piece
_CAMERA_MARGIN = 2
_LIDAR_MARGIN = 24  # columns: its beams do not start from one place


def windows(rays: Rays, surfaces: Surfaces) -> tuple[Floats32, NDArray[np.int32]]:
    """The nearest depth of each piece, (N,) metres, and the part of the grid in which it may lie.

    The latter is (N, 4): first row, one past the last, first column, one past the last.
    """
    start = np.array([float(np.mean(axis)) for axis in rays.origin], dtype=np.float32)
    a = surfaces.corner - start
    b, c = a + surfaces.across, a + surfaces.up
    corners = np.stack([a, b, b + surfaces.up, c], axis=1)
    following = np.roll(corners, -1, axis=1)
    # Where an edge passes through the plane just ahead of the sensor, that point bounds the visible part of the piece.
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (_NEAR_M - corners[:, :, 2]) / (following[:, :, 2] - corners[:, :, 2])
    crosses = (share > 0) & (share < 1)
    crossing = corners + np.where(crosses, share, 0)[:, :, None] * (following - corners)
    crossing[:, :, 2] = np.where(crosses, _NEAR_M, -1)
    points = np.concatenate([corners, crossing], axis=1)
    ahead = points[:, :, 2] >= _NEAR_M
    nearest = np.where(ahead, points[:, :, 2], np.inf).min(axis=1)
    depth = np.where(ahead, points[:, :, 2], 1)
    x, y = points[:, :, 0], points[:, :, 1]
    if rays.focal_px is None:
        azimuth = np.arctan2(x, depth)
        left, right = _range((azimuth - rays.first_azimuth) / rays.pixel, ahead, _LIDAR_MARGIN, rays.shape[1])
        return nearest, np.stack([*_beams(rays, corners), left, right], axis=1)
    if rays.principal_px is None:
        columns = _bent_range(x / depth, ahead, rays.x.min(axis=0), rays.x.max(axis=0))
        rows = _bent_range(y / depth, ahead, rays.y.min(axis=1), rays.y.max(axis=1))
        return nearest, np.stack([*rows, *columns], axis=1)
    u0, v0 = rays.principal_px
    left, right = _range(x / depth * rays.focal_px + u0, ahead, _CAMERA_MARGIN, rays.shape[1])
    top, bottom = _range(y / depth * rays.focal_px + v0, ahead, _CAMERA_MARGIN, rays.shape[0])
    return nearest, np.stack([top, bottom, left, right], axis=1)


def spread_m(rays: Rays) -> float:
    """How far apart the places may be from which rays start, metres."""
    return sum(float(np.ptp(axis)) for axis in rays.origin)


def _beams(rays: Rays, corners: Floats32) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """First and one past the last row of a LiDAR whose beams may meet each piece; (N, 4, 3) corners from its middle.

    The edges of a piece are bent in elevation: what bounds it are its heights, and how near and far it may be.
    """
    moved = spread_m(rays)
    low, high = corners.min(axis=1) - _SLACK_M, corners.max(axis=1) + _SLACK_M
    beside = np.maximum(np.maximum(low, -high), 0)[:, [0, 2]]
    near = np.maximum(np.hypot(*beside.T) - moved, _SLACK_M)
    far = np.hypot(corners[:, :, 0], corners[:, :, 2]).max(axis=1) + _SLACK_M + moved
    top, bottom = low[:, 1], high[:, 1]
    slopes = np.stack([top / np.where(top < 0, near, far), bottom / np.where(bottom > 0, near, far)], axis=1)
    of_rays = rays.y / np.hypot(rays.x, rays.z)
    first, last = _bent_range(slopes, np.True_, of_rays.min(axis=1), of_rays.max(axis=1))
    # One row at least: pieces that are equally near are met in an order that depends on how many there are.
    first = np.minimum(first, rays.shape[0] - 1)
    return first, np.maximum(last, first + 1)


def _bent_range(
    places: NDArray[np.floating], ahead: Mask | np.bool_, least: Floats32, most: Floats32
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """As `_range`, for columns (or rows) whose rays reach from `least` to `most`, both rising but for their noise."""
    low, high = np.where(ahead, places, np.inf).min(axis=1), np.where(ahead, places, -np.inf).max(axis=1)
    first = np.searchsorted(np.maximum.accumulate(most), low)
    last = np.searchsorted(np.minimum.accumulate(least[::-1])[::-1], high, side="right")
    return first.astype(np.int32), np.maximum(first, last).astype(np.int32)


def _range(
    places: NDArray[np.floating], ahead: Mask, margin: int, size: int
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """First and one past the last row (or column) that lies within the grid."""
    low = np.where(ahead, places, np.inf).min(axis=1)
    high = np.where(ahead, places, -np.inf).max(axis=1)
    first = np.clip(np.nan_to_num(np.floor(low)) - margin, 0, size)
    last = np.clip(np.nan_to_num(np.ceil(high)) + margin + 1, 0, size)
    return first.astype(np.int32), last.astype(np.int32)
