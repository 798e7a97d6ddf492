"""A point cloud as two pictures: from above, and as a range image."""

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.measurement.localisation.points import among
from auditor.model.arrays import Image, Mask, Points
from auditor.model.optics.geometry import Matrix

_RED = (60, 60, 255)  # BGR
_GROUND, _LINES, _WORDS = (28, 24, 22), (80, 72, 66), (190, 185, 180)
_FONT, _FONT_SCALE = cv2.FONT_HERSHEY_SIMPLEX, 0.45

_ABOVE_PX = 900
_RING_M = 10.0
_REACHES_M = (10.0, 20.0, 40.0, 60.0, 80.0, 120.0)
_SHOWN_SHARE = 0.95
"""Of the points: the view from above reaches as far as the smallest of its reaches that holds so many of them."""
_HEIGHTS_M = (-3.0, 3.0)

_RANGE_PX = (1440, 256)
_NEAR_M, _FAR_M = 2.0, 80.0
_ELEVATIONS_SHARE = (0.001, 0.999)
_LEGEND_PX = 22


def seen_from_above(points: Points, damaged: Mask, rig_SE3_lidar: Matrix) -> Image:
    """(S, S, 3) BGR: the vehicle in the middle, ahead is up; colour is height, damaged points are red and larger.

    `points` (N, 3) are in the LiDAR's frame, `damaged` (N,) says which are; a ring is 10 m.
    """
    right, down, forward = _in_rig(points, rig_SE3_lidar)
    reach_m = _reach(np.hypot(right, forward))
    scale, middle = _ABOVE_PX / (2 * reach_m), _ABOVE_PX // 2
    drawn = np.full((_ABOVE_PX, _ABOVE_PX, 3), _GROUND, dtype=np.uint8)
    for ring in np.arange(_RING_M, reach_m * 1.42, _RING_M):
        cv2.circle(drawn, (middle, middle), round(ring * scale), _LINES, 1, cv2.LINE_AA)
    column, row = (np.floor(middle + sign * axis * scale).astype(np.intp) for sign, axis in ((1, right), (-1, forward)))
    inside = (column >= 0) & (column < _ABOVE_PX) & (row >= 0) & (row < _ABOVE_PX)
    drawn[row[inside], column[inside]] = _colours(-down, *_HEIGHTS_M)[inside]
    marked = inside & damaged
    for x, y in zip(column[marked].tolist(), row[marked].tolist(), strict=True):
        cv2.circle(drawn, (x, y), 2, _RED, -1)
    cv2.drawMarker(drawn, (middle, middle), _WORDS, cv2.MARKER_TRIANGLE_UP, 14, 2)
    words = f"from above, rings of {_RING_M:.0f} m, ahead is up; {_count(damaged)}"
    cv2.putText(drawn, words, (8, _ABOVE_PX - 10), _FONT, _FONT_SCALE, _WORDS, 1, cv2.LINE_AA)
    return drawn


def range_image(points: Points, damaged: Mask, rig_SE3_lidar: Matrix) -> Image:
    """(H, W, 3) BGR: columns are azimuths, rows elevations; colour is range, near is red, damaged points are white.

    Azimuths are those of the cloud, straight ahead in their middle where it looks all around.
    """
    width, height = _RANGE_PX
    drawn = np.full((height + _LEGEND_PX, width, 3), _GROUND, dtype=np.uint8)
    right, down, forward = _in_rig(points, rig_SE3_lidar)
    range_m = np.sqrt(right**2 + down**2 + forward**2)
    order = np.flatnonzero(range_m > 0)
    order = order[np.argsort(-range_m[order])]  # far to near: of several points in a pixel the nearest stays
    if len(order):
        azimuth = np.degrees(np.arctan2(right[order], forward[order]))
        elevation = np.degrees(np.arcsin(-down[order] / range_m[order]))
        lowest, highest = np.quantile(elevation, _ELEVATIONS_SHARE)
        column, row = (
            _placed(azimuth, azimuth.min(), azimuth.max(), width),
            _placed(-elevation, -highest, -lowest, height),
        )
        colours = _colours(-np.log(range_m[order]), -np.log(_FAR_M), -np.log(_NEAR_M))
        colours[damaged[order]] = (255, 255, 255)
        # Beams are sparser than rows: a point is three pixels high.
        for shift in (-1, 1, 0):
            drawn[np.clip(row + shift, 0, height - 1), column] = colours
        marked = damaged[order]
        for shift in (-1, 0, 1):
            drawn[np.clip(row[marked] + shift, 0, height - 1), column[marked]] = (255, 255, 255)
        words = (
            f"azimuth {azimuth.min():+.0f} to {azimuth.max():+.0f} deg, elevation {lowest:+.0f} to {highest:+.0f} deg; "
            f"red {_NEAR_M:.0f} m, blue {_FAR_M:.0f} m; {_count(damaged)} (white)"
        )
        cv2.putText(drawn, words, (8, height + 16), _FONT, _FONT_SCALE, _WORDS, 1, cv2.LINE_AA)
    return drawn


def _in_rig(points: Points, rig_SE3_lidar: Matrix) -> NDArray[np.float64]:
    """(3, N): right, down and forward of the rig's directions, around the LiDAR."""
    return np.asarray((points @ rig_SE3_lidar[:3, :3].T).T, dtype=np.float64)


def _reach(distance_m: NDArray[np.float64]) -> float:
    far = float(np.quantile(distance_m, _SHOWN_SHARE)) if len(distance_m) else 0.0
    return next((reach for reach in _REACHES_M if reach >= far), _REACHES_M[-1])


def _placed(values: NDArray[np.float64], low: float, high: float, size: int) -> NDArray[np.intp]:
    """Where values lie among `size` pixels from `low` to `high`; those outside at the border."""
    share = (values - low) / max(high - low, 1e-9)
    return np.clip(np.floor(share * size), 0, size - 1).astype(np.intp)


def _colours(values: NDArray[np.float64], low: float, high: float) -> Image:
    """(N, 3) BGR of values from `low`, blue, to `high`, red."""
    if not len(values):
        return np.zeros((0, 3), dtype=np.uint8)
    levels = np.clip(255 * (values - low) / (high - low), 0, 255).astype(np.uint8)
    return np.asarray(cv2.applyColorMap(levels.reshape(-1, 1), cv2.COLORMAP_TURBO).reshape(-1, 3), dtype=np.uint8)


def _count(damaged: Mask) -> str:
    points = int(np.count_nonzero(damaged))
    return f"{points} damaged point{'' if points == 1 else 's'}"


_WIDTH_PX = 640
_JPEG_QUALITY = 80


def small_jpeg(pixels: Image) -> bytes:
    """An image (H, W) or (H, W, 3) BGR as a JPEG, at most 640 px wide."""
    height, width = pixels.shape[:2]
    if width > _WIDTH_PX:
        size = _WIDTH_PX, max(1, round(height * _WIDTH_PX / width))
        pixels = np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    _, data = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    return data.tobytes()


def changed_cloud(before: Points, after: Points, rig_SE3_lidar: Matrix) -> Image:
    """(S, S, 3) BGR: both clouds from above; points that are in one of them alone are red."""
    removed = before[~among(before, after)]
    changed = np.concatenate([~among(after, before), np.ones(len(removed), dtype=np.bool_)])
    return seen_from_above(np.concatenate([after, removed]), changed, rig_SE3_lidar)
