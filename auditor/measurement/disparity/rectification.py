"""Rectification: recorded images become those that the ideal cameras of the rig's common view would record.

All later steps work on rectified rigs only: one image a camera, one depth a disparity. Images of few pixels are
enlarged. Cameras that do not stand on one line have no rows in common. Two of them always do: each pair is a rig of two
with a view of its own, and what is measured there is warped to the common view. Rotated to common rows, images are not
upright rectangles any more: a pair's view is wide enough for all that both see, and valid masks mark what that is.
"""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache

import cv2
import numpy as np

from auditor.errors import RigError
from auditor.measurement.disparity.warping import PairToSharedView
from auditor.measurement.parameters import RECTIFICATION
from auditor.model.arrays import Mask
from auditor.model.checks import Pair
from auditor.model.frames import CameraImage, Frame, SkippedFrame
from auditor.model.optics.common_view import IdealView, common_view, measured_view, recorded_pixels, sees
from auditor.model.rig import LIDAR, Camera, Rig, Triple

_BORDER = np.ones(RECTIFICATION.border_px, dtype=np.uint8)


@dataclass(frozen=True, eq=False)
class _Remap:
    """How one camera's image becomes rectified: shrunk by `scale` first, then remapped.

    `seen` (H, W) are the pixels that lie well inside it.
    """

    scale: float
    maps: tuple[cv2.typing.MatLike, cv2.typing.MatLike]
    seen: Mask


@dataclass(frozen=True, eq=False)
class RigRectification:
    """`rig` is the ideal rig: same sensors, same numbers, cameras of one size and focal length that look the same way.

    Where they are so already it is the rig itself, there are no remaps, and frames stay what they are. Only where
    cameras do not stand on one line, the `pairs` (i, k) that are matched have views of their own: the ideal rig's
    images are then for display, and its view is the one that pairs are warped to.
    """

    rig: Rig
    remaps: Mapping[int, _Remap]
    pairs: Mapping[Pair, "PairView"] = field(default_factory=dict)

    @property
    def triples(self) -> tuple[Triple, ...]:
        """The triples that can be measured: the rig's, but for a fallback whose cameras see nothing in common."""
        measured = self.rig.measured_triples
        return tuple(one for one in measured if not self.pairs or one != self.rig.fallback or one[1:] in self.pairs)

    def frames(self, frames: Iterable[Frame | SkippedFrame]) -> Iterator[Frame | SkippedFrame]:
        """Frames as `frame` gives them, and those that were skipped."""
        return (self.frame(item) if isinstance(item, Frame) else item for item in frames)

    def frame(self, frame: Frame) -> Frame:
        """The frame as the ideal rig would have recorded it; nothing but pixels changes."""
        if not self.remaps:
            return frame
        return replace(frame, images={number: self.image(image) for number, image in frame.images.items()})

    def image(self, image: CameraImage) -> CameraImage:
        """One image, (H, W) or (H, W, 3) of its camera's size, as its ideal camera would have recorded it."""
        if not self.remaps:
            return image
        remap = self.remaps[image.sensor]
        pixels: cv2.typing.MatLike = image.pixels
        if remap.scale < 1:
            # Remapping every second pixel would alias fine texture.
            pixels = cv2.resize(pixels, None, fx=remap.scale, fy=remap.scale, interpolation=cv2.INTER_AREA)
        # The maps stay inside the image up to rounding; at its very border the last pixel is repeated.
        pixels = cv2.remap(pixels, *remap.maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return replace(image, pixels=np.asarray(pixels, dtype=np.uint8))


@dataclass(frozen=True, eq=False)
class PairView:
    """The own view of cameras i < k: `seen` rectifies the rig of these two, in which they are S_1 and S_2."""

    cameras: Pair
    seen: RigRectification
    to_shared: PairToSharedView

    @property
    def valid_masks(self) -> dict[int, Mask]:
        """(H, W) by camera of the pair the pixels of the view that it sees, well inside its image."""
        return {number: remap.seen for number, remap in self.seen.remaps.items()}

    def frame(self, frame: Frame) -> Frame:
        """What the pair's rig recorded of a frame, rectified; cameras missing in the frame are missing here."""
        return self.seen.frame(self.recorded(frame))

    def recorded(self, frame: Frame) -> Frame:
        """What the pair's rig recorded of a frame."""
        sensors = dict(enumerate((LIDAR, *self.cameras)))
        images = {
            number: replace(frame.images[sensor], sensor=number)
            for number, sensor in sensors.items()
            if sensor in frame.images
        }
        presence = {n: frame.presence[sensor] for n, sensor in sensors.items() if sensor in frame.presence}
        return replace(frame, images=images, presence=presence)


@lru_cache(maxsize=8)
def rectification(rig: Rig) -> RigRectification:
    """The rectification of a rig's frames, computed once a rig.

    Raises RigError where the cameras, or two of them that have to be matched in a view of their own, see nothing in
    common.
    """
    view = measured_view(rig)
    if view is None:
        return RigRectification(rig, {})
    pairs = {} if rig.shares_view else _pair_views(rig, view)
    return RigRectification(view.rig, _remaps(rig, view), pairs)


def shown_rectification(rig: Rig) -> RigRectification:
    """How a rig's frames become those that people are shown: rectified ones stay as they are recorded.

    Raises RigError as `rectification` does.
    """
    return RigRectification(rig, {}) if rig.is_rectified else rectification(rig)


def _pair_views(rig: Rig, whole: IdealView) -> dict[Pair, PairView]:
    views = {pair: _pair_view(rig, pair, whole) for pair in rig.required_pairs}
    if rig.fallback is not None:
        pair = rig.fallback[1:]
        with suppress(RigError):  # as of a camera that stands behind the other: the rig is measured without it
            views[pair] = _pair_view(rig, pair, whole)
    return views


def _pair_view(rig: Rig, pair: Pair, whole: IdealView) -> PairView:
    of_two = rig.pair(*pair)
    view = common_view(of_two, widest=True)
    to_shared = PairToSharedView(view.rig.camera(1), whole.rig.camera(1), view.view_SO3_rig @ whole.view_SO3_rig.T)
    return PairView(pair, RigRectification(view.rig, _remaps(of_two, view)), to_shared)


def _remaps(rig: Rig, view: IdealView) -> dict[int, _Remap]:
    return {camera.number: _remap(camera, view) for camera in rig.cameras}


def _remap(camera: Camera, view: IdealView) -> _Remap:
    scale = (
        view.focal_px / camera.focal_px if camera.focal_px > RECTIFICATION.shrunk_first_from * view.focal_px else 1.0
    )
    pixels = recorded_pixels(camera, view.view_SO3_rig, view.x, view.y)
    inside = sees(pixels, camera, 1 / view.scale).astype(np.uint8)
    seen = np.asarray(cv2.erode(inside, _BORDER, borderType=cv2.BORDER_CONSTANT, borderValue=(1,)), dtype=np.bool_)
    # An image at another scale has its pixels' centres at (u + 0.5) * scale - 0.5.
    # Rays behind the lens are not seen; their pixels may hold anything.
    u, v = (np.nan_to_num((place + 0.5) * scale - 0.5, nan=-1.0) for place in pixels)
    maps = cv2.convertMaps(u.astype(np.float32), v.astype(np.float32), cv2.CV_16SC2)
    return _Remap(scale, maps, seen)
