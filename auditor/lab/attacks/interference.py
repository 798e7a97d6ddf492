"""Sound and radio waves that change a camera's images without any light."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from auditor.lab.attacks.kinds import AttackDraw, CameraKind, uniform
from auditor.lab.attacks.paper import DescribedEffect, with_levels
from auditor.model.arrays import Floats, Image
from auditor.model.frames import CameraImage
from auditor.model.rig import Camera


@dataclass(frozen=True, eq=False)
class LaserPattern:
    """A pattern that a real laser left on a real camera, laid over an image: I' = clip(I + pattern), Koehler et al.

    `pixels` is (h, w, 3) BGR uint8 of any size; it is resized to the image. A grey image gets the brightest
    channel, as a camera without colour filters records the single wavelength of a laser.
    """

    title: str
    pixels: Image

    name = "pattern"

    @property
    def parameters(self) -> dict[str, object]:
        """All that determines its effect, except the pixels."""
        return {"title": self.title}

    def apply(self, image: CameraImage) -> CameraImage:
        """The image with the pattern on it."""
        height, width = image.pixels.shape[:2]
        rows = np.arange(height) * self.pixels.shape[0] // height
        columns = np.arange(width) * self.pixels.shape[1] // width
        light = self.pixels[rows[:, None], columns]
        if image.pixels.ndim == 2:
            light = light.max(axis=2)
        brightened = image.pixels.astype(np.int16) + light
        return CameraImage(image.sensor, image.stamp_ns, np.minimum(brightened, 255).astype(np.uint8))


@dataclass(frozen=True)
class Stripes(DescribedEffect):
    """Rows brightened or darkened in turn, as a light that flickers faster than the frame does to a rolling shutter.

    Köhler et al., "They See Me Rollin'", ACSAC 2021, arXiv:2101.10011. Of every `period_px` rows, the first being
    number `phase_px`, a share `duty` gets `amplitude` grey levels more.
    """

    amplitude: float
    period_px: float
    phase_px: float
    duty: float = 0.5

    name = "stripes"

    def apply(self, image: CameraImage) -> CameraImage:
        """The image with the stripes on it."""
        row = np.arange(image.pixels.shape[0])
        lit = ((row - self.phase_px) % self.period_px) < self.duty * self.period_px
        light: Floats = np.where(lit, self.amplitude, 0.0).reshape(-1, *[1] * (image.pixels.ndim - 1))
        return with_levels(image, image.pixels + light)


_BLUE, _GREEN, _RED = 0, 1, 2
_BALANCE = {_BLUE: 1.5, _RED: 1.8}  # how much more than green a white balance amplifies them in daylight


@dataclass(frozen=True)
class AcousticBlur(DescribedEffect):
    """Sound at the resonance of a stabiliser's gyroscope: the lens moves against a still scene, and blurs it.

    Ji et al., "Poltergeist", IEEE S&P 2021. The image is averaged along a line of `length_px`, `angle_deg` up from the
    row.
    """

    length_px: float
    angle_deg: float

    name = "acoustic blur"

    def apply(self, image: CameraImage) -> CameraImage:
        """The blurred image."""
        half = (max(self.length_px, 1.0) - 1) / 2
        along, angle = np.linspace(-half, half, 4 * int(np.ceil(half)) + 1), np.deg2rad(self.angle_deg)
        moves = {(round(-np.sin(angle) * step), round(np.cos(angle) * step)) for step in along.tolist()}
        height, width = image.pixels.shape[:2]
        total = np.zeros(image.pixels.shape, dtype=np.float32)
        for down, right in moves:
            row = np.clip(np.arange(height) + down, 0, height - 1)
            total += image.pixels[row[:, None], np.clip(np.arange(width) + right, 0, width - 1)]
        return with_levels(image, total / len(moves))


@dataclass(frozen=True)
class ElectromagneticStripes(DescribedEffect):
    """Radio waves on the cable between sensor and processor: rows are lost, and the rows after them take their places.

    Jiang et al., "GlitchHiker", USENIX Security 2023; Kang et al., arXiv:2409.10922. A colour camera sends rows of
    blue and green, and of green and red, in turn. After one lost row the processor takes each kind for the other until
    a second one is lost: a stripe in which green stands for blue and red, and their mean for green; the white balance
    amplifies it as blue and red, so that it is magenta. A grey camera's stripe is only moved. `stripes` of `height_px`
    rows each are spread evenly, the first from row `phase_px` on; `lost_rows` is how many are missing in each.
    """

    stripes: int
    height_px: int
    phase_px: int
    lost_rows: int = 1

    name = "electromagnetic stripes"

    def apply(self, image: CameraImage) -> CameraImage:
        """The image with its stripes."""
        height = image.pixels.shape[0]
        row = np.arange(height)
        period = height / max(self.stripes, 1)
        inside = ((row - self.phase_px) % period < self.height_px) & (self.stripes > 0)
        source = np.where(inside, np.minimum(row + self.lost_rows, height - 1), row)
        pixels = image.pixels[source]
        if pixels.ndim > 2 and self.lost_rows % 2:
            pixels[inside] = _taken_for_each_other(pixels[inside])
        return CameraImage(image.sensor, image.stamp_ns, np.ascontiguousarray(pixels))


def _taken_for_each_other(pixels: Image) -> Image:
    """(..., 3) pixels whose rows of blue and green were taken for rows of green and red, and these for those."""
    ranges = np.empty(pixels.shape, dtype=np.float32)
    ranges[..., _GREEN] = sum(pixels[..., channel] / np.float32(gain) for channel, gain in _BALANCE.items()) / 2
    for channel, gain in _BALANCE.items():
        ranges[..., channel] = pixels[..., _GREEN] * np.float32(gain)
    return np.clip(np.rint(ranges), 0, 255).astype(np.uint8)


_STRIPES_PX = 40.0
_SHUTTER_LEVEL = 120.0
_LOST_STRIPE_SHARE = 0.08  # of the image's height


def _stripes(draw: AttackDraw, _: Camera, level: float) -> Stripes:
    return Stripes(level, _STRIPES_PX, uniform(draw, (0, _STRIPES_PX)))


def _shutter(draw: AttackDraw, _: Camera, duty: float) -> Stripes:
    return Stripes(_SHUTTER_LEVEL, _STRIPES_PX, uniform(draw, (0, _STRIPES_PX)), duty)


def _blur(draw: AttackDraw, _: Camera, length: float) -> AcousticBlur:
    return AcousticBlur(length, uniform(draw, (0, 180)))


def _lost_rows(draw: AttackDraw, camera: Camera, stripes: float) -> ElectromagneticStripes:
    height = round(_LOST_STRIPE_SHARE * camera.height_px)
    return ElectromagneticStripes(round(stripes), height, int(draw.rng.integers(camera.height_px)))


ON_CAMERA: Mapping[str, CameraKind] = {
    "stripes": CameraKind("rows that are brighter in turn", "grey levels", 120, _stripes),
    "shutter": CameraKind(
        "narrow bright rows, as of a pulsed light", "share of the rows", 0.1, _shutter, evaluated=True
    ),
    "blur": CameraKind("sound that shakes the stabiliser", "px", 15.0, _blur, evaluated=True),
    "electromagnetic": CameraKind("radio waves that lose rows", "stripes", 4, _lost_rows, evaluated=True),
}
