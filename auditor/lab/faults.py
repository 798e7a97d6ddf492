"""A sensor that hides, invents, lags or has moved: attacks on the LiDAR beyond the paper's wall, and plain faults."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from auditor.errors import SettingError
from auditor.frames import CameraImage, PointCloud
from auditor.lab.attacks import Described
from auditor.rig import Rig

Points = NDArray[np.float32]

_AZIMUTHS_DEG = (-35.0, 35.0)
_ELEVATIONS_DEG = (-12.0, 1.0)
_RANGES_M = (4.0, 40.0)


@dataclass(frozen=True)
class HiddenSector(Described):
    """All points of a sector are gone: `width_deg` wide, its middle `azimuth_deg` to the right of straight ahead."""

    width_deg: float
    azimuth_deg: float

    name = "hidden sector"

    def apply(self, cloud: PointCloud, rig: Rig) -> PointCloud:
        """The cloud without the sector. Raises SettingError for a rig without a LiDAR."""
        right, _, forward = (cloud.xyz_m @ _rotation(rig).T).T
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
        spoofed = np.asarray(points @ _rotation(rig), dtype=np.float32)
        return PointCloud(cloud.stamp_ns, np.concatenate([cloud.xyz_m, spoofed]))


@dataclass(frozen=True)
class TurnedLidar(Described):
    """The LiDAR has turned on its mount by `yaw_deg` since it was calibrated: a fault, not an attack."""

    yaw_deg: float

    name = "turned LiDAR"

    def apply(self, cloud: PointCloud, rig: Rig) -> PointCloud:
        """The cloud as the turned LiDAR reports it. Raises SettingError for a rig without a LiDAR."""
        cosine, sine = np.cos(np.deg2rad(self.yaw_deg)), np.sin(np.deg2rad(self.yaw_deg))
        turn = np.array([[cosine, 0, -sine], [0, 1, 0], [sine, 0, cosine]])
        rotation = _rotation(rig)
        xyz = cloud.xyz_m @ (rotation.T @ turn @ rotation).T
        return PointCloud(cloud.stamp_ns, np.asarray(xyz, dtype=np.float32))


@dataclass(frozen=True)
class ShiftedCamera(Described):
    """The camera has tilted since it was calibrated: its image stands `rows_px` lower. A fault, not an attack."""

    rows_px: int

    name = "shifted camera"

    def apply(self, image: CameraImage) -> CameraImage:
        """The image moved down, its first row repeated above it."""
        row = np.clip(np.arange(image.pixels.shape[0]) - self.rows_px, 0, None)
        return CameraImage(image.sensor, image.stamp_ns, image.pixels[row])


@dataclass(frozen=True, eq=False)
class DelayedCamera:
    """The camera shows what it saw `frames` ago: a replay, or a camera that has been frozen for so long."""

    frames: int
    earlier: CameraImage = field(repr=False)

    name = "delay"

    @property
    def parameters(self) -> dict[str, object]:
        """Everything that decides its effect."""
        return {"frames": self.frames}

    def apply(self, image: CameraImage) -> CameraImage:
        """The earlier image under the stamp of this one."""
        return CameraImage(image.sensor, image.stamp_ns, self.earlier.pixels)


@dataclass(frozen=True, eq=False)
class DelayedLidar:
    """The LiDAR reports what it saw `frames` ago."""

    frames: int
    earlier: PointCloud = field(repr=False)

    name = "delay"

    @property
    def parameters(self) -> dict[str, object]:
        """Everything that decides its effect."""
        return {"frames": self.frames}

    def apply(self, cloud: PointCloud, rig: Rig) -> PointCloud:  # noqa: ARG002 - as every attack on a LiDAR
        """The earlier cloud under the stamp of this one."""
        return PointCloud(cloud.stamp_ns, self.earlier.xyz_m)


def _rotation(rig: Rig) -> Points:
    """(3, 3): the LiDAR's points to right, down, forward of it."""
    if rig.lidar is None:
        raise SettingError("this attack needs a LiDAR, and the rig has none", where="S_0")
    return rig.lidar.rig_SE3_lidar[:3, :3].astype(np.float32)
