"""Attacks on the LiDAR beyond the paper's wall, and faults: sensors that hide, invent, delay or have moved."""

from dataclasses import dataclass, field

import numpy as np

from auditor.errors import SettingError
from auditor.lab.attacks.paper import Described, with_levels
from auditor.model.arrays import Points
from auditor.model.frames import CameraImage, PointCloud
from auditor.model.rig import Rig

_AZIMUTHS_DEG = (-35.0, 35.0)
_ELEVATIONS_DEG = (-12.0, 1.0)
_RANGES_M = (4.0, 40.0)
_BLOB_RADII = (0.05, 0.12)  # of the image's width
_OPAQUE = 0.95
_SOFT_EDGE = 0.5  # of the radius
_MUD_LEVEL = 30.0  # grey levels


@dataclass(frozen=True)
class HiddenSector(Described):
    """All points of a sector are gone: `width_deg` wide, its middle `azimuth_deg` to the right of straight ahead."""

    width_deg: float
    azimuth_deg: float

    name = "hidden sector"

    def apply(self, cloud: PointCloud, rig: Rig) -> PointCloud:
        """The cloud without the sector. Raises SettingError for a rig without a LiDAR."""
        right, _, forward = (cloud.xyz_m @ lidar_axes(rig).T).T
        aside = np.rad2deg(np.arctan2(right, forward)) - self.azimuth_deg
        return PointCloud(cloud.stamp_ns, cloud.xyz_m[np.abs(aside) > self.width_deg / 2])


@dataclass(frozen=True)
class ScatteredPoints(Described):
    """`count` spoofed points anywhere in the cameras' view, 4 to 40 m away."""

    count: int
    seed: int

    name = "scattered points"

    def apply(self, cloud: PointCloud, rig: Rig) -> PointCloud:
        """The cloud with the points added last. Raises SettingError for a rig without a LiDAR."""
        rng = np.random.default_rng([self.seed, cloud.stamp_ns])
        azimuth, elevation = (
            np.deg2rad(rng.uniform(*limits, self.count)) for limits in (_AZIMUTHS_DEG, _ELEVATIONS_DEG)
        )
        ahead = np.cos(elevation)
        direction = np.stack([np.sin(azimuth) * ahead, -np.sin(elevation), np.cos(azimuth) * ahead], axis=1)
        points = direction * rng.uniform(*_RANGES_M, (self.count, 1))
        spoofed = np.asarray(points @ lidar_axes(rig), dtype=np.float32)
        return PointCloud(cloud.stamp_ns, np.concatenate([cloud.xyz_m, spoofed]))


@dataclass(frozen=True)
class TurnedLidar(Described):
    """The LiDAR has turned on its mount since it was calibrated: a fault, not an attack."""

    yaw_deg: float
    pitch_deg: float = 0.0

    name = "turned LiDAR"

    def apply(self, cloud: PointCloud, rig: Rig) -> PointCloud:
        """The cloud as the turned LiDAR reports it. Raises SettingError for a rig without a LiDAR."""
        cosine, sine = np.cos(np.deg2rad(self.yaw_deg)), np.sin(np.deg2rad(self.yaw_deg))
        yaw = np.array([[cosine, 0, -sine], [0, 1, 0], [sine, 0, cosine]])
        cosine, sine = np.cos(np.deg2rad(self.pitch_deg)), np.sin(np.deg2rad(self.pitch_deg))
        turn = np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]]) @ yaw
        rotation = lidar_axes(rig)
        xyz = cloud.xyz_m @ (rotation.T @ turn @ rotation).T
        return PointCloud(cloud.stamp_ns, np.asarray(xyz, dtype=np.float32))


@dataclass(frozen=True)
class ShiftedCamera(Described):
    """The camera has turned since it was calibrated: its image stands `rows_px` lower and `columns_px` to the right.

    A fault, not an attack. One degree is 13 px where the focal length is 720 px.
    """

    rows_px: int
    columns_px: int = 0

    name = "shifted camera"

    def apply(self, image: CameraImage) -> CameraImage:
        """The image moved, its edges repeated where nothing moved in."""
        height, width = image.pixels.shape[:2]
        row = np.clip(np.arange(height) - self.rows_px, 0, height - 1)
        column = np.clip(np.arange(width) - self.columns_px, 0, width - 1)
        return CameraImage(image.sensor, image.stamp_ns, np.ascontiguousarray(image.pixels[row[:, None], column]))


@dataclass(frozen=True)
class DimmedCamera(Described):
    """The camera gets a share `light` of its light: dusk, a tunnel, a closed aperture. Not an attack by itself."""

    light: float

    name = "dimmed"

    def apply(self, image: CameraImage) -> CameraImage:
        """The darker image."""
        return with_levels(image, image.pixels * np.float32(self.light))


@dataclass(frozen=True)
class SoiledLens(Described):
    """Drops of mud on the lens: `blobs` soft-edged discs at places that do not move, dark and opaque in the middle."""

    blobs: int
    seed: int

    name = "soiled lens"

    def apply(self, image: CameraImage) -> CameraImage:
        """The image behind the dirt."""
        height, width = image.pixels.shape[:2]
        rng = np.random.default_rng([self.seed, image.sensor])
        clear = np.ones((height, width), dtype=np.float32)
        row, column = np.arange(height)[:, None], np.arange(width)
        for _ in range(self.blobs):
            u, v, radius = rng.uniform(0, width), rng.uniform(0, height), rng.uniform(*_BLOB_RADII) * width
            distance = np.hypot(row - v, column - u) / radius
            clear *= 1 - _OPAQUE * np.clip((1 - distance) / _SOFT_EDGE, 0, 1).astype(np.float32)
        clear = clear.reshape(height, width, *[1] * (image.pixels.ndim - 2))
        return with_levels(image, image.pixels * clear + _MUD_LEVEL * (1 - clear))


@dataclass(frozen=True, eq=False)
class _Delayed:
    frames: int

    name = "delay"

    @property
    def parameters(self) -> dict[str, object]:
        """All that determines its effect."""
        return {"frames": self.frames}


@dataclass(frozen=True, eq=False)
class DelayedCamera(_Delayed):
    """The camera shows what it saw `frames` ago: a replay, or a camera that has been frozen since then."""

    earlier: CameraImage = field(repr=False)

    def apply(self, image: CameraImage) -> CameraImage:
        """The earlier image under the stamp of this one."""
        return CameraImage(image.sensor, image.stamp_ns, self.earlier.pixels)


@dataclass(frozen=True, eq=False)
class DelayedLidar(_Delayed):
    """The LiDAR reports what it saw `frames` ago."""

    earlier: PointCloud = field(repr=False)

    def apply(self, cloud: PointCloud, rig: Rig) -> PointCloud:  # noqa: ARG002 - as every attack on a LiDAR
        """The earlier cloud under the stamp of this one."""
        return PointCloud(cloud.stamp_ns, self.earlier.xyz_m)


def lidar_axes(rig: Rig) -> Points:
    """(3, 3): the LiDAR's points to right, down, forward of it."""
    if rig.lidar is None:
        raise SettingError("this attack needs a LiDAR, and the rig has none", where="S_0")
    return rig.lidar.rig_SE3_lidar[:3, :3].astype(np.float32)
