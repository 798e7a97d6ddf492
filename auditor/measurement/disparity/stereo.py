"""DM_{i,k}: the disparity map that a source camera gives in a reference camera's view, and its texture."""

from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

import cv2
import numpy as np

from auditor.measurement.disparity.matchers.interface import Matcher, PairMatcher
from auditor.measurement.parameters import HALF, TEXTURE
from auditor.model.arrays import Floats32, Image, Mask

_SOBEL_PX, _SOBEL_GAIN = 3, 8
"""The smallest Sobel kernel, and the sum of its weights' sizes."""


Key = TypeVar("Key", bound=Hashable)


@dataclass(frozen=True, eq=False)
class StereoMap:
    """DM_{i,k}, dense, one value a pixel of the matcher's grid.

    `disparity_px` (h, w) in full-resolution pixels at baseline b_{i,k}, NaN unknown. `valid` (h, w): a disparity was
    found and its match lies inside the source image. `textured` (h, w): the reference has texture there, or the source
    does at the match. Grid pixels are `step` full-resolution ones wide; disparities end at `range_px`.
    """

    disparity_px: Floats32
    valid: Mask
    textured: Mask
    step: int
    range_px: int


def stereo_map(
    matcher: Matcher,
    reference: Image,
    source: Image,
    reference_texture: Mask,
    source_texture: Mask,
) -> StereoMap:
    """Match two images, (H, W) grey or (H, W, 3) BGR; their texture masks are at half resolution."""
    return _stereo_map(matcher, matcher.match(reference, source), reference_texture, source_texture)


def stereo_maps(
    matcher: PairMatcher,
    images: Mapping[Key, Image],
    texture: Mapping[Key, Mask],
    pairs: Iterable[tuple[Key, Key]],
) -> dict[tuple[Key, Key], StereoMap]:
    """DM_{i,k} for each pair (i, k) of keys, as `stereo_map` gives them, of a matcher that takes all pairs at once.

    A key is the name of an image: a camera, or a frame and a camera.
    """
    pairs, cameras = list(pairs), list(images)
    places = [(cameras.index(k), cameras.index(i)) for i, k in pairs]
    disparities = matcher.match_pairs(list(images.values()), places)
    return {
        (i, k): _stereo_map(matcher, disparity, texture[k], texture[i])
        for (i, k), disparity in zip(pairs, disparities, strict=True)
    }


def within(stereo: StereoMap, reference_sees: Mask, source_sees: Mask) -> StereoMap:
    """The map, valid only where the reference sees and the source does at the match; (H, W) full-resolution masks."""
    seen = seen_by_both(stereo.disparity_px, stereo.step, reference_sees, source_sees)
    return replace(stereo, valid=stereo.valid & seen)


def seen_by_both(disparity_px: Floats32, step: int, reference_sees: Mask, source_sees: Mask) -> Mask:
    """(h, w) mask of the disparities whose pixel the reference sees and whose match the source sees."""
    width = disparity_px.shape[1]
    match = np.nan_to_num(np.rint(np.arange(width) - disparity_px / step))
    column = np.clip(match, 0, width - 1).astype(np.intp)
    there = np.take_along_axis(source_sees[::step, ::step], column, axis=1)
    return np.asarray(there & reference_sees[::step, ::step])


def textured(half: Image) -> Mask:
    """(h, w) mask of the pixels of a half-resolution (h, w) grey image whose surroundings have texture.

    Texture is the root mean square of the horizontal Sobel gradient, in grey levels a pixel.
    """
    gradient = cv2.Sobel(half, cv2.CV_32F, 1, 0, ksize=_SOBEL_PX, scale=1 / _SOBEL_GAIN)
    power = cv2.boxFilter(gradient * gradient, cv2.CV_32F, TEXTURE.window_px)
    return np.asarray(power > TEXTURE.fewest_levels * TEXTURE.fewest_levels)


def _stereo_map(matcher: Matcher, disparity: Floats32, reference_texture: Mask, source_texture: Mask) -> StereoMap:
    height, width = disparity.shape
    step = matcher.step
    u = np.arange(width, dtype=np.float32)
    match = u - disparity / np.float32(step)
    valid = match >= 0  # False where the disparity is NaN
    match[~valid] = 0
    place = match.astype(np.int32)
    place += np.arange(height, dtype=np.int32)[:, None] * width
    texture = _on_grid(source_texture, step, height, width).take(place)
    texture |= _on_grid(reference_texture, step, height, width)
    return StereoMap(disparity, valid, texture, step, matcher.range_px)


def _on_grid(texture: Mask, step: int, height: int, width: int) -> Mask:
    """A half-resolution mask on the matcher's (height, width) grid."""
    repeat = HALF // step
    if repeat > 1:
        texture = texture.repeat(repeat, axis=0).repeat(repeat, axis=1)
    return texture[:height, :width]
