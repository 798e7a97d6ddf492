"""Light of one wavelength, light without a shape, and pictures thrown into a lens: attacks on one camera by light."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from auditor.lab.attacks.kinds import AttackDraw, CameraKind, place
from auditor.lab.attacks.paper import RADIUS, DescribedEffect, Facula, RoundLight, drawn_facula, scaled, with_levels
from auditor.model.arrays import Floats32
from auditor.model.frames import CameraImage
from auditor.model.rig import Camera

COLOURS: Mapping[str, int] = MappingProxyType({"blue": 0, "green": 1, "red": 2})
"""The channel that a laser of each colour falls into: 450, 520 and 650 nm."""

_GREY_SHARES = (0.114, 0.587, 0.299)  # of blue, green and red in a grey level, ITU-R BT.601
_SIGN_SIDES = 8
_RIM, _BAR = 0.85, 0.12  # of the sign's radius: where its white rim begins, and half its bar's height


@dataclass(frozen=True)
class ColouredFacula(RoundLight):
    """A facula of a laser of one `colour`: only one of a colour camera's channels records it.

    A Bayer filter passes one third of the visible spectrum; what little of a laser's light passes the two others is
    left out, which is the harder case. A grey camera records the colour's share in its grey levels. Lasers of single
    colours on cameras of vehicles: Petit et al., Black Hat Europe 2015; Yan et al., USENIX Security 2022,
    arXiv:2204.02675. `amplitude` in levels of the channel.
    """

    colour: str

    @property
    def name(self) -> str:
        """The kind of attack."""
        return f"{self.colour} facula"

    def apply(self, image: CameraImage) -> CameraImage:
        """The image with the facula in one channel, or weaker on a grey image."""
        channel = COLOURS[self.colour]
        amplitude = self.amplitude if image.pixels.ndim > 2 else self.amplitude * _GREY_SHARES[channel]
        facula = Facula(amplitude, self.radius_px, self.u_px, self.v_px)
        if image.pixels.ndim == 2:
            return facula.apply(image)
        lit = facula.apply(CameraImage(image.sensor, image.stamp_ns, image.pixels[..., channel]))
        pixels = image.pixels.copy()
        pixels[..., channel] = lit.pixels
        return CameraImage(image.sensor, image.stamp_ns, pixels)


@dataclass(frozen=True)
class InfraredFacula(RoundLight):
    """A facula of near infrared, beyond 850 nm, on a camera without a filter against it; no driver sees it.

    The dyes of a Bayer filter pass it alike, so that all channels record it. A camera with a filter records nothing.
    Wang et al., "I Can See the Light", CCS 2021; Sato et al., NDSS 2024.
    """

    name = "infrared facula"

    def apply(self, image: CameraImage) -> CameraImage:
        """The image with the facula in all its channels."""
        return Facula(self.amplitude, self.radius_px, self.u_px, self.v_px).apply(image)


@dataclass(frozen=True)
class Veil(DescribedEffect):
    """Light that the lens scatters over the whole image: `level` grey levels more everywhere, and less contrast.

    What a lamp beside the picture, or a laser on a dirty windscreen, does: Petit et al., Black Hat Europe 2015.
    """

    level: float

    name = "veil"

    def apply(self, image: CameraImage) -> CameraImage:
        """The image behind the veil."""
        return with_levels(image, image.pixels + np.float32(self.level))


@dataclass(frozen=True)
class ProjectedObject(DescribedEffect):
    """A stop sign that a projector throws into one camera's lens, whose flare shows it: Man et al., RAID 2020.

    Light adds, so the scene shows through. `amplitude` in levels of its white parts, `height_px` of the sign; its
    middle is at `u_px`, `v_px`. What is projected onto the scene (Nassi et al., CCS 2020) every camera sees.
    """

    amplitude: float
    height_px: float
    u_px: float
    v_px: float

    name = "projected object"

    def apply(self, image: CameraImage) -> CameraImage:
        """The image with the sign on it; a grey image shows it in grey levels."""
        light = self._sign(*image.pixels.shape[:2]) * np.float32(self.amplitude)
        if image.pixels.ndim == 2:
            light = light @ np.array(_GREY_SHARES, dtype=np.float32)
        return with_levels(image, image.pixels + light)

    def _sign(self, height: int, width: int) -> Floats32:
        """(H, W, 3) shares of light: a red octagon with a white rim and a white bar."""
        right, down = np.arange(width) - self.u_px, np.arange(height)[:, None] - self.v_px
        radius = self.height_px / 2
        angles = (np.arange(_SIGN_SIDES) + 0.5) * 2 * np.pi / _SIGN_SIDES
        apothem = np.cos(np.pi / _SIGN_SIDES)
        outward = np.max([right * np.cos(a) + down * np.sin(a) for a in angles], axis=0) / (radius * apothem)
        inside = outward <= 1
        white = inside & ((outward > _RIM) | (np.abs(down) < _BAR * radius))
        channels = [white, white, inside]
        return np.stack(channels, axis=2).astype(np.float32)


_SIGN_LEVEL = 120.0
_HEIGHT = "height, px of an image 1242 px wide"


def _of(colour: str) -> Callable[[AttackDraw, Camera, float | None], ColouredFacula]:
    def draw_one(draw: AttackDraw, camera: Camera, radius: float | None) -> ColouredFacula:
        drawn = drawn_facula(draw, camera, radius)
        return ColouredFacula(drawn.amplitude, drawn.radius_px, drawn.u_px, drawn.v_px, colour)

    return draw_one


def _infrared(draw: AttackDraw, camera: Camera, radius: float | None) -> InfraredFacula:
    drawn = drawn_facula(draw, camera, radius)
    return InfraredFacula(drawn.amplitude, drawn.radius_px, drawn.u_px, drawn.v_px)


def _projected(draw: AttackDraw, camera: Camera, height: float) -> ProjectedObject:
    return ProjectedObject(_SIGN_LEVEL, scaled(height, camera), *place(draw, camera))


ON_CAMERA: Mapping[str, CameraKind] = {
    **{
        colour: CameraKind(f"a laser's {colour} light in one channel", RADIUS, None, _of(colour), evaluated=True)
        for colour in COLOURS
    },
    "infrared": CameraKind("near infrared, alike in all channels", RADIUS, None, _infrared),
    "veil": CameraKind("an even light over the image", "grey levels", 60.0, lambda _draw, _, size: Veil(size)),
    "projected": CameraKind("a sign that is thrown into the lens", _HEIGHT, 120.0, _projected, evaluated=True),
}
