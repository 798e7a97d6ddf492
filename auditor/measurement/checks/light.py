"""Light that one camera of a pair alone sees, and light that it alone lacks.

Each camera's brightness is predicted from the other's image at stereo's disparities, through a tone curve. What is
brighter or darker than all predictions nearby is a residual, in shares of what was predicted: gains and exposures
multiply, and so do most errors. Light only adds, so its sign says which of the two cameras it fell into; which of them
is wrong about the scene only further cameras can say (`identification.statistics`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from auditor.measurement.checks.coloured_light import coloured_light
from auditor.measurement.checks.tone_curve import (
    Classes,
    Prediction,
    chroma_classes,
    no_bluer_than_green,
    predict,
    saturation_level,
)
from auditor.measurement.disparity.row_warp import warp
from auditor.measurement.parameters import CHROMA, LIGHT
from auditor.model.arrays import Floats32, Image, Mask

_NEARBY = np.ones(LIGHT.nearby_px, dtype=np.uint8)
_WHITE = np.uint8(255)
_EVERY = LIGHT.fitted_step
_LEVELS = np.arange(256, dtype=np.uint8)
_UNITS, _INFRARED_UNITS = (  # by predicted level, the residual of 1 in grey levels
    np.float32(level) + np.float32(share) * _LEVELS
    for level, share in ((LIGHT.level, LIGHT.share), (LIGHT.infrared_level, LIGHT.infrared_share))
)
_CHROMA = _LEVELS / np.float32(255)
_SPREAD = 1 + np.float32(LIGHT.colour_spread) * np.minimum(_CHROMA, np.float32(LIGHT.surface_chroma) - _CHROMA).clip(0)
_DIM = (_LEVELS * np.float32(LIGHT.infrared_dim)).astype(np.uint8)


@dataclass(frozen=True, eq=False)
class Colours:
    """What a colour camera sees, (h, w) each: its grey `luma`, its `brightest` channel, and the `classes` of chroma.

    `chroma` is by how much the brightest channel exceeds the darkest; 255 is all of it, the light of one line.
    """

    luma: Image
    brightest: Image
    chroma: Image
    classes: Classes


@dataclass(frozen=True, eq=False)
class View:
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
    def colours(self) -> Colours:
        """Those of a colour camera."""
        blue, green, red = self.channels
        brightest, darkest = (np.asarray(of(of(blue, green), red), dtype=np.uint8) for of in (cv2.max, cv2.min))
        chroma = (brightest - darkest) / (brightest + np.float32(CHROMA.dark / len(self.channels))) * np.float32(_WHITE)
        return Colours(self.levels, brightest, chroma.astype(np.uint8), chroma_classes(blue, green, red))


@dataclass(frozen=True, eq=False)
class LightDifference:
    """`residual` (h, w), -1 to 1 in the reference's view: + where it is brighter than the source predicts.

    `comparable` (h, w): both cameras see the point, and not both are saturated there. `coloured` (h, w), of two colour
    cameras: the same of light of one colour. `excused` and `source_excused` (h, w): where it shows nothing of the
    reference, or of the source, that the two do not see the same, since one of them overexposes what is bright there.
    """

    residual: Floats32
    comparable: Mask
    excused: Mask
    source_excused: Mask
    coloured: Floats32 | None = None


def light_difference(reference: View, source: View, column: Floats32, seen: Mask) -> LightDifference:
    """Compare two cameras; `column` (h, w) is where each of the reference's pixels lies in the source, where `seen`."""
    warp = _Warp(column * seen)
    *others, levels = warp.of_all([*(source.channels if reference.channels else ()), source.levels])
    coloured = colours = None
    if reference.channels and source.channels:
        channels = _channels(reference, source, others)
        residual, coloured = _of_colours(channels, seen), coloured_light(channels, seen)
    elif reference.channels:
        colours = reference.colours
        residual = -_of_mixture(levels, source.saturation, colours, reference.saturation, seen)
    elif source.channels:
        colours = warp.of_colours(source.colours, levels)
        residual = _of_mixture(reference.levels, reference.saturation, colours, source.saturation, seen)
    else:
        residual = _alike(reference.levels, levels, seen, reference.saturation, source.saturation)
    saturated, source_saturated = reference.levels >= reference.saturation, levels >= source.saturation
    comparable = seen & ~(saturated & source_saturated)
    residual = np.clip(residual, -1, 1) * comparable
    # A facula over most of an image bends the curve until it predicts it: what it saturates is dark in the other.
    bright = cv2.min(reference.levels, levels) >= LIGHT.overexposed_from
    as_predicted = comparable & bright & (np.abs(residual) < LIGHT.as_predicted)
    excused, source_excused = as_predicted & saturated, as_predicted & source_saturated
    if colours is not None:
        of_colours, of_grey = (source_excused, excused) if source.channels else (excused, source_excused)
        neither = _at_fault_is_neither(of_colours, of_grey, colours)
        excused, source_excused = excused | neither, source_excused | neither
    return LightDifference(
        residual,
        comparable,
        excused=np.asarray(excused),
        source_excused=np.asarray(source_excused),
        coloured=None if coloured is None else coloured * comparable,
    )


@dataclass(frozen=True, eq=False)
class _Warp:
    column: Floats32

    def of(self, image: Image, how: int = cv2.INTER_LINEAR) -> Image:
        return warp(image, self.column, how)

    def of_all(self, images: Sequence[Image]) -> tuple[Image, ...]:
        """Some (h, w) images at once: four take little more time than one."""
        return _split(self.of(np.asarray(cv2.merge(images), dtype=np.uint8)))

    def of_colours(self, colours: Colours, luma: Image) -> Colours:
        """All of them; `luma` is warped already."""
        brightest, chroma = self.of_all([colours.brightest, colours.chroma])
        return Colours(luma, brightest, chroma, self.of(colours.classes, cv2.INTER_NEAREST))


@dataclass(frozen=True, eq=False)
class Channel:
    """One channel of two colour cameras, (h, w) in the reference's view, and from which level on each saturates."""

    value: Image
    other: Image
    saturation: int
    other_saturation: int

    def samples(self, seen: Mask) -> tuple[Image, Image]:
        """(M,) levels of the source and of the reference, where both see and neither saturates."""
        s, t = (one[::_EVERY, ::_EVERY].ravel() for one in (self.other, self.value))
        usable = seen[::_EVERY, ::_EVERY].ravel() & (s < self.other_saturation) & (t < self.saturation)
        return s[usable], t[usable]

    @property
    def saturated(self) -> tuple[Mask, Mask]:
        """Where it saturates in the reference, and in the source."""
        return np.asarray(self.value >= self.saturation), np.asarray(self.other >= self.other_saturation)

    def residual(self, predicted: Image) -> Floats32:
        """By what share it lies above or below what is predicted."""
        return _relative(self.value, predicted, *self.saturated)


def _channels(reference: View, source: View, others: Sequence[Image]) -> list[Channel]:
    """The channels of two cameras; `others` are the source's in the reference's view."""
    saturations = reference.channel_saturations, source.channel_saturations
    return [Channel(*channel) for channel in zip(reference.channels, others, *saturations, strict=True)]


def _of_colours(channels: Sequence[Channel], seen: Mask) -> Floats32:
    """The mean of the channels' residuals: light of one colour shows in one of them, and errors seldom in all."""
    mean, *others = (
        np.clip(_alike(one.value, one.other, seen, one.saturation, one.other_saturation), -1, 1) for one in channels
    )
    for residual in others:  # in place: `np.mean` copies all of them first
        mean += residual
    mean /= np.float32(len(channels))
    return mean


def _alike(value: Image, other: Image, seen: Mask, saturation: int, other_saturation: int) -> Floats32:
    """The residual of levels of one kind."""
    predicted = _prediction(other, value, seen, other_saturation, saturation).of(other)
    return _relative(value, predicted, value >= saturation, other >= other_saturation)


def _of_mixture(greys: Image, grey_saturation: int, colours: Colours, saturation: int, seen: Mask) -> Floats32:
    """How much brighter the grey camera is than the colour camera predicts.

    The stronger the colour of a surface, the less its luma tells of what a wider spectrum sees: a violet wall or yellow
    paint may be darker. No surface has so strong a colour as a laser.
    """
    luma, classes = colours.luma, colours.classes
    predicted = _prediction(luma, greys, seen, saturation, grey_saturation, classes).of(luma, classes)
    saturated = colours.brightest >= min(saturation, LIGHT.colour_saturation)
    residual = _relative(greys, predicted, greys >= grey_saturation, saturated, infrared=True)
    return np.asarray(cv2.max(residual, residual / cv2.LUT(colours.chroma, _SPREAD)), dtype=np.float32)


def _at_fault_is_neither(of_colours: Mask, of_grey: Mask, colours: Colours) -> Mask:
    """(h, w) what excuses both a colour and a grey camera, of what excuses the one and what excuses the other.

    In near infrared the sky is dark and leaves are white. So what overexposes in colours may have a texture in grey,
    and the reverse, and neither is at fault: but no leaf is blue or magenta, as are stripes that radio waves leave.
    """
    return np.asarray(of_colours | (of_grey & no_bluer_than_green(colours.classes)))


def _prediction(
    source: Image,
    target: Image,
    seen: Mask,
    source_saturation: int,
    target_saturation: int,
    classes: Classes | None = None,
) -> Prediction:
    """Fitted to every fourth pixel each way that both see and that saturates in neither."""
    s, t = (one[::_EVERY, ::_EVERY].ravel() for one in (source, target))
    usable = seen[::_EVERY, ::_EVERY].ravel() & (s < source_saturation) & (t < target_saturation)
    return predict(s, t, usable, None if classes is None else classes[::_EVERY, ::_EVERY].ravel())


def _relative(
    value: Image, predicted: Image, saturated: Mask, source_saturated: Mask, *, infrared: bool = False
) -> Floats32:
    """By what share the values lie above, or below, all that is predicted within 5 x 5 pixels.

    Where the source is saturated there is no upper limit, and what is saturated itself is not darker. A grey camera
    that sees near `infrared` sees plants brighter than colours tell.
    """
    highest = cv2.dilate(cv2.max(predicted, source_saturated * _WHITE), _NEARBY)
    lowest = cv2.erode(predicted, _NEARBY)
    if infrared:  # how dark a grey camera sees what is white in the other's colours, as the sky, is not known well
        lowest = cv2.copyTo(cv2.LUT(lowest, _DIM), cv2.dilate(source_saturated.view(np.uint8), _NEARBY), lowest)
    lowest *= ~saturated
    nearest = cv2.min(cv2.max(value, lowest), highest)
    unit = cv2.LUT(nearest, _UNITS)
    if infrared:
        unit = cv2.copyTo(cv2.LUT(nearest, _INFRARED_UNITS), cv2.compare(value, nearest, cv2.CMP_GT), unit)
    residual = np.asarray(cv2.subtract(value, nearest, dtype=cv2.CV_32F), dtype=np.float32)
    residual /= unit
    return residual


def _split(colour: Image) -> tuple[Image, ...]:
    return tuple(np.asarray(channel, dtype=np.uint8) for channel in cv2.split(colour))


def _means(image: Image) -> Image:
    return np.asarray(cv2.blur(image, LIGHT.mean_px), dtype=np.uint8)


def views_of(half_res: Mapping[int, Image], colours: Mapping[int, Image]) -> dict[int, View]:
    """The half-resolution images by camera, grey, and of those that have them colours."""
    return {camera: View(half, colours.get(camera)) for camera, half in half_res.items()}
