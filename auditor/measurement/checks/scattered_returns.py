"""Returns that scatter along their beams: in dust, steam and exhaust neighbouring beams end at any depth.

A surface, real or bogus, has the range between those of a point's neighbours. What came from nowhere and scatters may
be an aerosol, or a ghost whose points were made to scatter: nothing tells the two apart.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from auditor.measurement.disparity.lidar import lidar_view
from auditor.model.arrays import Floats32, Indices, Mask, Points
from auditor.model.frames import PointCloud
from auditor.model.parameters import BY_HAND, parameter
from auditor.model.rig import Rig

_PLUMES = "dust, exhaust, walls and ghosts in KITTI drives 0009, 0001 and 04 (docs/decisions.md)"


@dataclass(frozen=True)
class ScatteredReturns:
    """How far neighbouring returns of a thing scatter along their beams."""

    neighbours: int = parameter(9, unit="points that a plane is fitted to, with the one that is asked", source=_PLUMES)
    least_m: float = parameter(0.06, unit="m off these planes, the median: else a surface", source=_PLUMES)
    apart_m: float = parameter(0.5, unit="m, side of the cells from above that hold one thing together", source=BY_HAND)
    half_points: float = parameter(40.0, unit="points at which the statistic is a half", source=BY_HAND)
    most_points: int = parameter(64, unit="points of a thing that are asked", source="bounds the work; by hand")


NUMBERS = ScatteredReturns()

_OF_A_PLANE = 3
"""Points that any plane goes through."""


def scatter(place: Floats32) -> float:
    """By how much points (3, N) are off planes through their neighbours: the median, as a logarithm of their range.

    They are to the right and down, in radians, and the logarithm of the range. 0 of too few points.
    """
    if place.shape[1] <= _OF_A_PLANE:
        return 0.0
    asked = place[:, :: -(-place.shape[1] // NUMBERS.most_points)]
    near = min(NUMBERS.neighbours, place.shape[1])
    away = (asked[0, :, None] - place[0]) ** 2 + (asked[1, :, None] - place[1]) ** 2
    around = place[:, np.argpartition(away, near - 1, axis=1)[:, :near]].astype(np.float64)
    right, down, far = around - around.mean(axis=2, keepdims=True)
    rr, rd, dd = (right * right).sum(axis=1), (right * down).sum(axis=1), (down * down).sum(axis=1)
    rf, df, ff = (right * far).sum(axis=1), (down * far).sum(axis=1), (far * far).sum(axis=1)
    spread = rr * dd - rd * rd
    of_plane = (dd * rf * rf - 2 * rd * rf * df + rr * df * df) / np.where(spread > 0, spread, np.inf)
    # Points of one beam lie on a line, through which any plane goes.
    explained = np.where(spread > 0, of_plane, rf * rf / np.where(rr > 0, rr, np.inf))
    return float(np.median(np.sqrt(np.maximum(ff - explained, 0) / near)))


def scattered(points: Points, rig: Rig) -> Mask:
    """(K,) which of some points (K, 3) belong to things that scatter along their beams."""
    scatters = np.zeros(len(points), dtype=np.bool_)
    if not len(points):
        return scatters
    assert rig.lidar is not None
    right, down, ahead = rig.lidar.rig_SE3_lidar[:3, :3].astype(np.float32) @ points.T
    level = np.hypot(right, ahead)
    range_m = np.hypot(level, down)
    place = np.stack([np.arctan2(right, ahead), np.arctan2(down, level), np.log(range_m)])
    thing = _things(np.stack([ahead, right]))
    for number in range(1, int(thing.max()) + 1):
        own = thing == number
        scatters[own] = scatter(place[:, own]) * np.median(range_m[own]) > NUMBERS.least_m
    return scatters


def measure_scattered_returns(from_nowhere: Points, rig: Rig, *view: int) -> float:
    """The statistic, 0 to 1, of those of the points (K, 3) that scatter and lie in a view."""
    return statistic_in_view(from_nowhere[scattered(from_nowhere, rig)], rig, *view)


def statistic_in_view(points: Points, rig: Rig, *view: int) -> float:
    """The statistic n / (n + half_points) of the n points (K, 3) in the view of a camera, or of all without one."""
    if not len(points):
        return 0.0
    seen = lidar_view(PointCloud(0, points), rig, *view).returns if view else len(points)
    return seen / (seen + NUMBERS.half_points)


def _things(from_above_m: Floats32) -> Indices:
    """(K,) the number, from 1 on, of the thing that each point (2, K) belongs to: of touching cells."""
    cell = np.floor(from_above_m / NUMBERS.apart_m).astype(np.intp)
    row, column = cell - cell.min(axis=1, keepdims=True)
    grid = np.zeros((row.max() + 1, column.max() + 1), dtype=np.uint8)
    grid[row, column] = 1
    numbers = np.asarray(cv2.connectedComponents(grid)[1], dtype=np.intp)
    return np.asarray(numbers[row, column])
