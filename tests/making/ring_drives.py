"""Drives of published rigs along a street: cameras and LiDARs that look all around, each rendered in its own frame."""

from dataclasses import dataclass
from functools import cached_property
from math import ceil

import numpy as np

from auditor.errors import SettingError
from auditor.lab.simulation.drives import PERIOD_NS, SyntheticDrive, make_drive
from auditor.lab.simulation.raycasting import Rays, cast, placed
from auditor.lab.simulation.shading import radiance
from auditor.lab.simulation.vehicles import camera_rays, echoes, expose, rotation
from auditor.model.arrays import Floats32, Image, Points
from auditor.model.optics.geometry import Matrix, compose, invert, motion
from auditor.model.rig import Camera
from tests.making.published_rigs import PublishedCamera, PublishedLidar, PublishedRig

_BEGIN_M = 40.0
"""How far along its street a drive begins: cameras that look back see a street as well."""
_AXLE_M = (1.0, 0.0, 1.65)
"""Where the street's own rig lies in the vehicle: x ahead, y left, z up."""
_RIG_R_VEHICLE = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])
_RIG_SE3_VEHICLE = motion(_RIG_R_VEHICLE, -_RIG_R_VEHICLE @ np.array(_AXLE_M))
_STEP_DEG = 0.2
_HALVES_DEG = 0.0, 180.0
_STREAMS = {"camera": 1, "lidar": 2}


@dataclass(frozen=True, eq=False)
class RingDrive:
    """A drive of a published rig at 10 Hz; one that stands sees the same place, with new noise, in every frame."""

    rig: PublishedRig
    street: SyntheticDrive
    standing: bool = False

    def picture(self, number: int, camera: PublishedCamera) -> Image:
        """(H, W) uint8 the picture of a camera in a frame. Raises SettingError where its lens is too wide to draw."""
        world_SE3_camera = self._world(number, camera.vehicle_SE3_camera)
        surfaces = placed(self.street.surfaces, invert(world_SE3_camera), self._time_s(number))
        straight = camera.lens.model == "none"
        projection = np.hstack([camera.intrinsics, np.zeros((3, 1))])
        ideal = Camera(1, camera.name, "", *camera.size_px, projection, rectified=straight, lens=camera.lens)
        rays = camera_rays(ideal)
        light = radiance(
            rays,
            cast(rays, surfaces, self.street.atlas),
            surfaces,
            self.street.atlas,
            self.street.light,
            world_SE3_camera,
        )
        return expose(light, self.street.vehicle.cameras[0], self._rng("camera", camera.name, number))

    def points(self, number: int, lidar: PublishedLidar) -> Points:
        """(N, 3) the points of a LiDAR in a frame, in its own frame, as if all were of one moment."""
        return np.concatenate([self._half(number, lidar, half_deg) for half_deg in _HALVES_DEG])

    def _half(self, number: int, lidar: PublishedLidar, half_deg: float) -> Points:
        """The points within a quarter turn of an azimuth."""
        lidar_R_half = rotation(0.0, 0.0, float(np.deg2rad(half_deg))) @ _RIG_R_VEHICLE.T
        world_SE3_half = compose(self._world(number, lidar.vehicle_SE3_lidar), motion(lidar_R_half, np.zeros(3)))
        surfaces = placed(self.street.surfaces, invert(world_SE3_half), self._time_s(number))
        ahead = _directions(lidar)
        rng = self._rng("lidar", lidar.name, number, int(half_deg))
        rays = Rays(
            shape=ahead.shape[:2],
            x=ahead[..., 0],
            y=ahead[..., 1],
            z=ahead[..., 2],
            origin=tuple(np.zeros((1, 1), np.float32) for _ in range(3)),  # type: ignore[arg-type]
            pixel=float(np.deg2rad(_STEP_DEG)),
            first_azimuth=-np.pi / 2,
        )
        directions = (ahead @ lidar_R_half.T).astype(np.float32)
        hits = cast(rays, surfaces, self.street.atlas, rng)
        xyz_m = echoes(rays, hits, surfaces, directions, self.street.vehicle.lidar, rng)
        inside = np.abs(np.arctan2(xyz_m[:, 1], xyz_m[:, 0])) <= np.deg2rad(lidar.wide_deg / 2)
        return np.asarray(xyz_m[inside & (np.linalg.norm(xyz_m, axis=1) < lidar.reach_m)])

    @cached_property
    def _offset(self) -> int:
        return ceil(_BEGIN_M / self.street.speed_m_s / PERIOD_NS * 1e9)

    def _time_s(self, number: int) -> float:
        return (self._offset + (0 if self.standing else number)) * PERIOD_NS / 1e9

    def _world(self, number: int, vehicle_SE3_sensor: Matrix) -> Matrix:
        world_SE3_rig = self.street.world_SE3_rig(self._time_s(number))
        return compose(compose(world_SE3_rig, _RIG_SE3_VEHICLE), vehicle_SE3_sensor)

    def _rng(self, stream: str, name: str, *numbers: int) -> np.random.Generator:
        return np.random.default_rng([self.street.seed, _STREAMS[stream], *name.encode(), *numbers])


def make_ring_drive(
    rig: PublishedRig, seed: int, frames: int, *, style: str = "city", standing: bool = False
) -> RingDrive:
    """A drive of so many frames along the street of a seed. Raises SettingError for no frames or an unknown style."""
    if frames < 1:
        raise SettingError(f"{frames} frames are too few", where="ring drive", remedy="give at least one")
    before = ceil(_BEGIN_M / _SLOWEST_M_S / PERIOD_NS * 1e9)
    return RingDrive(rig, make_drive(seed, frames + before, n_cameras=1, style=style), standing)


_SLOWEST_M_S = 6.0


def _directions(lidar: PublishedLidar) -> Floats32:
    """(beams, columns, 3) a LiDAR's directions over half a turn: x right, y down, z ahead; rightmost last."""
    to_the_right = np.arange(-np.pi / 2, np.pi / 2, np.deg2rad(_STEP_DEG))
    return np.asarray(lidar.directions_at(-to_the_right) @ _RIG_R_VEHICLE.T, dtype=np.float32)
