"""What a picture of a rig shows: where sensors are from above, and with how many others parts of views are compared."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from auditor.model.arrays import Indices
from auditor.model.optics.common_view import IdealView, compared_views, recorded_pixels, sees
from auditor.model.optics.geometry import Matrix, invert
from auditor.model.rig import Camera, Rig

_STEP_DEG = 1.0
_SLIVER = 3
"""Rays of a part that is too narrow to be seen, and goes with the part beside it."""
_WIDEST_DEG = 110.0
_FRONT, _BACK, _ASIDE = ("front", "fwd", "forward"), ("back", "rear"), ("left", "right", "side")


@dataclass(frozen=True, eq=False)
class PlacedRig:
    """A rig at its place in a frame that several share: `common_SE3_rig` (4, 4)."""

    rig: Rig
    common_SE3_rig: Matrix


@dataclass(frozen=True, eq=False)
class UnusedLidar:
    """A LiDAR that no rig has, and where it is in the common frame, (3,) metres; None where that is not known."""

    name: str
    centre_m: Matrix | None


@dataclass(frozen=True)
class ViewPart:
    """A part of a camera's view, in degrees to the left of ahead, and how many other sensors are compared there."""

    from_deg: float
    to_deg: float
    others: int


@dataclass(frozen=True)
class DrawnSensor:
    """A sensor as it is drawn: metres ahead and to the left of the middle, and the parts of what it sees."""

    name: str
    ahead_m: float
    left_m: float
    yaw_deg: float = 0.0
    parts: tuple[ViewPart, ...] = ()


@dataclass(frozen=True)
class Plan:
    """What is drawn: cameras, and LiDARs by whether a rig has them; `said` are those whose place is not known.

    `together` are the LiDARs of each rig that has several, `firsts` the names of S_0 of those that have one. `alone` is
    whether a camera is compared with the LiDAR by its own past, `headed` whether what is ahead is known.
    """

    cameras: tuple[DrawnSensor, ...]
    lidars: tuple[DrawnSensor, ...]
    unused: tuple[DrawnSensor, ...]
    said: tuple[str, ...]
    together: tuple[tuple[DrawnSensor, ...], ...]
    firsts: tuple[str, ...]
    alone: bool
    headed: bool


def in_lidar_frame(rig: Rig) -> PlacedRig:
    """One rig in the frame of its LiDAR, whose z axis is up; in its own where it has none."""
    return PlacedRig(rig, np.eye(4) if rig.lidar is None else invert(rig.lidar.rig_SE3_lidar))


def planned(rigs: Sequence[PlacedRig], unused: Sequence[UnusedLidar]) -> Plan:
    """What is drawn of some rigs, and of LiDARs that none has. A camera of several rigs is that of the first."""
    axes = _axes(rigs)
    places: dict[str, tuple[str, Matrix]] = {}
    cameras: dict[str, DrawnSensor] = {}
    for placed in rigs:
        rig, common_SE3_rig = placed.rig, placed.common_SE3_rig
        places |= {one.topic: (one.name, (common_SE3_rig @ one.rig_SE3_lidar)[:3, 3]) for one in rig.lidars.values()}
        for camera in rig.cameras:
            if camera.topic not in cameras:
                cameras[camera.topic] = _camera(placed, camera, axes)
    centres = {one.name: one.centre_m for one in unused if one.centre_m is not None}
    middle = _middle_m([*(place for _, place in places.values()), *centres.values()], list(cameras.values()), axes)
    return Plan(
        tuple(_moved(one, middle) for one in cameras.values()),
        tuple(_moved(DrawnSensor(name, *_flat(place, axes)), middle) for name, place in places.values()),
        tuple(_moved(DrawnSensor(name, *_flat(place, axes)), middle) for name, place in centres.items()),
        tuple(one.name for one in unused if one.centre_m is None),
        tuple(tuple(_together(placed, axes, middle)) for placed in rigs if placed.rig.others),
        tuple(dict.fromkeys(one.rig.lidar.name for one in rigs if one.rig.lidar and not one.rig.others)),
        any(one.rig.by_time and one.rig.n for one in rigs),
        len(cameras) > 1 or any(_looks_ahead(camera.name) for one in rigs for camera in one.rig.cameras),
    )


def _together(placed: PlacedRig, axes: Matrix, middle: tuple[float, float]) -> Iterator[DrawnSensor]:
    for number, lidar in placed.rig.lidars.items():
        place = (placed.common_SE3_rig @ lidar.rig_SE3_lidar)[:3, 3]
        yield _moved(DrawnSensor(f"S_{number} {lidar.name}", *_flat(place, axes)), middle)


def _axes(rigs: Sequence[PlacedRig]) -> Matrix:
    """(2, 3) the directions ahead and to the left in the common frame: up is opposite of where pictures have down.

    Ahead looks the camera whose name says so, and back another one; else most cameras look ahead. Where they look all
    around it is the frame's own x axis, or its z axis where that is level.
    """
    if not any(one.rig.cameras for one in rigs):
        right, _, ahead = rigs[0].common_SE3_rig[:3, :3].T
        return np.stack([ahead, -right])
    turned = [
        (camera.name, camera.rotation @ one.common_SE3_rig[:3, :3].T) for one in rigs for camera in one.rig.cameras
    ]
    up = -np.sum([rotation[1] for _, rotation in turned], axis=0)
    up = up / max(float(np.linalg.norm(up)), 1e-9)
    named = [rotation[2] * way for name, rotation in turned if (way := _looks_ahead(name))]
    candidates = [np.sum(named, axis=0)] if named else [np.mean([rotation[2] for _, rotation in turned], axis=0)]
    ahead = next(a for a in (*candidates, *np.eye(3)[[0, 2, 1]]) if np.linalg.norm(a - up * (a @ up)) > 0.5)
    ahead = ahead - up * (ahead @ up)
    ahead = ahead / np.linalg.norm(ahead)
    return np.stack([ahead, np.cross(up, ahead)])


def _looks_ahead(name: str) -> int:
    """1 where a camera's name says that it looks ahead, -1 back, 0 aside or nothing."""
    lower = name.lower()
    if any(word in lower for word in _ASIDE):
        return 0
    return any(word in lower for word in _FRONT) - any(word in lower for word in _BACK)


def _flat(place_m: Matrix, axes: Matrix) -> tuple[float, float]:
    ahead_m, left_m = axes @ place_m
    return float(ahead_m), float(left_m)


def _middle_m(places: Sequence[Matrix], cameras: Sequence[DrawnSensor], axes: Matrix) -> tuple[float, float]:
    flat = [*(_flat(place, axes) for place in places), *((one.ahead_m, one.left_m) for one in cameras)]
    low, high = np.min(flat, axis=0), np.max(flat, axis=0)
    ahead_m, left_m = (low + high) / 2
    return float(ahead_m), float(left_m)


def _moved(sensor: DrawnSensor, middle: tuple[float, float]) -> DrawnSensor:
    return DrawnSensor(sensor.name, sensor.ahead_m - middle[0], sensor.left_m - middle[1], sensor.yaw_deg, sensor.parts)


def _camera(placed: PlacedRig, camera: Camera, axes: Matrix) -> DrawnSensor:
    common_R_camera = placed.common_SE3_rig[:3, :3] @ camera.rotation.T
    centre_m = (placed.common_SE3_rig @ np.append(camera.centre_m, 1))[:3]
    yaw_deg = _yaw_deg(common_R_camera[:, 2], axes)
    half = _half_views_deg(camera)
    rays = np.arange(-half[0], half[1] + _STEP_DEG / 2, _STEP_DEG)
    parts = tuple(_parts(_others(placed.rig, camera, rays), yaw_deg + rays))
    shown = f"S_{camera.number} " if placed.rig.n > 1 else ""
    return DrawnSensor(f"{shown}{camera.name}", *_flat(centre_m, axes), yaw_deg, parts)


def _parts(others: Indices, rays_deg: Matrix) -> Iterator[ViewPart]:
    """The parts of a view, by how many others are compared at its rays; slivers go with the part before them."""
    starts = np.flatnonzero(np.diff(others, prepend=others[0] - 1))
    lengths = np.diff(starts, append=others.size)
    kept = starts[lengths >= _SLIVER]
    if not kept.size:
        kept = starts[:1]
    kept = np.concatenate([kept[:1], kept[1:][np.diff(others[kept]) != 0]])
    begins = np.concatenate([[0], kept[1:]])
    ends = np.concatenate([kept[1:], [others.size - 1]])
    for first, begin, end in zip(kept.tolist(), begins.tolist(), ends.tolist(), strict=True):
        yield ViewPart(float(rays_deg[begin]), float(rays_deg[end]), int(others[first]))


def _yaw_deg(direction: Matrix, axes: Matrix) -> float:
    ahead, left = axes @ direction
    return math.degrees(math.atan2(left, ahead))


def _half_views_deg(camera: Camera) -> tuple[float, float]:
    """How many degrees a camera sees to its right and to its left, in the middle of its picture."""
    K = camera.intrinsics
    u = np.array([0.0, camera.width_px - 1.0])
    bent = (u - K[0, 2]) / K[0, 0]
    x, _ = camera.lens.undistort(bent, np.zeros(2))
    with np.errstate(invalid="ignore"):
        widest = np.where(np.isfinite(x), np.degrees(np.arctan(np.abs(x))), _beyond_deg(np.abs(bent)))
    return float(widest[1]), float(widest[0])


def _beyond_deg(bent: Matrix) -> Matrix:
    """Degrees off the axis that a lens shows where its model is not trusted: as if it was equidistant."""
    return np.asarray(np.minimum(np.degrees(bent), _WIDEST_DEG))


def _others(rig: Rig, camera: Camera, rays_deg: Matrix) -> Indices:
    """How many other sensors are compared at rays so many degrees to the left of where a camera looks."""
    if rig.is_rectified and rig.n > 1:
        return np.full(rays_deg.size, rig.n - 1 + (rig.lidar is not None), dtype=np.intp)
    count = np.zeros(rays_deg.size, dtype=np.intp)
    for view, cameras in compared_views(rig):
        if camera in cameras:
            count += max(len(cameras) - 1, 1) * _shown(view, cameras, camera, rays_deg)
    return np.asarray(count + (count > 0) if rig.lidar and rig.n > 1 else count)


def _shown(view: IdealView, cameras: Sequence[Camera], camera: Camera, rays_deg: Matrix) -> Indices:
    """(rays,) 1 where a view shows a ray of a camera, in some row, and all cameras of the view see it."""
    x, y = view.x[::8], view.y[:: max(view.y.size // 5, 1)]
    seen = np.logical_and.reduce([sees(recorded_pixels(one, view.view_SO3_rig, x, y), one, 0.0) for one in cameras])
    across, down = np.meshgrid(x, y)
    rays = np.stack([across[seen], down[seen], np.ones(np.count_nonzero(seen))], axis=1)
    own = rays @ view.view_SO3_rig @ camera.rotation.T
    left_deg = -np.degrees(np.arctan2(own[:, 0], own[:, 2]))
    if not left_deg.size:
        return np.zeros(rays_deg.size, dtype=np.intp)
    inside = (rays_deg >= left_deg.min() - _STEP_DEG) & (rays_deg <= left_deg.max() + _STEP_DEG)
    return np.asarray(inside.astype(np.intp))
