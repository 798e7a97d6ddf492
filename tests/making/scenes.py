"""Small rigs that look at one textured plane, so that every disparity is known."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.measurement.disparity.half_resolution import halve
from auditor.measurement.disparity.lidar import LidarView
from auditor.measurement.disparity.matchers import SgbmMatcher
from auditor.measurement.disparity.stereo import stereo_map, textured
from auditor.measurement.frame_views import FrameViews
from auditor.model.arrays import Mask
from auditor.model.frames import CameraImage, Frame, PointCloud, Presence, SensorState
from auditor.model.rig import Camera, Lidar, Rig

WIDTH, HEIGHT, FOCAL = 320, 120, 300.0

# Camera frame (x right, y down, z forward) from a LiDAR frame (x forward, y left, z up) at the same place.
RIG_SE3_LIDAR = np.array([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]], dtype=np.float64)


def plane_rig(
    positions_m: tuple[float, ...] = (0.6, 0.3, 0.0), lidar: bool = True, size_px: tuple[int, int] = (WIDTH, HEIGHT)
) -> Rig:
    """Cameras S_1.. at the given x positions, right to left."""
    cameras, (width, height) = [], size_px
    for number, x in enumerate(positions_m, start=1):
        P = np.array([[FOCAL, 0, width / 2, -FOCAL * x], [0, FOCAL, height / 2, 0], [0, 0, 1, 0]])
        cameras.append(Camera(number, f"camera {number}", f"/camera_{number}", width, height, P))
    return Rig(Lidar("lidar", "/points", RIG_SE3_LIDAR) if lidar else None, tuple(cameras))


def plane_images(rig: Rig, depth_m: float, seed: int = 0) -> dict[int, NDArray[np.uint8]]:
    """What each camera sees of a textured plane facing it, whose disparities are whole pixels."""
    width, height = rig.cameras[0].width_px, rig.cameras[0].height_px
    texture = np.random.default_rng(seed).integers(0, 256, (height, 3 * width)).astype(np.uint8)
    images = {}
    for camera in rig.cameras:
        shift = round(FOCAL * float(camera.centre_m[0]) / depth_m)
        images[camera.number] = np.ascontiguousarray(texture[:, width + shift : 2 * width + shift])
    return images


def plane_cloud(depth_m: float) -> NDArray[np.float32]:
    """Points every second pixel of a plane at one depth, in the LiDAR frame."""
    u, v = np.meshgrid(np.arange(0, WIDTH, 2), np.arange(0, HEIGHT, 2))
    left, up = -(u - WIDTH / 2) / FOCAL * depth_m, -(v - HEIGHT / 2) / FOCAL * depth_m
    return np.stack([np.full(u.shape, depth_m), left, up], axis=-1).reshape(-1, 3).astype(np.float32)


def plane_frame(rig: Rig, depth_m: float = 9.0, without: frozenset[int] = frozenset()) -> Frame:
    """A frame of the plane, some sensors missing."""
    images = {n: CameraImage(n, 0, p) for n, p in plane_images(rig, depth_m).items() if n not in without}
    states = {s: Presence(SensorState.MISSING if s in without else SensorState.PRESENT) for s in rig.sensors}
    cloud = PointCloud(0, plane_cloud(depth_m)) if rig.lidar and 0 not in without else None
    return Frame(0, 0, states, cloud, images)


def seen_by_pair(
    levels: Mapping[int, NDArray[np.uint8]],
    rig: Rig,
    valid_masks: Mapping[int, Mask] | None = None,
    *,
    together: bool = True,
) -> FrameViews:
    """The pictures of cameras 1, the source, and 3, the reference, as checks see them; `together` they match or not."""
    half = {one: halve(picture) for one, picture in levels.items()}
    texture = {one: textured(picture) for one, picture in half.items()}
    stereo = stereo_map(SgbmMatcher(), levels[3], levels[1], texture[3], texture[1])
    maps = {(1, 3): replace(stereo, valid=stereo.valid & together)}
    return FrameViews(half, {}, maps, {}, rig, valid_masks or {})


def moved(rig: Rig, offsets_m: tuple[tuple[float, float, float], ...]) -> Rig:
    """The same cameras beside their line: each moved by x, y (down) and z (ahead), and rectified with none."""
    cameras = []
    for camera, offset in zip(rig.cameras, offsets_m, strict=True):
        seen_from = np.column_stack([np.eye(3), -(camera.centre_m + np.array(offset))])
        cameras.append(replace(camera, rectified=False, projection=camera.intrinsics @ camera.rotation @ seen_from))
    return Rig(rig.lidar, tuple(cameras))


@dataclass(frozen=True, eq=False)
class WrittenDown(LidarView):
    """A view whose disparities a test writes down."""

    d0_px: NDArray[np.float32]

    def disparity_px(self, source: int) -> NDArray[np.float32]:
        return self.d0_px


DEPTH_M = 9.0
RIG = plane_rig()


def scene(down_px=0, depth_m=DEPTH_M):
    """A plane whose texture corners can be followed, seen so many rows lower."""
    noise = np.random.default_rng(1).integers(0, 256, (HEIGHT + 40, 3 * WIDTH)).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), 2.5)
    texture = np.clip((smooth - smooth.mean()) * 5 + 128, 0, 255).astype(np.uint8)[20 - down_px : 20 - down_px + HEIGHT]
    frame = plane_frame(RIG, depth_m)
    images = {}
    for camera in RIG.cameras:
        left = WIDTH + round(300 * float(camera.centre_m[0]) / depth_m)
        images[camera.number] = CameraImage(camera.number, 0, np.ascontiguousarray(texture[:, left : left + WIDTH]))
    return replace(frame, images=images)
