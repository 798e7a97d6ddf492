"""Light on a camera beyond the paper's facula: captured laser patterns, and the stripes of a rolling shutter."""

from dataclasses import dataclass

import numpy as np

from auditor.lab.attacks.paper import Described, with_levels
from auditor.model.arrays import Floats, Image
from auditor.model.frames import CameraImage


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
class Stripes(Described):
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
