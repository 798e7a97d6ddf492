"""Light that one camera of a pair alone sees, and light that it alone lacks.

Each camera's brightness is predicted from the other's image at stereo's disparities, through a tone curve. What is
brighter or darker than all predictions nearby is a residual, in shares of what was predicted: gains and exposures
multiply, and so do most errors. Light only adds, so its sign says which of the two cameras it fell into; which of them
is wrong about the scene only further cameras can say (`identification.statistics`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from auditor.measurement.checks.coloured_light import coloured_light
from auditor.measurement.checks.photometric_consistency import consistency_of
from auditor.measurement.disparity.half_resolution import warp
from auditor.measurement.frame_views import FrameViews
from auditor.measurement.parameters import LIGHT
from auditor.measurement.tone_curve import Classes, chroma_classes, predict, saturation_level
from auditor.model.arrays import Floats32, Image, Mask

_NEARBY = np.ones(LIGHT.nearby_px, dtype=np.uint8)
WHITE = np.uint8(255)
_EVERY = LIGHT.fitted_step
UNITS = np.float32(LIGHT.level) + np.float32(LIGHT.share) * np.arange(256, dtype=np.uint8)
"""By predicted level, the residual of 1 in grey levels."""


@dataclass(frozen=True, eq=False)
class CameraLevels:
    """One camera at half resolution: (h, w) grey, and where it has colours (h, w, 3) BGR."""

    grey: Image
    colour: Image | None = None

    @cached_property
    def levels(self) -> Image:
        """(h, w) grey means over 7 x 7 pixels."""
        return _means(self.grey)

    @cached_property
    def saturation(self) -> int:
        """The grey level from which on it saturates."""
        return saturation_level(self.grey)

    @cached_property
    def channels(self) -> tuple[Image, ...]:
        """The (h, w) means of each channel over 7 x 7 pixels; none of a grey camera."""
        return () if self.colour is None else _split(_means(self.colour))

    @cached_property
    def channel_saturations(self) -> tuple[int, ...]:
        """The level from which on each channel saturates."""
        return () if self.colour is None else tuple(saturation_level(one) for one in _split(self.colour))

    @cached_property
    def classes(self) -> Classes:
        """(h, w) the classes of chroma of a colour camera."""
        return chroma_classes(*self.channels)


@dataclass(frozen=True, eq=False)
class LightDifference:
    """`residual` (h, w), -1 to 1 in the reference's view: + where it is brighter than the source predicts.

    `comparable` (h, w): both cameras see the point, and not both are saturated there. `coloured` (h, w), of two colour
    cameras: the same of light of one colour.
    """

    residual: Floats32
    comparable: Mask
    coloured: Floats32 | None = None


def light_difference(reference: CameraLevels, source: CameraLevels, column: Floats32, seen: Mask) -> LightDifference:
    """Compare two cameras; `column` (h, w) is where each of the reference's pixels lies in the source, where `seen`."""
    warped = column * seen
    *others, levels = _warped([*(source.channels if reference.channels else ()), source.levels], warped)
    coloured = None
    if reference.channels and source.channels:
        channels = _channels(reference, source, others)
        residual, coloured = _of_colours(channels, seen), coloured_light(channels, seen)
    elif reference.channels:
        grey = LevelPair(levels, reference.levels, source.saturation, reference.saturation)
        residual = -_of_levels(grey, seen, reference.classes)
    else:
        classes = warp(source.classes, warped, cv2.INTER_NEAREST) if source.channels else None
        grey = LevelPair(reference.levels, levels, reference.saturation, source.saturation)
        residual = _of_levels(grey, seen, classes)
    comparable = seen & ~((reference.levels >= reference.saturation) & (levels >= source.saturation))
    residual = np.clip(residual, -1, 1) * comparable
    return LightDifference(residual, comparable, None if coloured is None else coloured * comparable)


def view_of(seen: FrameViews, camera: int) -> CameraLevels:
    """One camera's half-resolution images, grey and where it has them colours."""
    return CameraLevels(seen.half_res[camera], seen.colours.get(camera))


def difference_of(seen: FrameViews, i: int, k: int) -> LightDifference:
    """The light differences of a pair."""
    matches = seen.once(consistency_of, i, k).matches
    return light_difference(seen.once(view_of, k), seen.once(view_of, i), matches.column, matches.seen)


def _warped(images: Sequence[Image], column: Floats32) -> tuple[Image, ...]:
    """Some (h, w) images at once: four take little more time than one."""
    return _split(warp(np.asarray(cv2.merge(images), dtype=np.uint8), column))


@dataclass(frozen=True, eq=False)
class LevelPair:
    """Levels (h, w) of two cameras, in the reference's view, and from which level on each saturates."""

    value: Image
    other: Image
    saturation: int
    other_saturation: int

    def sampled(self, seen: Mask) -> tuple[Image, Image, Mask]:
        """(N,) levels of the source and of the reference, every fourth pixel each way, and which of them are usable.

        Those are what both see and neither saturates in.
        """
        s, t = (one[::_EVERY, ::_EVERY].ravel() for one in (self.other, self.value))
        both = seen[::_EVERY, ::_EVERY].ravel()
        return s, t, np.asarray(both & (s < self.other_saturation) & (t < self.saturation))

    def samples(self, seen: Mask) -> tuple[Image, Image]:
        """(M,) levels of the source and of the reference that are usable."""
        s, t, usable = self.sampled(seen)
        return s[usable], t[usable]

    @property
    def saturated(self) -> tuple[Mask, Mask]:
        """Where it saturates in the reference, and in the source."""
        return np.asarray(self.value >= self.saturation), np.asarray(self.other >= self.other_saturation)

    def residual(self, predicted: Image) -> Floats32:
        """(h, w) by what share the reference lies above, or below, all that is predicted within 5 x 5 pixels.

        Where the source is saturated there is no upper limit, and what is saturated itself is not darker.
        """
        saturated, source_saturated = self.saturated
        highest = cv2.dilate(cv2.max(predicted, source_saturated * WHITE), _NEARBY)
        lowest = cv2.erode(predicted, _NEARBY)
        lowest *= ~saturated
        nearest = cv2.min(cv2.max(self.value, lowest), highest)
        residual = np.asarray(cv2.subtract(self.value, nearest, dtype=cv2.CV_32F), dtype=np.float32)
        residual /= cv2.LUT(nearest, UNITS)
        return residual


def _channels(reference: CameraLevels, source: CameraLevels, others: Sequence[Image]) -> list[LevelPair]:
    """The channels of two cameras; `others` are the source's in the reference's view."""
    saturations = reference.channel_saturations, source.channel_saturations
    return [LevelPair(*channel) for channel in zip(reference.channels, others, *saturations, strict=True)]


def _of_colours(channels: Sequence[LevelPair], seen: Mask) -> Floats32:
    """The mean of the channels' residuals: light of one colour shows in one of them, and errors seldom in all."""
    mean, *others = (np.clip(_of_levels(channel, seen), -1, 1) for channel in channels)
    for residual in others:  # in place: `np.mean` copies all of them first
        mean += residual
    mean /= np.float32(len(channels))
    return mean


def _of_levels(channel: LevelPair, seen: Mask, classes: Classes | None = None) -> Floats32:
    """The residual of levels; grey ones are predicted from a colour camera's by its classes (h, w) of chroma."""
    prediction = predict(*channel.sampled(seen), None if classes is None else classes[::_EVERY, ::_EVERY].ravel())
    return channel.residual(prediction.saturated_from(channel.other_saturation).of(channel.other, classes))


def _split(colour: Image) -> tuple[Image, ...]:
    return tuple(np.asarray(channel, dtype=np.uint8) for channel in cv2.split(colour))


def _means(image: Image) -> Image:
    return np.asarray(cv2.blur(image, LIGHT.mean_px), dtype=np.uint8)
