"""Synthetic drives along a street: frames of cameras and LiDAR with the true depths."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from auditor.errors import SettingError
from auditor.lab.simulation.raycasting import Floats, Hits, Rays, cast, placed
from auditor.lab.simulation.sensors import camera_rays, echoes, expose, lidar_directions, lidar_rays
from auditor.lab.simulation.shading import Light, radiance
from auditor.lab.simulation.streets import street, style_named, traffic
from auditor.lab.simulation.surfaces import Surfaces, gather
from auditor.lab.simulation.textures import Atlas, make_atlas
from auditor.lab.simulation.vehicles import Vehicle, make_rig, make_vehicle, rotation
from auditor.model.frames import CameraImage, Frame, PointCloud, Presence, SensorState
from auditor.model.geometry import Matrix, compose, invert, motion
from auditor.model.rig import Rig

PERIOD_NS = 100_000_000
START_NS = 1_600_000_000_000_000_000
_CAMERA_HEIGHT_M = 1.65
_SWAY = np.deg2rad([0.25, 0.35])
_SPEEDS_M_S = (6.0, 10.0)
_STREAMS = {"scene": 1, "camera": 2, "lidar": 3, "day": 4}


@dataclass(frozen=True, eq=False)
class SyntheticDrive:
    """A drive of `frame_count` frames at 10 Hz. A frame is made when it is requested, and is always the same."""

    seed: int
    trip: int
    frame_count: int
    style: str
    vehicle: Vehicle
    start_ns: int
    speed_m_s: float
    lane_m: float
    light: Light
    atlas: Atlas = field(repr=False)
    surfaces: Surfaces = field(repr=False)

    @property
    def rig(self) -> Rig:
        """The rig by the vehicle's calibration."""
        return self.vehicle.rig

    def frames(self) -> Iterator[Frame]:
        """All frames, in order."""
        return (self.frame(number) for number in range(self.frame_count))

    def frame(self, number: int) -> Frame:
        """One frame; its images are grey."""
        stamp_ns = self.start_ns + number * PERIOD_NS
        images = {camera.number: self.image(number, camera.number) for camera in self.rig.cameras}
        cloud = self.cloud(number) if self.rig.lidar else None
        present = Presence(SensorState.PRESENT, 0)
        return Frame(number, stamp_ns, dict.fromkeys(self.rig.sensors, present), cloud, images)

    def image(self, number: int, camera: int) -> CameraImage:
        """The image of S_camera in a frame: (H, W) uint8."""
        flaws = self.vehicle.cameras[camera - 1]
        world_SE3_rig, rays, surfaces, hits = self._seen(number, camera)
        light = radiance(rays, hits, surfaces, self.atlas, self.light, world_SE3_rig)
        rng = np.random.default_rng([self.seed, self.trip, _STREAMS["camera"], camera, number])
        return CameraImage(camera, self._stamp_ns(number), expose(light, flaws, rng))

    def depth_m(self, number: int, camera: int) -> Floats:
        """The true (H, W) depths of S_camera's pixels in a frame; inf where it sees the sky."""
        return self._seen(number, camera)[3].distance

    def cloud(self, number: int) -> PointCloud:
        """The LiDAR's scan of a frame. Raises SettingError where the rig has none."""
        if self.rig.lidar is None:
            raise SettingError("the rig has no LiDAR", where="synthetic drive")
        flaws = self.vehicle.lidar
        time_s = number * PERIOD_NS / 1e9 - flaws.stamp_error_s
        rig_SE3_world = invert(self._world_SE3_rig(time_s))
        surfaces = placed(self.surfaces, rig_SE3_world, time_s)
        rng = np.random.default_rng([self.seed, self.trip, _STREAMS["lidar"], number])
        rays = lidar_rays(self.rig.lidar, self._directions, flaws, self.speed_m_s)
        hits = cast(rays, surfaces, self.atlas, rng)
        xyz_m = echoes(rays, hits, surfaces, self._directions, flaws, rng)
        return PointCloud(self._stamp_ns(number), xyz_m)

    @cached_property
    def _directions(self) -> Floats:
        return lidar_directions()

    def _stamp_ns(self, number: int) -> int:
        return self.start_ns + number * PERIOD_NS

    def _seen(self, number: int, camera: int) -> tuple[Matrix, Rays, Surfaces, Hits]:
        flaws = self.vehicle.cameras[camera - 1]
        time_s = number * PERIOD_NS / 1e9 + flaws.stamp_error_s
        world_SE3_rig = self._world_SE3_rig(time_s)
        surfaces = placed(self.surfaces, invert(world_SE3_rig), time_s)
        rays = camera_rays(self.rig.camera(camera), flaws.row_shift_px)
        return world_SE3_rig, rays, surfaces, cast(rays, surfaces, self.atlas)

    def _world_SE3_rig(self, time_s: float) -> Matrix:
        """The vehicle's pose: it follows its lane, and rolls and pitches a little."""
        phase = self.seed + 1.7 * self.trip
        pitch = _SWAY[0] * np.sin(2.1 * time_s + phase)
        yaw = _SWAY[1] * np.sin(0.7 * time_s + 2 * phase)
        at = np.array([self.lane_m + 0.1 * np.sin(0.5 * time_s + phase), -_CAMERA_HEIGHT_M, self.speed_m_s * time_s])
        return compose(motion(np.eye(3), at), motion(rotation(float(pitch), float(yaw), 0.0), np.zeros(3)))


def make_drive(
    seed: int,
    frames: int,
    *,
    n_cameras: int = 3,
    lidar: bool = True,
    style: str = "city",
    width_px: int = 1242,
    height_px: int = 375,
    vehicle: int = 0,
    trip: int = 0,
    positions_m: tuple[float, ...] | None = None,
    start_ns: int = START_NS,
) -> SyntheticDrive:
    """A drive along a street.

    `seed` determines the street and the parked vehicles; `trip` the light, the traffic, the speed and the noise: trips
    of one seed, and of as many frames, go along the same street on different days. `vehicle` determines the calibration
    and the flaws of the sensors, which drives of one vehicle share; vehicle 0 is built exactly as designed.
    `positions_m` are x of S_1, S_2, ... in metres, KITTI's where it has as many cameras. Raises SettingError for an
    unknown style, no frames, or positions that do not fit.
    """
    if frames < 1:
        raise SettingError(f"{frames} frames are too few", where="synthetic drive", remedy="give at least one")
    look = style_named(style)
    rig = make_rig(n_cameras, lidar=lidar, width_px=width_px, height_px=height_px, positions_m=positions_m)
    still = np.random.default_rng([seed, _STREAMS["scene"]])
    day = np.random.default_rng([seed, _STREAMS["day"], trip])
    speed = float(day.uniform(*_SPEEDS_M_S))
    length_m = frames * PERIOD_NS / 1e9 * _SPEEDS_M_S[1]
    pieces = [*street(look, length_m, seed), *traffic(look, length_m, speed, day)]
    return SyntheticDrive(
        seed=seed,
        trip=trip,
        frame_count=frames,
        style=style,
        vehicle=make_vehicle(rig, vehicle),
        start_ns=start_ns,
        speed_m_s=speed,
        lane_m=look.lane_m,
        light=_light(still, day),
        atlas=make_atlas(still),
        surfaces=gather(pieces, still),
    )


def _light(street: np.random.Generator, day: np.random.Generator) -> Light:
    """A street's light, a little different every day."""
    sun = np.array([street.uniform(-1, 1), -street.uniform(0.6, 1.2), street.uniform(-1, 0.6)])
    sun += day.uniform(-0.2, 0.2, 3)
    x, y, z = (float(axis) for axis in sun / np.linalg.norm(sun))
    direct, ambient = street.uniform(1.15, 1.65), street.uniform(0.3, 0.4)
    return Light((x, y, z), direct=float(direct * day.uniform(0.93, 1.07)), ambient=float(ambient))


__all__ = ["SyntheticDrive", "make_drive"]
