"""Synthetic drives along a street: frames of cameras and LiDAR with the true depths."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from auditor.errors import SettingError
from auditor.lab.simulation.conditions import CAMERAS, FLARE, condition_named
from auditor.lab.simulation.raycasting import Hits, Rays, cast, placed
from auditor.lab.simulation.responses import (
    CameraKind,
    ExposureChange,
    Response,
    changed_exposure,
    developed,
    draw_changes,
    draw_responses,
    kinds_of,
)
from auditor.lab.simulation.scene_objects import Vehicle3D, seen_share, vehicles_among
from auditor.lab.simulation.shading import (
    Day,
    Illumination,
    draw_day,
    emissions,
    overgrown,
    radiance,
    street_lamps,
    watered,
)
from auditor.lab.simulation.spectra import SpectralResponse, channels, reflectances, spectral_radiance
from auditor.lab.simulation.stray_light import SunSeen
from auditor.lab.simulation.streets import street, style_named, traffic
from auditor.lab.simulation.surfaces import Piece, Surfaces, gather
from auditor.lab.simulation.textures import Atlas, make_atlas
from auditor.lab.simulation.vehicles import (
    CameraFlaws,
    Vehicle,
    camera_rays,
    echoes,
    expose,
    lidar_directions,
    lidar_rays,
    make_rig,
    make_vehicle,
    rotation,
)
from auditor.model.arrays import Floats32, Image
from auditor.model.frames import CameraImage, Frame, PointCloud, Pose, Presence, SensorState
from auditor.model.optics.geometry import Matrix, compose, invert, motion
from auditor.model.rig import Camera, Rig

_PREVIEW = 6  # every so many pixels decide about the exposure
_EXPOSURES = 1 / 64, 64.0
_HALVINGS = 20

View = tuple[Matrix, Rays, Surfaces, Hits]
"""The rig's pose, a camera's rays, the pieces in the rig frame, and the hits."""


@dataclass(frozen=True, eq=False)
class Scenery:
    """The spectral part of a drive: `reflectance` and `emission` are (N, LAYERS, 4), of its pieces; see `spectra`."""

    condition: str
    day: Day
    road_m: float
    reflectance: Floats32
    emission: Floats32 | None
    responses: tuple[Response, ...]
    changes: tuple[ExposureChange, ...]

    @cached_property
    def channels(self) -> tuple[SpectralResponse, ...]:
        """Of S_1, S_2, ..."""
        return tuple(channels(one.bands, self.reflectance, self.emission, self.day) for one in self.responses)

    def light(self, camera: int, view: View, atlas: Atlas) -> Floats32:
        """(K, H, W) radiances in the channels of S_camera."""
        world_SE3_rig, rays, surfaces, hits = view
        seen = self.channels[camera - 1]
        return spectral_radiance(rays, hits, surfaces, atlas, self.day, self.road_m, seen, world_SE3_rig)

    def pixels(
        self,
        camera: Camera,
        view: View,
        atlas: Atlas,
        flaws: CameraFlaws,
        metered: Floats32,
        time_s: float,
        rng: np.random.Generator,
    ) -> Image:
        """The image of a camera, (H, W) or (H, W, 3) BGR; `metered` are the (K,) exposures that suit the drive."""
        response = self.responses[camera.number - 1]
        changed = response.exposure * changed_exposure(self.changes, camera.number, time_s)
        exposure = metered * response.balance(time_s) * np.float32(changed)
        light = self.light(camera.number, view, atlas)
        sun = self.sun_seen(camera, view)
        return developed(light, flaws, response, exposure, sun, rng)

    def metered(self, camera: int, preview: View, atlas: Atlas) -> Floats32:
        """The (K,) exposures that give S_camera a picture of the day's mean level, nearly grey on the whole."""
        light = self.light(camera, preview, atlas)
        mean = np.minimum(light, 1).mean(axis=(1, 2))
        balance = np.clip(mean.mean() / mean, *CAMERAS.grey_world_limits) ** np.float32(CAMERAS.grey_world)
        light *= balance[:, None, None]
        low, high = (float(np.log(limit)) for limit in _EXPOSURES)
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            too_dark = float(np.minimum(light * np.float32(np.exp(middle)), 1).mean()) < self.day.level
            low, high = (middle, high) if too_dark else (low, middle)
        return np.asarray(balance * np.float32(np.exp(low)), dtype=np.float32)

    def sun_seen(self, camera: Camera, view: View) -> SunSeen | None:
        """Where a camera sees the sun, and how much of it; None by dusk, and where it is far from the picture."""
        world_SE3_rig, rays, _, hits = view
        if not self.day.glow:
            return None
        x, y, z = camera.rotation @ world_SE3_rig[:3, :3].T @ np.array(self.day.light.sun)
        if z <= 0:
            return None
        u, v, _ = camera.intrinsics @ np.array([x / z, y / z, 1])
        height, width = rays.shape
        if not (0 <= u < width and 0 <= v < height):
            far = max(abs(u - width / 2), abs(v - height / 2)) > FLARE.reach * width / 2
            return None if far else SunSeen(float(u), float(v), FLARE.outside)
        half = FLARE.window_px // 2
        window = hits.piece[max(int(v) - half, 0) : int(v) + half + 1, max(int(u) - half, 0) : int(u) + half + 1]
        return SunSeen(float(u), float(v), float(np.mean(window < 0)))


def smaller(camera: Camera) -> Camera:
    """The camera with fewer pixels, to meter by."""
    scale = np.diag([1 / _PREVIEW, 1 / _PREVIEW, 1])
    return replace(
        camera,
        width_px=camera.width_px // _PREVIEW,
        height_px=camera.height_px // _PREVIEW,
        projection=scale @ camera.projection,
    )


WIDTH_PX, HEIGHT_PX = 1242, 375
PERIOD_NS = 100_000_000
START_NS = 1_600_000_000_000_000_000
_CAMERA_HEIGHT_M = 1.65
_SWAY = np.deg2rad([0.25, 0.35])
_SPEEDS_M_S = (6.0, 10.0)
_SOUTH_WEST_DEG = (49.0, 8.4)
_GROUND_M = 115.0
_DEGREE_M = 111_320.0
_AHEAD_M = (0.5, 80.0)
_STREETS, _BLOCK_M = 10, 300.0
"""The streets of a town of ten by ten blocks, by their seeds; a degree of latitude in metres."""
_STREAMS = {"scene": 1, "camera": 2, "lidar": 3, "day": 4, "scenery": 5}


@dataclass(frozen=True, eq=False)
class SyntheticDrive:
    """A drive of `frame_count` frames at 10 Hz. A frame is made when it is requested, and is always the same.

    Without a `scenery` all cameras are grey and see one spectrum.
    """

    seed: int
    trip: int
    frame_count: int
    style: str
    vehicle: Vehicle
    start_ns: int
    speed_m_s: float
    lane_m: float
    light: Illumination
    atlas: Atlas = field(repr=False)
    surfaces: Surfaces = field(repr=False)
    vehicles: tuple[Vehicle3D, ...] = field(repr=False)
    scenery: Scenery | None = field(repr=False, default=None)

    @property
    def rig(self) -> Rig:
        """The rig by the vehicle's calibration."""
        return self.vehicle.rig

    def frames(self) -> Iterator[Frame]:
        """All frames, in order."""
        return (self.frame(number) for number in range(self.frame_count))

    def frame(self, number: int) -> Frame:
        """One frame."""
        stamp_ns = self.start_ns + number * PERIOD_NS
        images = {camera.number: self.image(number, camera.number) for camera in self.rig.cameras}
        cloud = self.cloud(number) if self.rig.lidar else None
        present = Presence(SensorState.PRESENT, 0)
        return Frame(number, stamp_ns, dict.fromkeys(self.rig.sensors, present), cloud, images)

    def image(self, number: int, camera: int) -> CameraImage:
        """The image of S_camera in a frame: (H, W) uint8, or (H, W, 3) BGR of a colour camera."""
        flaws = self.vehicle.cameras[camera - 1]
        view = self._seen(number, self.rig.camera(camera))
        rng = np.random.default_rng([self.seed, self.trip, _STREAMS["camera"], camera, number])
        if self.scenery is None:
            world_SE3_rig, rays, surfaces, hits = view
            pixels = expose(radiance(rays, hits, surfaces, self.atlas, self.light, world_SE3_rig), flaws, rng)
        else:
            metered, time_s = self._metered[camera], number * PERIOD_NS / 1e9
            pixels = self.scenery.pixels(self.rig.camera(camera), view, self.atlas, flaws, metered, time_s, rng)
        return CameraImage(camera, self._stamp_ns(number), pixels)

    def depth_m(self, number: int, camera: int) -> Floats32:
        """The true (H, W) depths of S_camera's pixels in a frame; inf where it sees the sky."""
        return self._seen(number, self.rig.camera(camera))[3].distance

    def vehicles_ahead(self, number: int, camera: int) -> list[tuple[Matrix, float]]:
        """The vehicles of a frame that are wholly ahead: (8, 3) corners in the rig frame, and how much S_camera sees.

        The latter is the share of a vehicle that nothing hides, of what lies within the picture. Corners are at the
        frame's stamp.
        """
        rig_SE3_world = invert(self.world_SE3_rig(number * PERIOD_NS / 1e9))
        _, rays, surfaces, hits = self._seen(number, smaller(self.rig.camera(camera)))
        corners = [one.corners_m(rig_SE3_world, number * PERIOD_NS / 1e9) for one in self.vehicles]
        return [
            (at, seen_share(one, surfaces, rays, hits, self.atlas))
            for one, at in zip(self.vehicles, corners, strict=True)
            if _AHEAD_M[0] < at[:, 2].min() < _AHEAD_M[1]
        ]

    def cloud(self, number: int) -> PointCloud:
        """The LiDAR's scan of a frame. Raises SettingError where the rig has none."""
        if self.rig.lidar is None:
            raise SettingError("the rig has no LiDAR", where="synthetic drive")
        flaws = self.vehicle.lidar
        time_s = number * PERIOD_NS / 1e9 - flaws.stamp_error_s
        rig_SE3_world = invert(self.world_SE3_rig(time_s))
        surfaces = placed(self.surfaces, rig_SE3_world, time_s)
        rng = np.random.default_rng([self.seed, self.trip, _STREAMS["lidar"], number])
        rays = lidar_rays(self.rig.lidar, self._directions, flaws, self.speed_m_s)
        hits = cast(rays, surfaces, self.atlas, rng)
        xyz_m = echoes(rays, hits, surfaces, self._directions, flaws, rng)
        return PointCloud(self._stamp_ns(number), xyz_m)

    def place(self, stamp_ns: int) -> Pose:
        """Where the vehicle is at a stamp, by a GPS without errors: it drives north, on a street of its own."""
        time_s = (stamp_ns - self.start_ns) / 1e9
        east_m, up_m, north_m = self.world_SE3_rig(time_s)[:3, 3] * (1, -1, 1)
        column, row = self.seed % _STREETS, self.seed // _STREETS % _STREETS
        latitude = _SOUTH_WEST_DEG[0] + (row * _BLOCK_M + float(north_m)) / _DEGREE_M
        east_degree_m = _DEGREE_M * np.cos(np.deg2rad(_SOUTH_WEST_DEG[0]))
        longitude = _SOUTH_WEST_DEG[1] + (column * _BLOCK_M + float(east_m)) / float(east_degree_m)
        return Pose("gps", latitude, longitude, _GROUND_M + float(up_m))

    @cached_property
    def _directions(self) -> Floats32:
        return lidar_directions()

    def _stamp_ns(self, number: int) -> int:
        return self.start_ns + number * PERIOD_NS

    @cached_property
    def _metered(self) -> dict[int, Floats32]:
        """The exposures of each camera's channels, by what it sees in the middle of the drive."""
        assert self.scenery is not None
        views = {camera.number: self._seen(self.frame_count // 2, smaller(camera)) for camera in self.rig.cameras}
        return {number: self.scenery.metered(number, view, self.atlas) for number, view in views.items()}

    def _seen(self, number: int, camera: Camera) -> View:
        flaws = self.vehicle.cameras[camera.number - 1]
        time_s = number * PERIOD_NS / 1e9 + flaws.stamp_error_s
        world_SE3_rig = self.world_SE3_rig(time_s)
        surfaces = placed(self.surfaces, invert(world_SE3_rig), time_s)
        rays = camera_rays(camera, flaws.row_shift_px)
        return world_SE3_rig, rays, surfaces, cast(rays, surfaces, self.atlas)

    def world_SE3_rig(self, time_s: float) -> Matrix:
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
    width_px: int = WIDTH_PX,
    height_px: int = HEIGHT_PX,
    vehicle: int = 0,
    trip: int = 0,
    positions_m: tuple[float, ...] | None = None,
    start_ns: int = START_NS,
    condition: str | None = None,
    kinds: Sequence[CameraKind] | None = None,
) -> SyntheticDrive:
    """A drive along a street.

    `seed` determines the street and the parked vehicles; `trip` the light, the traffic, the speed and the noise: trips
    of one seed, and of as many frames, go along the same street on different days. `vehicle` determines the calibration
    and the flaws of the sensors, which drives of one vehicle share; vehicle 0 is built exactly as designed.
    `positions_m` are x of S_1, S_2, ... in metres, KITTI's where it has as many cameras.

    With a `condition` (see CONDITIONS) the street has colours, and each camera a spectrum, a tone curve, a lens and an
    exposure of its own; `kinds` says which are grey and which colour, drawn by the vehicle where it is None. Raises
    SettingError for an unknown style or condition, no frames, or positions or kinds that do not fit.
    """
    if frames < 1:
        raise SettingError(f"{frames} frames are too few", where="synthetic drive", remedy="give at least one")
    if kinds is not None and (condition is None or len(kinds) != n_cameras):
        raise SettingError(
            f"{len(kinds)} kinds for {n_cameras} cameras, condition {condition}",
            where="synthetic drive",
            remedy="give one kind a camera, and a condition",
        )
    look = style_named(style)
    rig = make_rig(n_cameras, lidar=lidar, width_px=width_px, height_px=height_px, positions_m=positions_m)
    still = np.random.default_rng([seed, _STREAMS["scene"]])
    day = np.random.default_rng([seed, _STREAMS["day"], trip])
    speed = float(day.uniform(*_SPEEDS_M_S))
    length_m = frames * PERIOD_NS / 1e9 * _SPEEDS_M_S[1]
    planted = look if condition is None else overgrown(look, condition_named(condition))
    pieces = [*street(planted, length_m, seed), *traffic(look, length_m, speed, day)]
    drive = SyntheticDrive(
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
        vehicles=vehicles_among(pieces),
    )
    if condition is None:
        return drive
    responses = draw_responses(kinds or kinds_of(vehicle, n_cameras), vehicle)
    return _in_colour(drive, pieces, condition, responses)


def _in_colour(
    drive: SyntheticDrive, pieces: Sequence[Piece], condition: str, responses: tuple[Response, ...]
) -> SyntheticDrive:
    """The drive with a scenery; `pieces` are its own, and lamps come after them."""
    rng = np.random.default_rng([drive.seed, _STREAMS["scenery"], drive.trip])
    day, look = draw_day(condition_named(condition), rng), style_named(drive.style)
    duration_s = drive.frame_count * PERIOD_NS / 1e9
    everything = [*pieces, *street_lamps(day, look, duration_s * _SPEEDS_M_S[1], rng)]
    surfaces = drive.surfaces if len(everything) == len(pieces) else gather(everything, rng)
    surfaces, atlas = watered(surfaces, drive.atlas, day, rng)
    scenery = Scenery(
        condition=condition,
        day=day,
        road_m=look.road_m,
        reflectance=reflectances(everything, drive.seed),
        emission=emissions(everything, day, drive.seed),
        responses=responses,
        changes=draw_changes(len(responses), duration_s, rng),
    )
    return replace(drive, surfaces=surfaces, atlas=atlas, light=day.light, scenery=scenery)


def _light(street: np.random.Generator, day: np.random.Generator) -> Illumination:
    """A street's light, a little different every day."""
    sun = np.array([street.uniform(-1, 1), -street.uniform(0.6, 1.2), street.uniform(-1, 0.6)])
    sun += day.uniform(-0.2, 0.2, 3)
    x, y, z = (float(axis) for axis in sun / np.linalg.norm(sun))
    direct, ambient = street.uniform(1.15, 1.65), street.uniform(0.3, 0.4)
    return Illumination((x, y, z), direct=float(direct * day.uniform(0.93, 1.07)), ambient=float(ambient))


__all__ = ["SyntheticDrive", "make_drive"]
