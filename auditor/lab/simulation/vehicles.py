"""The vehicles of a fleet: one rig kind; each vehicle has its own calibration and small imperfections."""

from dataclasses import dataclass, replace

import numpy as np

from auditor.errors import SettingError
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
