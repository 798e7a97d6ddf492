"""Vehicles of other makers and what their sensors see: boxes before a wall, whose disparities are whole pixels."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

LIDAR_FRAME = "lidar_top"
CAMERA_FROM_BASE = np.array([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]], dtype=np.float64)
"""Axes of a camera (x right, y down, z ahead) from those of a vehicle (x ahead, y left, z up)."""
LIDAR_ABOVE_CAMERA_M = np.array([-0.3, -0.1, 0.25])  # ahead, left, up
FAR_PX = 2
"""Disparity of the wall behind everything, in px a unit of the baseline."""
SPOT_SHARE = 0.7
"""Radius of a laser's spot as a share of the image's height: it is wider than the matcher's range.

What a narrower one covers finds other matches beside it, as all of this scene is noise, and is compared with nothing.
"""
DRIFT_PX = 9
"""How far all drifts from one moment to the next: farther than the matcher blurs edges, else the LiDAR looks late."""
WALL_M = (-1.2, 1.25)
"""Lowest height and half width of a bogus wall."""


@dataclass(frozen=True)
class Vehicle:
    """Rectified cameras on one line, leftmost at 0, each at a whole number of units to the right; a LiDAR."""

    name: str
    cameras: dict[str, int]
    unit_m: float
    focal_px: float
    size_px: tuple[int, int]
    image_topic: str
    info_topic: str
    form: str
    lidar_topic: str = "/lidar_top/points"
    parent: str = "base_link"
    ahead_ns: int = 0
    """How much later than others it begins: no two vehicles have the same stamps."""

    def topic(self, camera: str) -> str:
        return self.image_topic.format(camera)

    def info(self, camera: str) -> str:
        return self.info_topic.format(camera)

    def projection(self, camera: str, moved_m: float = 0.0) -> NDArray[np.float64]:
        """P, (3, 4); `moved_m` to the right of where the camera is."""
        width, height = self.size_px
        x_m = self.cameras[camera] * self.unit_m + moved_m
        f = self.focal_px
        return np.array([[f, 0, width / 2, -f * x_m], [0, f, height / 2, 0], [0, 0, 1, 0]])

    def mounts(self) -> dict[str, NDArray[np.float64]]:
        """By frame where it sits in the vehicle, (4, 4); the leftmost camera is 1.5 m ahead of the axle, 1.6 m up."""
        at = np.array([1.5, 0.3, 1.6])
        found = {f"{camera}_optical": _pose(at - [0, units * self.unit_m, 0]) for camera, units in self.cameras.items()}
        lidar = np.eye(4)
        lidar[:3, 3] = at + LIDAR_ABOVE_CAMERA_M
        return {LIDAR_FRAME: lidar, **found}


WAGON = Vehicle(
    "wagon",
    {"right": 4, "inner_left": 2, "left": 0},
    unit_m=0.15,
    focal_px=300.0,
    size_px=(320, 120),
    image_topic="/{}/image_rect/compressed",
    info_topic="/{}/camera_info",
    form="png",
)
VAN = Vehicle(
    "van",
    {"right": 3, "middle": 1, "left": 0},
    unit_m=0.2,
    focal_px=240.0,
    size_px=(288, 112),
    image_topic="/sensing/camera/{}/image_rect",
    info_topic="/sensing/camera/{}/camera_info",
    form="raw",
    ahead_ns=5_417_211_333,
)


@dataclass(frozen=True)
class Seen:
    """What a vehicle's sensors give at one moment: images by camera, (N, 3) points in the LiDAR's frame."""

    images: dict[str, NDArray[np.uint8]]
    xyz_m: NDArray[np.float32]


def see(vehicle: Vehicle, moment: int, seed: int = 0) -> Seen:
    """The scene at a moment: all drifts by some pixels from one moment to the next, noise is new in each."""
    rng = np.random.default_rng([seed, moment])
    width, height = vehicle.size_px
    layers = _layers(width, height, seed, DRIFT_PX * moment)
    images = {}
    for camera, units in vehicle.cameras.items():
        drawn = _draw(layers, units, width, height)[0]
        images[camera] = np.clip(drawn + rng.normal(0, 6, drawn.shape), 0, 255).astype(np.uint8)
    per_unit = _draw(layers, 0, width, height)[1]
    return Seen(images, _points(vehicle, per_unit[::2, ::2], rng))


def with_spot(image: NDArray[np.uint8], moment: int) -> NDArray[np.uint8]:
    """A laser's spot: the sensor is blind in it."""
    height, width = image.shape[:2]
    at = (width // 2 + 3 * (moment % 7), height // 2)
    return cv2.circle(image.copy(), at, round(SPOT_SHARE * height), 255, -1)


def with_wall(xyz_m: NDArray[np.float32], ahead_m: float) -> NDArray[np.float32]:
    """Points that would lie behind a bogus wall ahead come from it; `xyz_m` is ahead, left, up."""
    lowest_m, half_m = WALL_M
    there = xyz_m * (ahead_m / np.maximum(xyz_m[:, :1], 1e-3))
    behind = (xyz_m[:, 0] > ahead_m) & (np.abs(there[:, 1]) < half_m) & (there[:, 2] > lowest_m)
    return np.where(behind[:, None], there, xyz_m).astype(np.float32)


@dataclass(frozen=True)
class _Layer:
    """A textured rectangle of the leftmost image, (x, y) of its corner, with its disparity a unit."""

    texture: NDArray[np.uint8]
    x: int
    y: int
    px: int


def _layers(width: int, height: int, seed: int, drift: int) -> list[_Layer]:
    """From far to near."""
    rng = np.random.default_rng(seed)
    far = rng.integers(0, 256, (height, 4 * width)).astype(np.uint8)
    layers = [_Layer(far, -width - drift, 0, FAR_PX)]
    for number, px in enumerate((3, 5, 4, 5)):
        texture = rng.integers(0, 256, (height // 2, width // 5)).astype(np.uint8)
        place = (2 + 5 * number) * width // 16 + int(rng.integers(0, width // 16)) - drift
        layers.append(_Layer(texture, place, int(rng.integers(height // 4, height // 2)), px))
    return sorted(layers, key=lambda layer: layer.px)


def _draw(layers: list[_Layer], units: int, width: int, height: int) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """The image of a camera so many units to the right, and the disparity a unit of each of its pixels."""
    image, per_unit = np.zeros((height, width), np.uint8), np.zeros((height, width), np.uint8)
    for layer in layers:
        rows, columns = layer.texture.shape
        left = layer.x - units * layer.px
        first, last = max(left, 0), min(left + columns, width)
        if first < last:
            low = min(layer.y + rows, height)
            image[layer.y : low, first:last] = layer.texture[: low - layer.y, first - left : last - left]
            per_unit[layer.y : low, first:last] = layer.px
    return image, per_unit


def _points(vehicle: Vehicle, per_unit: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.float32]:
    """One point for each given pixel of the leftmost image, every second of a row and of a column."""
    width, height = vehicle.size_px
    v, u = np.indices(per_unit.shape) * 2
    depth_m = vehicle.focal_px * vehicle.unit_m / per_unit + rng.normal(0, 0.01, per_unit.shape)
    left, up = -(u - width / 2) / vehicle.focal_px * depth_m, -(v - height / 2) / vehicle.focal_px * depth_m
    seen_from_camera = np.stack([depth_m, left, up], axis=-1).reshape(-1, 3)
    return (seen_from_camera - LIDAR_ABOVE_CAMERA_M).astype(np.float32)


def _pose(at_m: NDArray[np.float64]) -> NDArray[np.float64]:
    pose = np.eye(4)
    pose[:3, :3] = CAMERA_FROM_BASE[:3, :3].T
    pose[:3, 3] = at_m
    return pose
