"""The sensors of fleets whose drives are published: where each camera and LiDAR sits, where it looks, what it sees.

Numbers are rounded: angles to a degree, places to some centimetres, focal lengths to ten pixels. What a rig can find
depends on them in this accuracy. A vehicle has x ahead, y to the left and z up; yaw is to the left, pitch up.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from auditor.lab.simulation.vehicles import rotation
from auditor.model.optics.geometry import Matrix, motion
from auditor.model.optics.sensors import FISHEYE, NO_LENS, Lens
from auditor.model.rig import Camera, Lidar, Rig

PlaceM = tuple[float, float, float]

_OPTICAL = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
"""Axes of a vehicle or LiDAR (x ahead, y left, z up) from those of a camera (x right, y down, z ahead)."""


@dataclass(frozen=True)
class PublishedCamera:
    """A camera at a place of its vehicle, in metres; angles in degrees."""

    name: str
    at_m: PlaceM
    yaw_deg: float
    focal_px: float
    size_px: tuple[int, int]
    lens: Lens = NO_LENS
    pitch_deg: float = 0.0

    def smaller(self, scale: float) -> "PublishedCamera":
        """The camera with `scale` times the pixels across and down."""
        width, height = (round(side * scale) for side in self.size_px)
        return replace(self, size_px=(width, height), focal_px=self.focal_px * scale)

    @property
    def vehicle_SE3_camera(self) -> Matrix:
        """(4, 4) the camera's place."""
        return motion(_turned(self.yaw_deg, self.pitch_deg) @ _OPTICAL, np.array(self.at_m))

    @property
    def intrinsics(self) -> Matrix:
        """K, (3, 3)."""
        width, height = self.size_px
        return np.array([[self.focal_px, 0, width / 2], [0, self.focal_px, height / 2], [0, 0, 1]])


@dataclass(frozen=True)
class PublishedLidar:
    """A LiDAR: `beams` from `low_deg` to `high_deg` of elevation, over `wide_deg` around where it looks."""

    name: str
    at_m: PlaceM
    beams: int
    low_deg: float
    high_deg: float
    wide_deg: float = 360.0
    yaw_deg: float = 0.0
    pitch_deg: float = 0.0
    reach_m: float = 85.0

    @property
    def vehicle_SE3_lidar(self) -> Matrix:
        """(4, 4) the LiDAR's place."""
        return motion(_turned(self.yaw_deg, self.pitch_deg), np.array(self.at_m))

    def directions(self, step_deg: float) -> Matrix:
        """(beams, columns, 3) unit directions of its beams, in its own frame."""
        half = min(self.wide_deg, 360.0 - step_deg) / 2
        return self.directions_at(np.deg2rad(np.arange(-half, half + step_deg / 2, step_deg)))

    def directions_at(self, azimuth: Matrix) -> Matrix:
        """(beams, columns, 3) unit directions of its beams at some azimuths (columns,), radians to its left."""
        beam = np.deg2rad(np.linspace(self.high_deg, self.low_deg, self.beams))[:, None]
        level = np.cos(beam)
        return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(beam) + 0 * azimuth], axis=2)


@dataclass(frozen=True)
class PublishedRig:
    """The sensors of one fleet's vehicles, and where their numbers are from."""

    source: str
    cameras: tuple[PublishedCamera, ...]
    lidars: tuple[PublishedLidar, ...]

    def smaller(self, scale: float) -> "PublishedRig":
        """The rig whose cameras have `scale` times the pixels across and down."""
        return replace(self, cameras=tuple(camera.smaller(scale) for camera in self.cameras))

    def lone(self, camera: str, lidar: str = "") -> Rig:
        """The rig of one camera with a LiDAR, the first where none is named, in the frame of the vehicle."""
        one = next(seen for seen in self.cameras if seen.name == camera)
        other = next(seen for seen in self.lidars if lidar in {"", seen.name})
        camera_SE3_vehicle = np.linalg.inv(one.vehicle_SE3_camera)
        projection = one.intrinsics @ camera_SE3_vehicle[:3]
        topic = f"/{one.name}/image_raw"
        width, height = one.size_px
        return Rig(
            Lidar(other.name, f"/{other.name}/points", other.vehicle_SE3_lidar),
            (Camera(1, one.name, topic, width, height, projection, rectified=False, lens=one.lens),),
        )


def _turned(yaw_deg: float, pitch_deg: float) -> Matrix:
    """(3, 3) to the vehicle's axes from those of a sensor that is turned to the left, then up."""
    yaw, pitch = (float(np.deg2rad(angle)) for angle in (yaw_deg, pitch_deg))
    return rotation(0.0, 0.0, yaw) @ rotation(0.0, -pitch, 0.0)


_EQUIDISTANT = Lens(FISHEYE, (0.0, 0.0, 0.0, 0.0))

_NUSCENES = PublishedRig(
    "Caesar et al., CVPR 2020; calibrated_sensor of one vehicle",
    (
        PublishedCamera("cam_front", (1.70, 0.02, 1.51), 0, 1270, (1600, 900)),
        PublishedCamera("cam_front_right", (1.55, -0.49, 1.50), -56, 1260, (1600, 900)),
        PublishedCamera("cam_back_right", (1.01, -0.48, 1.56), -110, 1260, (1600, 900)),
        PublishedCamera("cam_back", (0.03, 0.00, 1.58), 180, 810, (1600, 900)),
        PublishedCamera("cam_back_left", (1.04, 0.48, 1.59), 110, 1260, (1600, 900)),
        PublishedCamera("cam_front_left", (1.52, 0.49, 1.51), 56, 1270, (1600, 900)),
    ),
    (PublishedLidar("lidar_top", (0.94, 0.00, 1.84), 32, -31, 11, yaw_deg=-90),),
)

_WAYMO = PublishedRig(
    "Sun et al., CVPR 2020 (fields of view, ranges); places after the frames' calibrations",
    (
        PublishedCamera("front", (1.54, -0.02, 2.12), 0, 2060, (1920, 1280)),
        PublishedCamera("front_left", (1.50, 0.09, 2.12), 45, 2060, (1920, 1280)),
        PublishedCamera("front_right", (1.50, -0.10, 2.12), -45, 2060, (1920, 1280)),
        PublishedCamera("side_left", (1.43, 0.11, 2.12), 90, 2060, (1920, 886)),
        PublishedCamera("side_right", (1.43, -0.12, 2.12), -90, 2060, (1920, 886)),
    ),
    (
        PublishedLidar("lidar_top", (1.43, 0.00, 2.18), 64, -17.6, 2.4),
        PublishedLidar("lidar_front", (4.07, 0.00, 0.69), 40, -90, 30, 180, reach_m=20.0),
        PublishedLidar("lidar_side_left", (3.25, 1.03, 0.98), 40, -90, 30, 180, 90, reach_m=20.0),
        PublishedLidar("lidar_side_right", (3.25, -1.03, 0.98), 40, -90, 30, 180, -90, reach_m=20.0),
        PublishedLidar("lidar_rear", (-1.15, 0.00, 0.47), 40, -90, 30, 180, 180, reach_m=20.0),
    ),
)

_ARGOVERSE_2 = PublishedRig(
    "Wilson et al., NeurIPS 2021; egovehicle_SE3_sensor and intrinsics of one log",
    (
        PublishedCamera("ring_front_center", (1.64, 0.00, 1.39), 0, 1690, (1550, 2048)),
        PublishedCamera("ring_front_left", (1.58, 0.19, 1.40), 45, 1690, (2048, 1550)),
        PublishedCamera("ring_front_right", (1.58, -0.19, 1.40), -45, 1690, (2048, 1550)),
        PublishedCamera("ring_side_left", (1.31, 0.29, 1.40), 99, 1690, (2048, 1550)),
        PublishedCamera("ring_side_right", (1.31, -0.29, 1.40), -99, 1690, (2048, 1550)),
        PublishedCamera("ring_rear_left", (1.08, 0.22, 1.40), 153, 1690, (2048, 1550)),
        PublishedCamera("ring_rear_right", (1.08, -0.22, 1.40), -153, 1690, (2048, 1550)),
        PublishedCamera("stereo_front_left", (1.62, 0.25, 1.21), 0, 1690, (2048, 1550)),
        PublishedCamera("stereo_front_right", (1.62, -0.25, 1.21), 0, 1690, (2048, 1550)),
    ),
    (
        PublishedLidar("up_lidar", (1.35, 0.00, 1.64), 32, -25, 15),
        PublishedLidar("down_lidar", (1.36, 0.00, 1.57), 32, -15, 25, yaw_deg=180),
    ),
)

_PANDASET = PublishedRig(
    "Xiao et al., ITSC 2021; intrinsics of its devkit, places after its poses",
    (
        PublishedCamera("front_camera", (1.70, 0.00, 1.60), 0, 1970, (1920, 1080)),
        PublishedCamera("front_left_camera", (1.60, 0.45, 1.60), 55, 930, (1920, 1080)),
        PublishedCamera("front_right_camera", (1.60, -0.45, 1.60), -55, 930, (1920, 1080)),
        PublishedCamera("left_camera", (1.10, 0.45, 1.60), 110, 930, (1920, 1080)),
        PublishedCamera("right_camera", (1.10, -0.45, 1.60), -110, 930, (1920, 1080)),
        PublishedCamera("back_camera", (0.20, 0.00, 1.60), 180, 930, (1920, 1080)),
    ),
    (
        PublishedLidar("pandar64", (1.20, 0.00, 1.90), 64, -25, 15),
        PublishedLidar("pandar_gt", (1.75, 0.00, 1.70), 64, -10, 10, 60),
    ),
)

_ZOD = PublishedRig(
    "Alibeigi et al., ICCV 2023; its development kit",
    (PublishedCamera("front", (2.02, 0.00, 1.40), 0, 1840, (3848, 2168), _EQUIDISTANT),),
    (
        PublishedLidar("vls128", (1.20, 0.00, 2.05), 128, -25, 15),
        PublishedLidar("vlp16_left", (1.20, 0.65, 1.90), 16, -15, 15, yaw_deg=45, pitch_deg=-15),
        PublishedLidar("vlp16_right", (1.20, -0.65, 1.90), 16, -15, 15, yaw_deg=-45, pitch_deg=-15),
    ),
)

_A2D2 = PublishedRig(
    "Geyer et al., 2020 (fields of view, setup); places and angles after its cams_lidars.json",
    (
        PublishedCamera("front_center", (1.71, 0.00, 0.94), 0, 1690, (1920, 1208)),
        PublishedCamera("front_left", (1.70, 0.58, 0.94), 46, 920, (1920, 1208), _EQUIDISTANT),
        PublishedCamera("front_right", (1.70, -0.58, 0.94), -46, 920, (1920, 1208), _EQUIDISTANT),
        PublishedCamera("side_left", (0.59, 0.58, 0.94), 91, 920, (1920, 1208), _EQUIDISTANT),
        PublishedCamera("side_right", (0.59, -0.58, 0.94), -91, 920, (1920, 1208), _EQUIDISTANT),
        PublishedCamera("rear_center", (-0.39, 0.00, 0.94), 180, 920, (1920, 1208), _EQUIDISTANT),
    ),
    (
        PublishedLidar("lidar_front_center", (1.11, 0.00, 0.85), 16, -15, 15, pitch_deg=-7),
        PublishedLidar("lidar_front_left", (1.63, 0.58, 0.83), 16, -15, 15, yaw_deg=30, pitch_deg=-20),
        PublishedLidar("lidar_front_right", (1.63, -0.58, 0.83), 16, -15, 15, yaw_deg=-30, pitch_deg=-20),
        PublishedLidar("lidar_rear_left", (-0.18, 0.57, 0.85), 16, -15, 15, yaw_deg=150, pitch_deg=-20),
        PublishedLidar("lidar_rear_right", (-0.18, -0.57, 0.85), 16, -15, 15, yaw_deg=-150, pitch_deg=-20),
    ),
)

_KITTI_360 = PublishedRig(
    "Liao et al., TPAMI 2022; its fisheyes' unified model as the equidistant one that shows 185 degrees",
    (
        PublishedCamera("image_00", (1.57, 0.33, 1.55), 0, 553, (1408, 376), pitch_deg=-5),
        PublishedCamera("image_01", (1.57, -0.27, 1.55), 0, 553, (1408, 376), pitch_deg=-5),
        PublishedCamera("image_02", (0.70, 0.65, 1.80), 90, 434, (1400, 1400), _EQUIDISTANT),
        PublishedCamera("image_03", (0.70, -0.60, 1.80), -90, 434, (1400, 1400), _EQUIDISTANT),
    ),
    (PublishedLidar("velodyne", (0.80, 0.03, 1.95), 64, -25, 2),),
)

_DDAD = PublishedRig(
    "Guizilini et al., CVPR 2020; three cameras of a scene's calibration, the others after the paper's figure",
    (
        PublishedCamera("camera_01", (1.65, 0.25, 1.35), 2, 2170, (1936, 1216)),
        PublishedCamera("camera_05", (1.65, 0.39, 1.36), 54, 1060, (1936, 1216)),
        PublishedCamera("camera_06", (1.66, -0.46, 1.37), -51, 1060, (1936, 1216)),
        PublishedCamera("camera_07", (1.00, 0.42, 1.36), 110, 1060, (1936, 1216)),
        PublishedCamera("camera_08", (1.00, -0.42, 1.36), -110, 1060, (1936, 1216)),
        PublishedCamera("camera_09", (0.30, 0.00, 1.36), 180, 1060, (1936, 1216)),
    ),
    (PublishedLidar("lidar", (1.20, 0.00, 1.75), 64, -20, 10, reach_m=200.0),),
)

_WIDE_AND_TELE = PublishedRig(
    "no fleet's: a wide camera and a tele camera at one windscreen, as drive-assistance boxes have",
    (
        PublishedCamera("wide", (1.70, 0.05, 1.40), 0, 560, (1280, 720)),
        PublishedCamera("tele", (1.70, -0.05, 1.40), 0, 2600, (1280, 720)),
    ),
    (PublishedLidar("roof", (1.20, 0.00, 1.80), 64, -25, 5),),
)

PUBLISHED_RIGS: Mapping[str, PublishedRig] = MappingProxyType(
    {
        "nuscenes": _NUSCENES,
        "waymo": _WAYMO,
        "argoverse_2": _ARGOVERSE_2,
        "pandaset": _PANDASET,
        "zod": _ZOD,
        "a2d2": _A2D2,
        "kitti_360": _KITTI_360,
        "ddad": _DDAD,
        "wide_and_tele": _WIDE_AND_TELE,
    }
)
"""By the names of their data sets."""
