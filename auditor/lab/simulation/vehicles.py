"""The vehicles of a fleet, and the data of their sensors.

A fleet has one rig kind; each vehicle has its own calibration and small imperfections. Pixels and points are those of
cast rays, with the flaws of each sensor.
"""

from dataclasses import dataclass, replace

import numpy as np

from auditor.errors import SettingError
from auditor.lab.simulation.raycasting import Hits, Rays
from auditor.lab.simulation.surfaces import Surfaces
from auditor.model.arrays import Floats32, Image
from auditor.model.optics.geometry import Matrix, motion
from auditor.model.rig import Camera, Lidar, Rig

_FOCAL_SHARE = 721.5377 / 1242  # of the width, KITTI's
_PRINCIPAL = (609.5593 / 1242, 172.854 / 375)

KITTI_POSITIONS_M = {2: (0.47, -0.06), 3: (0.54, 0.47, -0.06), 4: (0.54, 0.47, 0.0, -0.06)}
"""x of S_1, S_2, ... by number of cameras."""

_SPACING_M = 0.3
_FOCAL_TOLERANCE = 0.008
_PRINCIPAL_TOLERANCE = 4 / 1242  # of the width
_PLACE_TOLERANCE_M = 0.0012

_LIDAR_TOLERANCES = 0.005, np.deg2rad(0.3)
"""The manufacturing tolerances: vehicles within them are of one rig kind."""

_LIDAR_SE3_AXES = ((0, 0, 1), (-1, 0, 0), (0, -1, 0))
_RIG_AT_LIDAR_M = (-0.004, -0.076, -0.272)


@dataclass(frozen=True)
class CameraFlaws:
    """The flaws of one camera: see `sensors.expose`."""

    gain: float
    offset: float
    blur: float
    vignetting: float
    read_noise: float
    photon_noise: float
    row_shift_px: float
    stamp_error_s: float


@dataclass(frozen=True, eq=False)
class LidarFlaws:
    """The errors of one LiDAR: of its mounting against the rig's, of its ranges, and of its stamps."""

    tilt: Matrix
    shift_m: Matrix
    range_noise_m: float
    dropout: float
    stamp_error_s: float


@dataclass(frozen=True, eq=False)
class Vehicle:
    """A rig by its calibration, and the true one."""

    rig: Rig
    cameras: tuple[CameraFlaws, ...]
    lidar: LidarFlaws


def make_rig(
    n_cameras: int, *, lidar: bool, width_px: int, height_px: int, positions_m: tuple[float, ...] | None = None
) -> Rig:
    """Collinear cameras like KITTI's, one LiDAR or none. `positions_m` are x of S_1, S_2, ..., falling.

    Raises SettingError where they are not as many as the cameras.
    """
    places = positions_m or KITTI_POSITIONS_M.get(n_cameras) or evenly_spaced_m(n_cameras)
    if len(places) != n_cameras:
        raise SettingError(f"{len(places)} positions for {n_cameras} cameras", where="rig")
    focal = _FOCAL_SHARE * width_px
    K = np.array([[focal, 0, _PRINCIPAL[0] * width_px], [0, focal, _PRINCIPAL[1] * height_px], [0, 0, 1]])
    cameras = tuple(
        Camera(
            number=number,
            name=f"camera_{number}",
            topic=f"/camera_{number}/image_rect",
            width_px=width_px,
            height_px=height_px,
            projection=K @ np.array([[1, 0, 0, -x], [0, 1, 0, 0], [0, 0, 1, 0]]),
        )
        for number, x in enumerate(places, start=1)
    )
    rig_SE3_lidar = motion(np.array(_LIDAR_SE3_AXES, dtype=np.float64).T, np.array(_RIG_AT_LIDAR_M))
    return Rig(Lidar("lidar", "/lidar/points", rig_SE3_lidar) if lidar else None, cameras)


def evenly_spaced_m(n_cameras: int) -> tuple[float, ...]:
    """Positions of S_1, S_2, ... along x, 0.3 m apart, the leftmost at 0."""
    return tuple(_SPACING_M * (n_cameras - number) for number in range(1, n_cameras + 1))


def as_built(rig: Rig, seed: int) -> Rig:
    """The rig of one vehicle of a fleet, calibrated for itself; seed 0 is built exactly as designed.

    Focal length, principal point and the places of the cameras and the LiDAR differ a little, and are known.
    """
    if seed == 0:
        return rig
    rng = np.random.default_rng([seed, 9])
    first = rig.cameras[0]
    aside, down = rng.uniform(-_PRINCIPAL_TOLERANCE, _PRINCIPAL_TOLERANCE, 2) * first.width_px
    K = first.intrinsics.copy()
    K[[0, 1], [0, 1]] *= rng.uniform(1 - _FOCAL_TOLERANCE, 1 + _FOCAL_TOLERANCE)
    K[:2, 2] += aside, down
    cameras = tuple(
        replace(camera, projection=K @ np.column_stack([np.eye(3), -camera.centre_m - moved * np.eye(3)[0]]))
        for camera, moved in zip(rig.cameras, rng.uniform(-_PLACE_TOLERANCE_M, _PLACE_TOLERANCE_M, rig.n), strict=True)
    )
    lidar = rig.lidar
    if lidar is not None:
        moved_m, turned = (rng.uniform(-most, most, 3) for most in _LIDAR_TOLERANCES)
        lidar = replace(lidar, rig_SE3_lidar=lidar.rig_SE3_lidar @ motion(rotation(*turned), moved_m))
    return Rig(lidar, cameras)


def make_vehicle(rig: Rig, seed: int) -> Vehicle:
    """A vehicle as it was built, and its imperfections, drawn from its seed.

    Angles are in radians, grey levels where a camera's unit is.
    """
    rng = np.random.default_rng([seed, 7])
    cameras = tuple(
        CameraFlaws(
            gain=float(rng.uniform(0.92, 1.08)),
            offset=float(rng.uniform(-2, 4)),
            blur=float(rng.uniform(0.1, 0.18)),
            vignetting=float(rng.uniform(0.05, 0.2)),
            read_noise=float(rng.uniform(0.7, 1.3)),
            photon_noise=float(rng.uniform(0.006, 0.012)),
            row_shift_px=float(rng.uniform(-0.25, 0.25)),
            stamp_error_s=float(rng.uniform(-0.001, 0.004)),
        )
        for _ in rig.cameras
    )
    angles = rng.normal(0, np.deg2rad(0.1), 3)
    return Vehicle(
        rig=as_built(rig, seed),
        cameras=cameras,
        lidar=LidarFlaws(
            tilt=rotation(*angles),
            shift_m=rng.normal(0, 0.015, 3),
            range_noise_m=float(rng.uniform(0.012, 0.025)),
            dropout=float(rng.uniform(0.01, 0.04)),
            stamp_error_s=float(rng.uniform(0.005, 0.015)),
        ),
    )


def rotation(x: float, y: float, z: float) -> Matrix:
    """Turns by angles in radians about x, then y, then z: (3, 3)."""
    (cx, sx), (cy, sy), (cz, sz) = ((np.cos(angle), np.sin(angle)) for angle in (x, y, z))
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x)


SWEEP_S = 0.1
_WHITE = 255.0
_BEAMS = np.deg2rad(np.concatenate([2.0 - np.arange(32) / 3, -8.83 - np.arange(32) * 0.5]))
_AZIMUTH_STEP = float(np.deg2rad(0.17))
_RANGES_M = (2.0, 85.0)
_FAINTEST = 0.012
_REFERENCE_M = 50.0


def camera_rays(camera: Camera, row_shift_px: float = 0.0) -> Rays:
    """The rays of a camera's pixels; distances along them are depths in the rig frame."""
    if not camera.rectified:
        return _bent_rays(camera, row_shift_px)
    focal = camera.focal_px
    u0, v0 = float(camera.projection[0, 2]), float(camera.projection[1, 2]) + row_shift_px
    x, y, z = (np.float32(axis) for axis in camera.centre_m)
    return Rays(
        shape=(camera.height_px, camera.width_px),
        x=((np.arange(camera.width_px, dtype=np.float32) - np.float32(u0)) / np.float32(focal))[None, :],
        y=((np.arange(camera.height_px, dtype=np.float32) - np.float32(v0)) / np.float32(focal))[:, None],
        z=np.ones((1, 1), dtype=np.float32),
        origin=(np.asarray(x), np.asarray(y), np.asarray(z)),
        pixel=1 / focal,
        principal_px=(u0, v0),
        focal_px=focal,
    )


def _bent_rays(camera: Camera, row_shift_px: float) -> Rays:
    """The rays of a camera that is turned, or has a lens: each pixel has a direction of its own."""
    K, columns, rows = camera.intrinsics, np.arange(camera.width_px), np.arange(camera.height_px)
    down = (rows[:, None] - K[1, 2] - row_shift_px) / K[1, 1] + np.zeros(columns.size)
    bent = (columns - K[0, 2] - K[0, 1] * down) / K[0, 0]
    x, y = camera.lens.undistort(bent, down)
    if not np.isfinite(x).all():
        raise SettingError(
            "its lens has no direction for some of its pixels", where=camera.name, remedy="give it less distortion"
        )
    directions = np.stack([x, y, np.ones_like(x)], axis=-1) @ camera.rotation  # R^T, applied from the right
    across, downwards = (directions[..., axis] / directions[..., 2] for axis in (0, 1))
    return Rays(
        shape=across.shape,
        x=across.astype(np.float32),
        y=downwards.astype(np.float32),
        z=np.ones((1, 1), dtype=np.float32),
        origin=tuple(np.asarray(np.float32(axis)) for axis in camera.centre_m),  # type: ignore[arg-type]
        pixel=1 / camera.focal_px,
        focal_px=camera.focal_px,
    )


def expose(light: Floats32, flaws: CameraFlaws, rng: np.random.Generator) -> Image:
    """(H, W) radiances to grey levels: lens, gain, noise, saturation."""
    height, width = light.shape
    image = np.minimum(light, np.float32(2)) * np.float32(_WHITE * flaws.gain)
    image = blurred(blurred(image, flaws.blur).T, flaws.blur).T
    image = image * vignette(height, width, flaws.vignetting)
    spread = np.sqrt(np.float32(flaws.read_noise**2) + np.float32(flaws.photon_noise) * image)
    image += spread * rng.standard_normal((height, width), dtype=np.float32)
    return np.asarray(np.clip(np.rint(image + np.float32(flaws.offset)), 0, 255), dtype=np.uint8)


def vignette(height: int, width: int, loss: float) -> Floats32:
    """(H, W) shares of light that a lens leaves, `loss` being lost at the picture's left and right."""
    across = np.linspace(-1, 1, width, dtype=np.float32) ** 2
    down = np.linspace(-1, 1, height, dtype=np.float32)[:, None] ** 2 * np.float32((height / width) ** 2)
    return np.asarray(1 - np.float32(loss) * (across + down))


def blurred(image: Floats32, share: float) -> Floats32:
    """Each row's value shared with the rows above and below."""
    result = image * np.float32(1 - 2 * share)
    result[1:] += np.float32(share) * image[:-1]
    result[:-1] += np.float32(share) * image[1:]
    result[0] += np.float32(share) * image[0]
    result[-1] += np.float32(share) * image[-1]
    return result


def lidar_directions() -> Floats32:
    """(64, columns, 3) unit directions of an HDL-64's beams over the front half, in the LiDAR frame; rightmost last."""
    azimuth = np.arange(-np.pi / 2, np.pi / 2, _AZIMUTH_STEP)  # to the right
    beam = _BEAMS[:, None]
    forward = np.cos(beam) * np.cos(azimuth)
    return np.stack([forward, -np.cos(beam) * np.sin(azimuth), np.sin(beam) + 0 * forward], axis=2).astype(np.float32)


def lidar_rays(lidar: Lidar, directions: Floats32, flaws: LidarFlaws, speed_m_s: float) -> Rays:
    """The true beams: of a LiDAR mounted a little off, on a vehicle that moves during the sweep."""
    R = lidar.rig_SE3_lidar[:3, :3]
    turned = directions @ (flaws.tilt @ R).astype(np.float32).T
    start = lidar.rig_SE3_lidar[:3, 3] + flaws.shift_m
    columns = directions.shape[1]
    first = float(np.arctan2(-directions[0, 0, 1], directions[0, 0, 0]))
    azimuth = first + _AZIMUTH_STEP * np.arange(columns)
    moved = start[2] + speed_m_s * SWEEP_S * azimuth / (2 * np.pi)
    return Rays(
        shape=(directions.shape[0], columns),
        x=turned[:, :, 0],
        y=turned[:, :, 1],
        z=turned[:, :, 2],
        origin=(
            np.full((1, 1), start[0], dtype=np.float32),
            np.full((1, 1), start[1], dtype=np.float32),
            moved[None, :].astype(np.float32),
        ),
        pixel=_AZIMUTH_STEP,
        first_azimuth=first,
    )


def echoes(
    rays: Rays, hits: Hits, surfaces: Surfaces, directions: Floats32, flaws: LidarFlaws, rng: np.random.Generator
) -> Floats32:
    """(N, 3) points in the LiDAR frame, beam by beam; faint echoes are lost."""
    distance = hits.distance
    there = (hits.piece >= 0) & (distance > _RANGES_M[0]) & (distance < _RANGES_M[1])
    lost = np.maximum(surfaces.lost, np.float32(flaws.dropout))
    there &= rng.random(rays.shape, dtype=np.float32) >= lost[hits.piece]
    at = np.flatnonzero(there)
    piece, r = hits.piece.ravel()[at], distance.ravel()[at]
    normal = surfaces.normal
    slant = np.abs(sum(normal[:, k].take(piece) * axis.ravel()[at] for k, axis in enumerate((rays.x, rays.y, rays.z))))
    echo = (0.05 + surfaces.albedo.take(piece)) * slant * (_REFERENCE_M / np.maximum(r, 10)) ** 2
    detected = echo * rng.uniform(0.5, 1.5, at.size) > _FAINTEST
    at, r = at[detected], r[detected]
    noisy = r + rng.normal(0, flaws.range_noise_m, at.size).astype(np.float32)
    return np.asarray(directions.reshape(-1, 3)[at] * noisy[:, None], dtype=np.float32)
