"""Photometric consistency of two images, by the NCC of patches: at stereo's disparities, and at the LiDAR's."""

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.measurement.disparity.half_resolution import warp
from auditor.measurement.disparity.lidar import RangeMask
from auditor.measurement.disparity.stereo import StereoMap
from auditor.measurement.frame_views import FrameViews
from auditor.measurement.parameters import HALF, LIGHT, MATCHER_RANGE, PATCH_CORRELATION, PHOTOMETRIC_CONSISTENCY
from auditor.measurement.tone_curve import saturates_from, saturation_level
from auditor.model.arrays import Floats32, Image, Indices, Mask

_RADIUS = PATCH_CORRELATION.radius_px
_SIDE = 2 * _RADIUS + 1
_AREA = _SIDE * _SIDE
_NORM_FLOOR = PATCH_CORRELATION.norm_floor  # a patch without texture correlates with nothing
_NEARBY = np.ones(PHOTOMETRIC_CONSISTENCY.nearby_px, dtype=np.uint8)
_AROUND_OCCLUDED = np.ones(PHOTOMETRIC_CONSISTENCY.around_occluded_px, dtype=np.uint8)
_TOGETHER = 4  # of 2 to 26 the fastest
_OVERSAMPLING, _BESIDE_STEPS = PATCH_CORRELATION.oversampling, PATCH_CORRELATION.steps_beside


@dataclass(frozen=True, eq=False)
class Matches:
    """Where the pixels of a reference lie in a source, on the half-resolution (h, w) grid of the reference.

    `column` is the source's column, -1 where it is not known. `seen`: both cameras can see the point.
    """

    column: Floats32
    seen: Mask

    def samples(self, step: int) -> tuple[Indices, Indices, Indices]:
        """(M,) every `step`-th pixel each way that both cameras see: row, column, and the source's column."""
        row, column = (places * step for places in np.nonzero(self.seen[::step, ::step]))
        there = np.rint(self.column[row, column]).astype(np.intp).clip(0, self.column.shape[1] - 1)
        return row, column, there


@dataclass(frozen=True, eq=False)
class Patches:
    """The patches around all pixels (h, w) of an image: their means, and their norms without the means."""

    pixels: Image
    mean: Floats32
    norm: Floats32

    @classmethod
    def of(cls, image: Image) -> "Patches":
        """Those of a grey image (h, w)."""
        mean, power = _mean(image), _mean(_products(image, image))
        power -= mean * mean
        np.clip(power, 0, np.inf, out=power)
        power *= _AREA
        return cls(image, mean, np.asarray(cv2.sqrt(power), dtype=np.float32))

    def ncc(self, other: "Patches") -> Floats32:
        """(h, w) the zero-mean normalised cross-correlation with the patches of another image, -1 to 1."""
        ncc = _mean(_products(self.pixels, other.pixels))
        ncc -= self.mean * other.mean
        ncc *= _AREA
        ncc /= (self.norm + _NORM_FLOOR) * (other.norm + _NORM_FLOOR)
        return np.asarray(ncc, dtype=np.float32)


@dataclass(frozen=True, eq=False)
class PairConsistency:
    """A pair's images compared at stereo's own disparities, on the half-resolution (h, w) grid of the reference.

    `ncc` is the zero-mean normalised cross-correlation of 7 x 7 patches, -1 to 1. `comparable`: both cameras can see
    the point, and it has texture in either image. `inconsistent`: comparable, and no NCC within 5 x 5 pixels is high:
    the two cameras do not see the same, whatever stereo chose there.
    """

    ncc: Floats32
    comparable: Mask
    inconsistent: Mask
    matches: Matches


def matchable(range_px: int) -> RangeMask:
    """The range mask of a matcher; towards the end of its range matches are wrong already."""
    return RangeMask(MATCHER_RANGE.comparable_share * range_px, range_px)


def matches_of(stereo: StereoMap) -> Matches:
    """Where stereo's disparities take the reference's pixels."""
    step = HALF // stereo.step
    disparity, valid = stereo.disparity_px[::step, ::step] / np.float32(HALF), stereo.valid[::step, ::step]
    column = np.arange(disparity.shape[1], dtype=np.float32) - disparity
    unknown = np.isnan(column)
    seen = _inside(valid) & ~_occluded(column, unknown, stereo.range_px // HALF)
    column[unknown] = -1
    return Matches(column, seen)


def photometric_consistency(still: Patches, source: Image, stereo: StereoMap) -> PairConsistency:
    """Warp the source image (h, w) by DM_{i,k} and correlate it with the reference's patches, at half resolution.

    Each image is cut off at the level from which on the other one saturates: a camera that is exposed longer shows no
    texture there, and light that only it sees has other levels in the other camera.
    """
    matches = matches_of(stereo)
    row, column, there = matches.samples(LIGHT.fitted_step)
    of_reference, of_source = still.pixels[row, column], source[row, there]
    end, source_end = saturation_level(still.pixels), saturation_level(source)
    cut = saturates_from(of_reference, of_source, end, source_end)
    source_cut = saturates_from(of_source, of_reference, source_end, end)
    if cut < end:
        still = Patches.of(np.minimum(still.pixels, np.uint8(cut)))
    if source_cut < source_end:
        source = np.minimum(source, np.uint8(source_cut))
    warped = Patches.of(warp(source, matches.column))
    ncc = still.ncc(warped)
    structured = cv2.max(still.norm, warped.norm) > PHOTOMETRIC_CONSISTENCY.textured_norm
    comparable = np.asarray(matches.seen & structured)
    inconsistent = comparable & (cv2.dilate(ncc, _NEARBY) < PHOTOMETRIC_CONSISTENCY.inconsistent)
    return PairConsistency(ncc, comparable, np.asarray(inconsistent), matches)


def matched_samples(seen: FrameViews, i: int, k: int, step: int) -> tuple[Indices, Indices, Indices]:
    """(M,) the samples of a pair's matches."""
    return seen.once(consistency_of, i, k).matches.samples(step)


def patches_of(seen: FrameViews, k: int) -> Patches:
    """The patches of a camera's image."""
    return Patches.of(seen.half_res[k])


def consistency_of(seen: FrameViews, i: int, k: int) -> PairConsistency:
    """A pair's images compared."""
    return photometric_consistency(seen.once(patches_of, k), seen.half_res[i], seen.maps[i, k])


def _inside(valid: Mask) -> Mask:
    """The valid pixels without invalid ones beside them: next to those the true match often lies outside the image."""
    kernel = np.ones((1, PHOTOMETRIC_CONSISTENCY.beside_invalid_px), dtype=np.uint8)
    eroded = cv2.erode(valid.view(np.uint8), kernel, borderType=cv2.BORDER_CONSTANT, borderValue=(1,))
    return np.asarray(eroded, dtype=np.bool_)


def _occluded(column: Floats32, unknown: Mask, range_px: int) -> Mask:
    """The pixels that a nearer surface to their right occludes from the source: its match lies left of theirs.

    What lies farther right than the largest disparity, `range_px`, has its match right of them.
    """
    leftmost, reach = column.copy(), 1
    leftmost[unknown] = np.inf
    while reach < range_px:  # the least of the next 4, 16, 64 ... pixels
        leftmost = np.asarray(cv2.erode(leftmost, _every(reach), anchor=(0, 0)), dtype=np.float32)
        reach *= _TOGETHER
    occluded = (column - leftmost > PHOTOMETRIC_CONSISTENCY.lands_left_px).astype(np.uint8)
    return np.asarray(cv2.dilate(occluded, _AROUND_OCCLUDED), dtype=np.bool_)


def ncc_at(
    reference: Image,
    source: Image,
    row: NDArray[np.integer],
    column: NDArray[np.integer],
    disparity: Floats32,
) -> Floats32:
    """(M,) the largest correlation at given disparities and half a pixel beside them.

    Images (h, w) grey, rows, columns and disparities (M,) are all at half resolution.
    """
    margin = _OVERSAMPLING * (_RADIUS + _RADIUS)
    wide = _OVERSAMPLING * (_SIDE - 1) + 1
    shifts = 2 * _BESIDE_STEPS + 1
    doubled = cv2.copyMakeBorder(
        _oversampled(source), _RADIUS, _RADIUS, margin, margin + _OVERSAMPLING, cv2.BORDER_REPLICATE
    )
    framed = cv2.copyMakeBorder(reference, _RADIUS, _RADIUS, _RADIUS, _RADIUS, cv2.BORDER_REPLICATE)
    patch = framed.ravel()[(row * framed.shape[1] + column)[:, None] + _offsets(framed.shape[1], _SIDE)]
    patch = patch.astype(np.float32)
    patch -= patch.mean(axis=1, keepdims=True)
    norm = np.sqrt(np.einsum("mp,mp->m", patch, patch)) + np.float32(_NORM_FLOOR)
    patch = patch.reshape(row.size, _SIDE, _SIDE)
    middle = np.rint((column - disparity) * _OVERSAMPLING).astype(np.intp)
    start = np.clip(middle, 0, _OVERSAMPLING * (source.shape[1] - 1)) - _OVERSAMPLING * _RADIUS - _BESIDE_STEPS + margin
    stride = doubled.shape[1]
    strips = doubled.ravel()[(row * stride + start)[:, None] + _offsets(stride, wide + shifts - 1)]
    strips = strips.astype(np.float32).reshape(row.size, _SIDE, wide + shifts - 1)
    scores = [_projection(patch, strips[:, :, s : s + wide : _OVERSAMPLING]) for s in range(shifts)]
    return np.asarray(np.max(scores, axis=0) / norm, dtype=np.float32)


def _projection(patch: Floats32, other: Floats32) -> Floats32:
    """(M,) products of patches without their means and others, over the others' norms."""
    total, power = np.einsum("mrc->m", other), np.einsum("mrc,mrc->m", other, other)
    norm = np.sqrt(np.maximum(power - total * total / np.float32(_AREA), 0)) + np.float32(_NORM_FLOOR)
    return np.asarray(np.einsum("mrc,mrc->m", patch, other) / norm, dtype=np.float32)


def _products(a: Image, b: Image) -> NDArray[np.uint16]:
    return np.multiply(a, b, dtype=np.uint16)


def _mean(values: NDArray[np.unsignedinteger]) -> Floats32:
    """The means of patches: sums of whole numbers are exact, and faster than those of fractions."""
    mean = np.asarray(cv2.boxFilter(values, cv2.CV_32F, (_SIDE, _SIDE), normalize=False), dtype=np.float32)
    mean /= np.float32(_AREA)
    return mean


def _oversampled(image: Image) -> Image:
    """(h, 2 w): each pixel, then its mean with the next."""
    following = np.asarray(cv2.copyMakeBorder(image[:, 1:], 0, 0, 0, 1, cv2.BORDER_REPLICATE), dtype=np.uint8)
    mean = (image & following) + ((image ^ following) >> 1)  # without overflow
    return np.asarray(cv2.merge([image, mean]), dtype=np.uint8).reshape(len(image), -1)


@cache
def _every(step: int) -> Image:
    """A kernel of _TOGETHER pixels in a row, `step` apart."""
    kernel = np.zeros((1, (_TOGETHER - 1) * step + 1), dtype=np.uint8)
    kernel[0, ::step] = 1
    return kernel


@cache
def _offsets(stride: int, width: int) -> Indices:
    rows = np.arange(_SIDE, dtype=np.intp) * stride
    return np.asarray((rows[:, None] + np.arange(width, dtype=np.intp)).ravel(), dtype=np.intp)
