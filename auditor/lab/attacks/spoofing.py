"""Attacks on the LiDAR by light beyond the paper's wall: ghost cars, objects that vanish, noise or a delay in a sector.

A spoofer sees a LiDAR's pulses and answers with its own. What it takes, and which LiDARs let it, is in docs/attacks.md.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from auditor.lab.attacks.faults import azimuth, lidar_axes
from auditor.lab.attacks.kinds import AttackDraw, LidarKind, Option, uniform
from auditor.lab.attacks.paper import BogusWall, DescribedEffect, road_below_m
from auditor.model.arrays import Mask, Points
from auditor.model.frames import PointCloud
from auditor.model.rig import Rig

_HALF_WIDTH_M, _HALF_DEPTH_M = 1.1, 2.3  # of a box around a car
_BESIDE_M = 0.5
_STEP_M = 0.4
_AROUND_RANGE_M = 1.6
_HEIGHTS_M = (0.1, 2.0)  # above the road, of what is removed
_ABOVE_ROAD_M = 0.25
_ROOF_M = (1.1, 1.9)
_WIDEST = 0.6  # tangent of the azimuth, at which a car is still in most cameras' view
_MOST_BESIDE, _MOST_ABOVE, _MOST_NEARER, _MOST_BEHIND = 0.25, 0.05, 0.1, 0.3  # of the car's own points
_FEWEST = 60
_LEAST_WIDTH_M, _LEAST_HEIGHT_M = 1.4, 1.0
_NEAREST_M = 1.0


_GHOST_WIDTH_M = 1.8


class Spot(NamedTuple):
    """Where a car-sized box stands: its middle to the right of and ahead of the LiDAR, and whether it holds a car."""

    right_m: float
    ahead_m: float
    is_car: bool


@dataclass(frozen=True)
class RemovedObject(DescribedEffect):
    """What stands `range_m` ahead vanishes: the points of the car-sized box there that most looks like a car are gone.

    Physical removal (Cao et al., USENIX Security 2023): relayed pulses arrive before the echo, nearer than the LiDAR's
    least range, so that it drops them, and the echo with them. With `returned_at_m` the beams return from there
    instead, as from a wall behind the object.
    """

    range_m: float
    returned_at_m: float | None = None

    name = "removed object"

    def apply(self, cloud: PointCloud, rig: Rig) -> PointCloud:
        """The cloud without the object. Raises SettingError for a rig without a LiDAR."""
        points = cloud.xyz_m @ lidar_axes(rig).T
        gone = _in_box(points, find_object(points, self.range_m))
        if self.returned_at_m is None:
            return PointCloud(cloud.stamp_ns, cloud.xyz_m[~gone])
        scale = np.where(gone, np.float32(self.returned_at_m) / np.linalg.norm(points, axis=1), np.float32(1))
        return PointCloud(cloud.stamp_ns, np.asarray(cloud.xyz_m * scale[:, None], dtype=np.float32))


@dataclass(frozen=True)
class RandomRanges(DescribedEffect):
    """Beams of a sector see noise: a share `lost` returns nothing, the others random ranges up to `farthest_m`.

    Strong light saturates the receiver (Shin et al., CHES 2017), or pulses at a higher frequency than the LiDAR's come
    at no fixed time (Sato et al., NDSS 2024). The sector is `width_deg` wide, its middle `azimuth_deg` to the right.
    """

    width_deg: float
    azimuth_deg: float
    lost: float
    farthest_m: float
    seed: int = 0

    name = "random ranges"

    def apply(self, cloud: PointCloud, rig: Rig) -> PointCloud:
        """The cloud with the sector's points lost or moved along their beams. Raises SettingError without a LiDAR."""
        inside = _in_sector(cloud, rig, self.azimuth_deg, self.width_deg)
        rng = np.random.default_rng([self.seed, cloud.stamp_ns])
        distance = np.linalg.norm(cloud.xyz_m, axis=1)
        seen = rng.uniform(_NEAREST_M, self.farthest_m, distance.size) / np.maximum(distance, _NEAREST_M)
        kept = ~inside | (rng.random(distance.size) >= self.lost)
        moved = cloud.xyz_m * np.where(inside, seen, 1.0)[:, None]
        return PointCloud(cloud.stamp_ns, np.asarray(moved[kept], dtype=np.float32))


@dataclass(frozen=True)
class GhostCar(DescribedEffect):
    """The back of a car that is not there: `points` spoofed returns, `range_m` ahead and `lateral_m` to the right.

    A detector takes 60 points at 8 m for a car (Cao et al., CCS 2019), or 200, as many as a spoofer placed (Sun et al.,
    USENIX Security 2020). They replace the returns of as many beams of those that meet the back, which stands on the
    road; the others return from behind it as before, so that it has no shadow.
    """

    points: int
    range_m: float
    lateral_m: float = 0.0
    seed: int = 0

    name = "ghost car"

    def apply(self, cloud: PointCloud, rig: Rig) -> PointCloud:
        """The cloud with the car in it; its points keep their order, added ones come last.

        Raises SettingError for a rig without a LiDAR.
        """
        back = BogusWall(self.range_m, self.lateral_m, width_m=_GHOST_WIDTH_M, seed=self.seed).apply(cloud, rig).xyz_m
        xyz = np.concatenate([cloud.xyz_m, back[len(cloud.xyz_m) :]])
        shown = np.arange(len(xyz)) < len(cloud.xyz_m)
        on_back = np.flatnonzero(~shown | (xyz != back).any(axis=1))
        rng = np.random.default_rng([self.seed, cloud.stamp_ns])
        spoofed = rng.choice(on_back, min(self.points, on_back.size), replace=False)
        xyz[spoofed], shown[spoofed] = back[spoofed], True
        return PointCloud(cloud.stamp_ns, xyz[shown])


@dataclass(frozen=True)
class ChangedRanges(DescribedEffect):
    """All returns of a sector come `shift_m` farther away, nearer where it is negative, and with noise of `noise_m`.

    A relay delays each echo by the same, or by a time that jitters: 0.3 m are 2 ns. The noise is normal, `noise_m` its
    standard deviation. The sector is `width_deg` wide, its middle `azimuth_deg` to the right.
    """

    width_deg: float
    azimuth_deg: float
    shift_m: float = 0.0
    noise_m: float = 0.0
    seed: int = 0

    name = "changed ranges"

    def apply(self, cloud: PointCloud, rig: Rig) -> PointCloud:
        """The cloud with the sector's points moved along their beams. Raises SettingError without a LiDAR."""
        rng = np.random.default_rng([self.seed, cloud.stamp_ns])
        distance = np.maximum(np.linalg.norm(cloud.xyz_m, axis=1), _NEAREST_M)
        seen = np.maximum(distance + self.shift_m + self.noise_m * rng.standard_normal(distance.size), _NEAREST_M)
        inside = _in_sector(cloud, rig, self.azimuth_deg, self.width_deg)
        moved = cloud.xyz_m * np.where(inside, seen / distance, 1.0)[:, None]
        return PointCloud(cloud.stamp_ns, np.asarray(moved, dtype=np.float32))


def _in_sector(cloud: PointCloud, rig: Rig, azimuth_deg: float, width_deg: float) -> Mask:
    """(N,) mask of the points of a sector."""
    right, _, forward = (cloud.xyz_m @ lidar_axes(rig).T).T
    return np.asarray(np.abs(np.rad2deg(np.arctan2(right, forward)) - azimuth_deg) <= width_deg / 2)


def find_object(points: Points, range_m: float) -> Spot:
    """The car-sized box about `range_m` ahead that holds the most points and looks like a car, else just the most.

    `points` are (N, 3) right, down, forward of the LiDAR. A car stands free, is as high as one, is not hidden, and
    nothing shows through it.
    """
    height = road_below_m(points) - points[:, 1]
    ahead = np.arange(range_m - _AROUND_RANGE_M, range_m + _AROUND_RANGE_M + _STEP_M / 2, 2 * _STEP_M)
    near = np.abs(points[:, 2] - range_m) < _AROUND_RANGE_M + _HALF_DEPTH_M + _BESIDE_M
    around, above = points[near], height[near]
    best, most = Spot(0.0, range_m, is_car=False), (False, 0)
    for z in ahead.tolist():
        for x in np.arange(-z * _WIDEST, z * _WIDEST, _STEP_M).tolist():
            count, free = _stands_free(around, above, x, z)
            if (free, count) > most and (not free or _looks_like_car(points, height, x, z)):
                best, most = Spot(x, z, free), (free, count)
    return best


def _in_box(points: Points, spot: Spot) -> Mask:
    """(N,) mask of the points above the road in the car-sized box at a spot."""
    height = road_below_m(points) - points[:, 1]
    inside: Mask = (np.abs(points[:, 0] - spot.right_m) < _HALF_WIDTH_M) & (
        np.abs(points[:, 2] - spot.ahead_m) < _HALF_DEPTH_M
    )
    return inside & (height > _HEIGHTS_M[0]) & (height < _HEIGHTS_M[1])


def _stands_free(points: Points, height: Points, x: float, z: float) -> tuple[int, bool]:
    """How many points the box at a place holds, and whether it is as high as a car and nothing stands beside it."""
    beside_x, beside_z = np.abs(points[:, 0] - x), np.abs(points[:, 2] - z)
    inside = (beside_x < _HALF_WIDTH_M) & (beside_z < _HALF_DEPTH_M)
    within = height[inside]
    body = within[(within > _ABOVE_ROAD_M) & (within < _HEIGHTS_M[1])]
    if body.size < _FEWEST or np.count_nonzero(within > _HEIGHTS_M[1]) > _MOST_ABOVE * body.size:
        return body.size, False
    around = (beside_x < _HALF_WIDTH_M + _BESIDE_M) & (beside_z < _HALF_DEPTH_M + _BESIDE_M) & ~inside
    beside = np.count_nonzero((height[around] > _ABOVE_ROAD_M) & (height[around] < _HEIGHTS_M[1]))
    roof_m = float(np.quantile(body, 0.95))
    return body.size, _ROOF_M[0] < roof_m < _ROOF_M[1] and beside <= _MOST_BESIDE * body.size


def _looks_like_car(points: Points, height: Points, x: float, z: float) -> bool:
    """Whether the box at a place is as wide and high as a car, is not hidden, and nothing shows through it."""
    body = _in_box(points, Spot(x, z, is_car=True))
    if np.ptp(points[body, 0]) < _LEAST_WIDTH_M or np.ptp(height[body]) < _LEAST_HEIGHT_M:
        return False
    ahead = points[:, 2] > _NEAREST_M
    direction = points[:, :2] / np.where(ahead, points[:, 2], np.float32(np.inf))[:, None]
    low, high = np.quantile(direction[body], (0.03, 0.97), axis=0)
    through = ahead & ~body & ((direction > low) & (direction < high)).all(axis=1)
    nearer = np.count_nonzero(through & (points[:, 2] < z - _HALF_DEPTH_M))
    behind = np.count_nonzero(through & (points[:, 2] > z + _HALF_DEPTH_M))
    count = np.count_nonzero(body)
    return bool(nearer < _MOST_NEARER * count and behind < _MOST_BEHIND * count)


_BEHIND_M = 60.0
_SATURATED_LOST, _NOISE_M = 0.7, 100.0
_GHOST_M = 8.0
_LATERALS_M = (-3.0, 3.0)
_JITTERY_DEG, _SHIFTED_DEG = 10.0, 20.0
_PULSES_M = 150.0  # a pulse each microsecond
_AWAY = "range of the object, m"
_RANGE = Option("range", "range_m", f"how far away it is, m; {_GHOST_M:g} unless told", least=1)


def _jitter(draw: AttackDraw, noise_m: float) -> ChangedRanges:
    return ChangedRanges(_JITTERY_DEG, azimuth(draw), 0.0, noise_m, draw.seed)


def _shift(draw: AttackDraw, shift_m: float) -> ChangedRanges:
    return ChangedRanges(_SHIFTED_DEG, azimuth(draw), shift_m, 0.0, draw.seed)


def _noisy(lost: float, farthest_m: float) -> Callable[[AttackDraw, float], RandomRanges]:
    return lambda draw, width_deg: RandomRanges(width_deg, azimuth(draw), lost, farthest_m, draw.seed)


def _ghost(draw: AttackDraw, points: float) -> GhostCar:
    range_m = draw.options.get(_RANGE.name, _GHOST_M)
    return GhostCar(round(points), range_m, uniform(draw, _LATERALS_M), draw.seed)


ON_LIDAR: Mapping[str, LidarKind] = {
    "ghost": LidarKind(
        "points of a car that is not there; --range says where", "points", 60, _ghost, options=(_RANGE,)
    ),
    "jitter": LidarKind("a sector whose ranges jitter", "deviation, m", 0.3, _jitter),
    "shift": LidarKind("a sector that is farther away than it was", "m", 1.0, _shift),
    "removed": LidarKind("an object without its points", _AWAY, 20.0, lambda _, size: RemovedObject(size)),
    "seen-through": LidarKind(
        "an object whose points lie behind it", _AWAY, 20.0, lambda _, size: RemovedObject(size, _BEHIND_M)
    ),
    "saturated": LidarKind("a sector of few and random ranges", "degrees", 20.0, _noisy(_SATURATED_LOST, _NOISE_M)),
    "pulses": LidarKind("a sector of random ranges", "degrees", 20.0, _noisy(0.0, _PULSES_M)),
}
