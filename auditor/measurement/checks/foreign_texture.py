"""Foreign texture: a camera shows something else where two others agree what is there, and how far away.

Whatever is painted into one picture matches something in the others, here and there: of the disparities that stereo
tries one always correlates a little. So a camera is not asked where it matches itself. Where two other cameras show the
same at the disparity that stereo found between them, that disparity says where the camera has to show it as well.
Clean cameras do nearly everywhere: what hides it from one of three on a line lies nearer, and is known. Pictures are
compared at quarter resolution: "quarter px" are pixels of it.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from auditor.measurement.checks.photometric_consistency import Patches, consistency_of
from auditor.measurement.disparity.half_resolution import halve, warp
from auditor.measurement.frame_views import FrameViews
from auditor.measurement.parameters import PATCH_CORRELATION, PHOTOMETRIC_CONSISTENCY
from auditor.model.arrays import Floats32, Image, Mask
from auditor.model.parameters import BY_HAND, parameter

_REAL = "62 clean frames of three real drives, and patches of another street painted in (docs/decisions.md)"


@dataclass(frozen=True)
class ForeignTexture:
    """How much of a window of one camera is not what two others agree on."""

    window_px: tuple[int, int] = parameter((12, 16), unit="quarter px, rows and columns", source=_REAL)
    pseudo_count: int = parameter(30, unit="quarter px that are added to those of a window", source=_REAL)
    beyond: float = parameter(
        2.1, unit="times the distance of two cameras, of a third one from the farther of them, at most", source=_REAL
    )
    nearer_px: float = parameter(1.0, unit="quarter px of disparity by which what is nearer hides it", source=BY_HAND)
    beside_px: int = parameter(1, unit="quarter px either way that it may lie beside its place", source=_REAL)
    smoothed_px: int = parameter(5, unit="quarter px, window of a median of disparities", source=BY_HAND)
    sure_px: tuple[int, int] = parameter((3, 3), unit="half px that all have to agree", source=BY_HAND)
    hiding_px: tuple[int, int] = parameter((3, 5), unit="quarter px that what is nearer hides", source=BY_HAND)


NUMBERS = ForeignTexture()
_QUARTER = 2
"""Half px a quarter px is wide."""
_SURE, _HIDING = (np.ones(size, dtype=np.uint8) for size in (NUMBERS.sure_px, NUMBERS.hiding_px))


@dataclass(frozen=True, eq=False)
class _Agreement:
    """What a pair agrees on, at quarter resolution in its reference's view: `surfaces` and their `disparity` (h, w).

    `seen` are all matches, also those that are less sure; they may hide something.
    """

    disparity: Floats32
    surfaces: Mask
    seen: Mask

    def column(self, share: float) -> Floats32:
        """(h, w) where a camera has each pixel that lies a share of the way from the reference to the source."""
        width = self.disparity.shape[1]
        return np.arange(width, dtype=np.float32) - self.disparity * np.float32(share)

    def hidden(self, column: Floats32) -> Mask:
        """(h, w) what a nearer surface hides from a camera that has the pixels in these columns."""
        place = np.clip(np.rint(column), 0, column.shape[1] - 1).astype(np.intp)
        place += np.arange(len(column), dtype=np.intp)[:, None] * column.shape[1]
        nearest = np.zeros(column.size, dtype=np.float32)
        np.maximum.at(nearest, place[self.seen], self.disparity[self.seen])
        nearest = np.asarray(cv2.dilate(nearest.reshape(column.shape), _HIDING), dtype=np.float32)
        return np.asarray(nearest.take(place) > self.disparity + np.float32(NUMBERS.nearer_px))


def measure_foreign_texture(seen: FrameViews, i: int, k: int) -> dict[int, float]:
    """By other camera, how much of a window, 0 to 1, is not what a pair agrees on; of those that it can tell it of."""
    others = (camera for camera in seen.half_res if camera not in (i, k))
    return {one: _foreign_share(seen, i, k, one) for one in others if _is_told(seen, i, k, one)}


def _is_told(seen: FrameViews, source: int, reference: int, camera: int) -> bool:
    """Whether a camera stands so that what two others agree on says where it has to show it."""
    place = _share_of_way(seen, source, reference, camera)
    return max(abs(place), abs(1 - place)) <= NUMBERS.beyond


def _share_of_way(seen: FrameViews, source: int, reference: int, camera: int) -> float:
    """Where a camera stands on the way from the reference, 0, to the source, 1."""
    start, end, place = (float(seen.rig.camera(one).centre_m[0]) for one in (reference, source, camera))
    return (place - start) / (end - start)


def _foreign_share(seen: FrameViews, source: int, reference: int, camera: int) -> float:
    """How much of a window of a camera is neither what the source shows there nor what the reference does."""
    agreed = seen.once(_agreement, source, reference)
    column = agreed.column(_share_of_way(seen, source, reference, camera))
    width, margin = column.shape[1], PATCH_CORRELATION.radius_px + NUMBERS.beside_px
    there = agreed.surfaces & (column >= margin) & (column <= width - 1 - margin) & ~agreed.hidden(column)
    beside = range(-NUMBERS.beside_px, NUMBERS.beside_px + 1)
    picture = seen.once(_picture, camera)
    own = [Patches.of(warp(picture, column + np.float32(shift))) for shift in beside]
    compared = there & (own[NUMBERS.beside_px].norm > PHOTOMETRIC_CONSISTENCY.textured_norm)
    agreeing = seen.once(_patches_of_source, source, reference), seen.once(_patches_of, reference)
    best = [np.maximum.reduce([patches.ncc(one) for one in own]) for patches in agreeing]
    return min(_largest(compared, compared & (ncc < PHOTOMETRIC_CONSISTENCY.inconsistent)) for ncc in best)


def _agreement(seen: FrameViews, source: int, reference: int) -> _Agreement:
    """What two cameras agree on: their patches correlate well at stereo's disparity."""
    consistency = seen.once(consistency_of, source, reference)
    column, seen_by_both = consistency.matches.column, consistency.matches.seen
    sure = (seen_by_both & (consistency.ncc >= PATCH_CORRELATION.consistent)).view(np.uint8)
    height, width = seen.once(_picture, reference).shape
    disparity = (np.arange(column.shape[1], dtype=np.float32) - column)[::_QUARTER, ::_QUARTER] / np.float32(_QUARTER)
    smooth = cv2.medianBlur(np.ascontiguousarray(disparity[:height, :width]), NUMBERS.smoothed_px)
    surfaces, matched = cv2.erode(sure, _SURE)[::_QUARTER, ::_QUARTER] > 0, seen_by_both[::_QUARTER, ::_QUARTER]
    return _Agreement(np.asarray(smooth, np.float32), surfaces[:height, :width], matched[:height, :width])


def _patches_of_source(seen: FrameViews, source: int, reference: int) -> Patches:
    """The patches of a pair's source, warped into its reference's view."""
    agreed = seen.once(_agreement, source, reference)
    return Patches.of(warp(seen.once(_picture, source), agreed.column(1.0)))


def _patches_of(seen: FrameViews, camera: int) -> Patches:
    return Patches.of(seen.once(_picture, camera))


def _picture(seen: FrameViews, camera: int) -> Image:
    return halve(seen.half_res[camera])


def _largest(compared: Mask, foreign: Mask) -> float:
    """The largest share of a window's pixels that are foreign."""
    size = NUMBERS.window_px[::-1]
    counted, those = (cv2.boxFilter(one.astype(np.float32), -1, size, normalize=False) for one in (compared, foreign))
    return float((those / (counted + np.float32(NUMBERS.pseudo_count))).max())
