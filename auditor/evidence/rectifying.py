"""Recorded pictures -> those that the ideal cameras of the rig's common view would have taken.

What follows never knows that a rig was not rectified: it gets one picture a camera, one rig, one depth a disparity.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np

from auditor.common_view import CommonView, common_view, is_rectified, recorded_pixels
from auditor.frames import CameraImage, Frame, Skipped
from auditor.rig import Camera, Rig

_SHRUNK = 1.5


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

    def frames(self, frames: Iterable[Frame | Skipped]) -> Iterator[Frame | Skipped]:
        """Frames as `frame` gives them, and those that were skipped."""
        return (self.frame(item) if isinstance(item, Frame) else item for item in frames)

    def frame(self, frame: Frame) -> Frame:
        """The frame as the ideal rig would have recorded it; nothing but pixels changes."""
        if not self.remaps:
            return frame
        return replace(frame, images={number: self.image(image) for number, image in frame.images.items()})

    def image(self, image: CameraImage) -> CameraImage:
        """One picture, (H, W) or (H, W, 3) of its camera's size, as its ideal camera would have taken it."""
        if not self.remaps:
            return image
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


def _rectify(rig: Rig) -> Rectification:
    view = common_view(rig)
    return Rectification(view.rig, {camera.number: _remap(camera, view) for camera in rig.cameras})


def _remap(camera: Camera, view: CommonView) -> _Remap:
    scale = view.focal_px / camera.focal_px if camera.focal_px > _SHRUNK * view.focal_px else 1.0
    pixels = recorded_pixels(camera, view.view_SO3_rig, view.x, view.y)
    # A picture at another scale has its pixels' centres at (u + 0.5) * scale - 0.5.
    u, v = ((place + 0.5) * scale - 0.5 for place in pixels)
    maps = cv2.convertMaps(u.astype(np.float32), v.astype(np.float32), cv2.CV_16SC2)
    return _Remap(scale, maps)
