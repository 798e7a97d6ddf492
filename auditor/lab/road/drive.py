"""Synthetic drives: a vehicle with KITTI's sensors in a street, with the true depth of every pixel."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from auditor.errors import SettingError
from auditor.frames import CameraImage, Frame, PointCloud, Presence, SensorState
from auditor.geometry import Matrix, compose, motion
from auditor.lab.road.cameras import CameraCharacter, draw_camera, expose
from auditor.lab.road.casting import Hits, View, cast, view
from auditor.lab.road.rays import PinholeRays, Rays, pinhole
from auditor.lab.road.scanner import LidarCharacter, draw_lidar, hdl64, scan
from auditor.lab.road.shading import Scenery, shade
from auditor.lab.road.street import Style, make_scenery
from auditor.rig import LIDAR, Camera, Lidar, Rig

_KITTI_SIZE_PX = (1242, 375)
_KITTI_FOCAL_PX = 721.5377
_KITTI_CENTRE_PX = (609.5593, 172.854)
_POSITIONS_M = {2: (0.54, -0.06), 3: (0.54, 0.47, -0.06), 4: (0.54, 0.47, 0.0, -0.06)}
_SPAN_M = (-0.06, 0.54)
_CAMERA_HEIGHT_M = 1.65
_LIDAR_IN_RIG_M = (0.0, -0.08, -0.27)
_START_NS = 1_317_000_000_000_000_000

# Camera axes (x right, y down, z forward) from LiDAR axes (x forward, y left, z up).
_CAMERA_FROM_LIDAR_AXES = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])


@dataclass(frozen=True, eq=False)
class SyntheticDrive:
    """A drive through a synthetic street; frames are made when asked for, each from the seed and its number alone."""

    seed: int
    count: int
    style: Style
    period_s: float
    rig: Rig
    cameras: tuple[CameraCharacter, ...]
    lidar: LidarCharacter
    speed_m_s: float
    sway: tuple[float, ...] = field(repr=False)

    @cached_property
    def scenery(self) -> Scenery:
        """The street, built when it is first needed."""
        return make_scenery(self.seed, self.count * self.period_s * self.speed_m_s, self.style)

    def frames(self) -> Iterator[Frame]:
        """All frames in order."""
        for number in range(self.count):
            yield self.frame(number)

    def frame(self, number: int) -> Frame:
        """Frame `number` of 0..count - 1; images are (H, W) uint8."""
        stamp_ns = _START_NS + round(number * self.period_s * 1e9)
        images = {
            camera.number: CameraImage(camera.number, stamp_ns, self._picture(number, camera))
            for camera in self.rig.cameras
        }
        cloud = PointCloud(stamp_ns, self._cloud(number)) if self.rig.lidar else None
        presence = {sensor: Presence(SensorState.PRESENT, 0) for sensor in self.rig.sensors}
        return Frame(number, stamp_ns, presence, cloud, images)

    def depth_m(self, number: int, sensor: int) -> NDArray[np.float32]:
        """True depth z, (H, W) metres, of every pixel of camera `sensor` in a frame; infinite in the sky."""
        camera = self.rig.camera(sensor)
        return self._see(number, self._rays(camera), self._camera_pose(number, camera))[1].t

    def _picture(self, number: int, camera: Camera) -> NDArray[np.uint8]:
        rays, pose = self._rays(camera), self._camera_pose(number, camera)
        seen, hits = self._see(number, rays, pose)
        brightness = shade(self.scenery, seen, hits, rays, pose)
        return expose(brightness, self.cameras[camera.number - 1], self._rng(number, camera.number))

    def _cloud(self, number: int) -> NDArray[np.float32]:
        rng = self._rng(number, LIDAR)
        late_s = float(rng.uniform(-1, 1)) * self.lidar.late_s
        pose = compose(
            self._pose(number * self.period_s + late_s), motion(np.eye(3), np.array(_LIDAR_IN_RIG_M)), self._misplaced()
        )
        rays = hdl64()
        seen = view(self.scenery.surfaces, pose, number * self.period_s + late_s)
        hits = cast(self.scenery.surfaces, seen, rays, self.scenery.atlas, through_glass=True)
        return scan(self.scenery, seen, hits, rays, self.lidar, rng)

    def _see(self, number: int, rays: Rays, pose: Matrix) -> tuple[View, Hits]:
        seen = view(self.scenery.surfaces, pose, number * self.period_s)
        return seen, cast(self.scenery.surfaces, seen, rays, self.scenery.atlas)

    def _rays(self, camera: Camera) -> PinholeRays:
        P = camera.projection
        row_error_px = self.cameras[camera.number - 1].row_error_px
        return pinhole(
            camera.width_px, camera.height_px, camera.focal_px, (float(P[0, 2]), float(P[1, 2]) + row_error_px)
        )

    def _camera_pose(self, number: int, camera: Camera) -> Matrix:
        return compose(self._pose(number * self.period_s), motion(np.eye(3), camera.centre_m))

    def _misplaced(self) -> Matrix:
        return motion(_small_turn(*self.lidar.turn), np.array(self.lidar.shift_m))

    def _pose(self, time_s: float) -> Matrix:
        """world_SE3_rig: the vehicle sways a little in its lane, and nods."""
        a, b, c, d = self.sway
        x = 0.25 * np.sin(0.5 * time_s + a)
        yaw = 0.25 * 0.5 * np.cos(0.5 * time_s + a) / self.speed_m_s
        pitch = 0.004 * np.sin(5.0 * time_s + b)
        roll = 0.005 * np.sin(3.1 * time_s + c)
        lift = 0.01 * np.sin(6.0 * time_s + d)
        return motion(_small_turn(pitch, yaw, roll), np.array([x, -_CAMERA_HEIGHT_M + lift, time_s * self.speed_m_s]))

    def _rng(self, number: int, sensor: int) -> np.random.Generator:
        return np.random.default_rng([self.seed, 1, number, sensor])


def make_drive(
    seed: int,
    frames: int,
    *,
    n_cameras: int = 3,
    lidar: bool = True,
    style: Style = "city",
    width_px: int = 1242,
    height_px: int = 375,
    period_s: float = 0.1,
    evenly_spaced: bool = False,
    flawless: bool = False,
) -> SyntheticDrive:
    """A drive of so many frames, the same for the same arguments.

    The sensors are KITTI's, the focal length scaled with the width. `evenly_spaced` spreads the cameras over KITTI's
    0.6 m; `flawless` leaves out noise, blur, and the errors of calibration and stamps. Raises SettingError where an
    argument makes no sense.
    """
    if frames < 1 or n_cameras < 1 or min(width_px, height_px) < 16 or period_s <= 0:
        raise SettingError(
            f"no drive of {frames} frames with {n_cameras} cameras of {width_px} x {height_px} px every {period_s} s",
            where="make_drive",
            remedy="all must be positive, images at least 16 px",
        )
    rng = np.random.default_rng([seed, 2])
    characters = tuple(draw_camera(rng) for _ in range(n_cameras))
    laser = draw_lidar(rng)
    if flawless:
        characters, laser = (CameraCharacter(),) * n_cameras, LidarCharacter()
    return SyntheticDrive(
        seed=seed,
        count=frames,
        style=style,
        period_s=period_s,
        rig=_make_rig(n_cameras, width_px, height_px, lidar=lidar, evenly_spaced=evenly_spaced),
        cameras=characters,
        lidar=laser,
        speed_m_s=float(rng.uniform(7, 11)),
        sway=tuple(float(value) for value in rng.uniform(0, 2 * np.pi, 4)),
    )


def _make_rig(n_cameras: int, width_px: int, height_px: int, *, lidar: bool, evenly_spaced: bool) -> Rig:
    positions = _POSITIONS_M.get(n_cameras)
    if evenly_spaced or positions is None:
        positions = tuple(float(x) for x in np.linspace(_SPAN_M[1], _SPAN_M[0], n_cameras))
    scale = width_px / _KITTI_SIZE_PX[0]
    focal = _KITTI_FOCAL_PX * scale
    centre = (_KITTI_CENTRE_PX[0] * scale, _KITTI_CENTRE_PX[1] * height_px / _KITTI_SIZE_PX[1])
    cameras = tuple(
        Camera(
            number,
            f"camera_{number}",
            f"/camera_{number}/image_rect",
            width_px,
            height_px,
            np.array([[focal, 0, centre[0], -focal * x], [0, focal, centre[1], 0], [0, 0, 1, 0]]),
        )
        for number, x in enumerate(positions, start=1)
    )
    mounting = motion(_CAMERA_FROM_LIDAR_AXES, np.array(_LIDAR_IN_RIG_M))
    return Rig(Lidar("lidar", "/lidar/points", mounting) if lidar else None, cameras)


def _small_turn(x: float, y: float, z: float) -> Matrix:
    """The rotation about x, then y, then z, by so many radians."""
    cx, cy, cz, sx, sy, sz = np.cos(x), np.cos(y), np.cos(z), np.sin(x), np.sin(y), np.sin(z)
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x)
