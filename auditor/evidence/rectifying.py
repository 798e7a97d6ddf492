"""Any cameras on one line -> the pictures that ideal cameras at the same places would take, looking the same way.

All cameras of a rig get one orientation (x along the line of their centres) and one focal length, so that every pair is
rectified at once and what follows never knows that the rig was not: one picture a camera, one rig, one depth a
disparity. Of the plane that they all look at, the largest rectangle is kept that every camera sees whole: no pixel of a
rectified picture lies outside the recorded one, and none needs a mask.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np

from auditor.errors import RigError
from auditor.evidence.rectangles import largest_rectangle
from auditor.frames import CameraImage, Frame
from auditor.geometry import Matrix, compose, motion
from auditor.lenses import NO_LENS
from auditor.rig import Camera, Rig

ALIKE = 1e-3
"""Focal lengths and principal points that differ by less, as a share of the focal length, are the same."""

_CELL_PX = 8
_WIDEST = 1.2  # tan of 50 degrees
_FEWEST_PX = 64
_SHRUNK = 1.5
_FINEST = 0.6
"""Recorded pixels a rectified one at least: towards the edges of a wide lens there is more to see, but blurred."""


@dataclass(frozen=True, eq=False)
class _Remap:
    """How one camera's picture becomes rectified: shrunk by `scale` first, then looked up in the maps."""

    scale: float
    maps: tuple[cv2.typing.MatLike, cv2.typing.MatLike]


@dataclass(frozen=True, eq=False)
class Rectification:
    """`rig` is the ideal rig: same sensors, same numbers, cameras rectified, of one size and focal length.

    Where they are so already it is the rig itself, there are no remaps, and frames stay what they are.
    """

    rig: Rig
    remaps: Mapping[int, _Remap]

    def frame(self, frame: Frame) -> Frame:
        """The frame as the ideal rig would have recorded it; nothing but pixels changes."""
        if not self.remaps:
            return frame
        return replace(frame, images={number: self.image(image) for number, image in frame.images.items()})

    def image(self, image: CameraImage) -> CameraImage:
        """One picture, (H, W) or (H, W, 3) of its camera's size, as its ideal camera would have taken it."""
        remap = self.remaps[image.sensor]
        pixels: cv2.typing.MatLike = image.pixels
        if remap.scale < 1:
            # Looking up every second pixel would turn fine texture into false one.
            pixels = cv2.resize(pixels, None, fx=remap.scale, fy=remap.scale, interpolation=cv2.INTER_AREA)
        # The maps stay inside the picture up to rounding; at its very border the last pixel stands for the next.
        pixels = cv2.remap(pixels, *remap.maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return replace(image, pixels=np.asarray(pixels, dtype=np.uint8))


@lru_cache(maxsize=8)
def rectification(rig: Rig) -> Rectification:
    """What it takes to rectify a rig's frames, worked out once a rig.

    Raises RigError where the cameras have no view in common.
    """
    return Rectification(rig, {}) if is_rectified(rig) else _rectify(rig)


def is_rectified(rig: Rig) -> bool:
    """Whether all cameras are rectified and share size, focal length and principal point."""
    first = rig.cameras[0]
    return all(
        camera.rectified
        and (camera.width_px, camera.height_px) == (first.width_px, first.height_px)
        and np.allclose(camera.intrinsics, first.intrinsics, atol=ALIKE * first.focal_px)
        for camera in rig.cameras
    )


def _rectify(rig: Rig) -> Rectification:
    view_SO3_rig = _orientation(rig)
    focal = min(camera.focal_px for camera in rig.cameras)
    left, top, width, height = _window(rig, view_SO3_rig, focal)
    K = np.array([[focal, 0, -left], [0, focal, -top], [0, 0, 1]])
    x, y = (np.arange(width) + left) / focal, (np.arange(height) + top) / focal
    remaps = {camera.number: _remap(camera, view_SO3_rig, focal, x, y) for camera in rig.cameras}
    cameras = tuple(
        replace(
            camera,
            width_px=width,
            height_px=height,
            projection=K @ np.column_stack([np.eye(3), -(view_SO3_rig @ camera.centre_m)]),
            rectified=True,
            lens=NO_LENS,
        )
        for camera in rig.cameras
    )
    lidar = rig.lidar
    if lidar is not None:
        turned = compose(motion(view_SO3_rig, np.zeros(3)), lidar.rig_SE3_lidar)
        lidar = replace(lidar, rig_SE3_lidar=turned)
    return Rectification(Rig(lidar, cameras), remaps)


def _orientation(rig: Rig) -> Matrix:
    """(3, 3) rotation to the view's axes: x along the line of the centres, z as near as can be to where they look."""
    centres = np.array([camera.centre_m for camera in rig.cameras])
    along = np.linalg.svd(centres - centres.mean(axis=0))[2][0]
    x = along * np.sign(along @ (centres[0] - centres[-1]))  # S_1 is the rightmost
    z = np.sum([camera.rotation[2] for camera in rig.cameras], axis=0)
    z = z - x * (x @ z)
    if np.linalg.norm(z) < 0.1:
        raise RigError("the cameras look along the line they stand on", where="rig")
    z = z / np.linalg.norm(z)
    return np.stack([x, np.cross(z, x), z])


def _window(rig: Rig, view_SO3_rig: Matrix, focal: float) -> tuple[int, int, int, int]:
    """Left and top against the principal point, width and height, in pixels, of what every camera sees."""
    reach = int(_WIDEST * focal / _CELL_PX)
    places = np.arange(-reach, reach + 1) * _CELL_PX / focal
    seen = np.ones((places.size, places.size), dtype=np.bool_)
    for camera in rig.cameras:
        u, v = _pixels(camera, view_SO3_rig, places, places)
        with np.errstate(invalid="ignore"):
            seen &= (u >= 0) & (u <= camera.width_px - 1) & (v >= 0) & (v <= camera.height_px - 1)
            for axis in (0, 1):
                seen &= np.hypot(np.gradient(u, axis=axis), np.gradient(v, axis=axis)) > _FINEST * _CELL_PX
    top, left, rows, columns = largest_rectangle(seen)
    width, height = (columns - 1) * _CELL_PX + 1, (rows - 1) * _CELL_PX + 1
    if min(width, height) < _FEWEST_PX:
        names = ", ".join(camera.name for camera in rig.cameras)
        raise RigError(f"{names} have no view in common", where="rig", remedy="leave out the one that looks elsewhere")
    return (left - reach) * _CELL_PX, (top - reach) * _CELL_PX, width, height


def _remap(camera: Camera, view_SO3_rig: Matrix, focal: float, x: Matrix, y: Matrix) -> _Remap:
    scale = focal / camera.focal_px if camera.focal_px > _SHRUNK * focal else 1.0
    # A picture at another scale has its pixels' centres at (u + 0.5) * scale - 0.5.
    u, v = ((place + 0.5) * scale - 0.5 for place in _pixels(camera, view_SO3_rig, x, y))
    maps = cv2.convertMaps(u.astype(np.float32), v.astype(np.float32), cv2.CV_16SC2)
    return _Remap(scale, maps)


def _pixels(camera: Camera, view_SO3_rig: Matrix, x: Matrix, y: Matrix) -> tuple[Matrix, Matrix]:
    """Where a camera shows the view's rays (x, y, 1): (rows, columns) of recorded pixels, NaN behind its lens."""
    K, R = camera.intrinsics, camera.rotation @ view_SO3_rig.T
    across, down = np.meshgrid(x, y)
    ahead = R[2, 0] * across + R[2, 1] * down + R[2, 2]
    ahead = np.where(ahead > 0.05, ahead, np.nan)
    bent_x, bent_y = camera.lens.distort(
        (R[0, 0] * across + R[0, 1] * down + R[0, 2]) / ahead, (R[1, 0] * across + R[1, 1] * down + R[1, 2]) / ahead
    )
    return K[0, 0] * bent_x + K[0, 1] * bent_y + K[0, 2], K[1, 1] * bent_y + K[1, 2]
