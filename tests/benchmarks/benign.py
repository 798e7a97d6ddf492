"""How often faults of a camera that are no attack are called one: `python -m tests.benchmarks.benign --into FOLDER`.

A gain, a gamma, a white balance, dirt, drops, blur or glare lasts through the frames of a drive: of real drives each
camera has it in turn, of streets one camera. `judged_drives` says how they are judged and counted.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from auditor.lab.attacks.faults import SoiledLens
from auditor.lab.simulation.stray_light import LensFlare, SunSeen, draw_lens, with_stray_light
from auditor.model.frames import CameraImage, Frame
from auditor.model.rig import Rig
from auditor.model.verdict import Cause
from tests.benchmarks.judged_drives import run
from tests.benchmarks.lasting_faults import CLEAN, Happening, on

WHITE = 255

Pixels = np.ndarray


@dataclass(frozen=True)
class Toned:
    """A camera whose levels follow another curve: (L / 255)^gamma times a gain, by channel where there are several."""

    gain: float | tuple[float, float, float] = 1.0
    gamma: float = 1.0

    def apply(self, image: CameraImage) -> CameraImage:
        light = (image.pixels / np.float32(WHITE)) ** np.float32(self.gamma) * np.float32(self.gain)
        return replace(image, pixels=np.rint(np.clip(light, 0, 1) * WHITE).astype(np.uint8))


@dataclass(frozen=True)
class Blurred:
    """A lens out of focus."""

    sigma_px: float

    def apply(self, image: CameraImage) -> CameraImage:
        return replace(image, pixels=cv2.GaussianBlur(image.pixels, (0, 0), self.sigma_px))


@dataclass(frozen=True)
class WetLens:
    """Drops of water on a lens that show its picture, upside down as a whole, blurred and somewhat darker."""

    drops: int
    seed: int

    def apply(self, image: CameraImage) -> CameraImage:
        height, width = image.pixels.shape[:2]
        rng = np.random.default_rng([self.seed, image.sensor])
        share = np.zeros((height, width), dtype=np.float32)
        for _ in range(self.drops):
            u, v, radius = rng.uniform(0, width), rng.uniform(0, height), rng.uniform(0.01, 0.04) * width
            distance = np.hypot(np.arange(width) - u, np.arange(height)[:, None] - v) / radius
            share = np.maximum(share, np.clip((1 - distance) / 0.3, 0, 1).astype(np.float32))
        turned = cv2.GaussianBlur(image.pixels[::-1, ::-1], (0, 0), 0.02 * width).astype(np.float32) * np.float32(0.9)
        share = share.reshape(height, width, *[1] * (image.pixels.ndim - 2))
        pixels = np.rint(image.pixels * (1 - share) + turned * share)
        return replace(image, pixels=pixels.astype(np.uint8))


@dataclass(frozen=True)
class RefractingDrops:
    """Drops that each show the whole view, upside down: sky below and road above, blurred and somewhat darker."""

    drops: int
    seed: int

    def apply(self, image: CameraImage) -> CameraImage:
        height, width = image.pixels.shape[:2]
        rng = np.random.default_rng([self.seed, image.sensor, 9])
        turned = cv2.GaussianBlur(image.pixels[::-1, ::-1].astype(np.float32), (0, 0), 0.15 * height)
        pixels = image.pixels.astype(np.float32)
        for _ in range(self.drops):
            u, v, radius = rng.uniform(0, width), rng.uniform(0, height), rng.uniform(0.015, 0.05) * width
            right = (np.arange(width, dtype=np.float32) - u) / radius
            down = (np.arange(height, dtype=np.float32)[:, None] - v) / (radius * rng.uniform(0.8, 1.25))
            share = np.clip((1 - np.hypot(right, down)) / 0.25, 0, 1).astype(np.float32)
            share = share.reshape(height, width, *[1] * (image.pixels.ndim - 2))
            # The circle of the drop shows a circle as high as the picture.
            column, row = np.broadcast_arrays((width + right * height) / 2, (1 + down) * height / 2)
            shown = cv2.remap(turned, *(one.astype(np.float32) for one in (column, row)), cv2.INTER_LINEAR)
            pixels = pixels * (1 - share) + np.float32(0.9) * shown * share
        return replace(image, pixels=np.rint(pixels).astype(np.uint8))


@dataclass(frozen=True)
class Glare:
    """The sun in a lens: its glare and ghosts, the lens of each camera with flaws of its own."""

    sun: SunSeen
    seed: int

    def apply(self, image: CameraImage) -> CameraImage:
        lens: LensFlare = draw_lens(np.random.default_rng([self.seed, image.sensor]))
        channels = image.pixels[..., None] if image.pixels.ndim < 3 else image.pixels
        light = np.ascontiguousarray(channels.transpose(2, 0, 1), dtype=np.float32) / np.float32(WHITE)
        seen = np.clip(with_stray_light(light, lens, self.sun), 0, 1).transpose(1, 2, 0)
        return replace(image, pixels=np.rint(seen * WHITE).astype(np.uint8).reshape(image.pixels.shape))


@dataclass(frozen=True)
class Fault:
    """A fault and the cause that it should be called, None where there is none for it.

    `together`: all cameras have it; `coloured`: only colour cameras can.
    """

    name: str
    cause: Cause | None
    what: object
    together: bool = False
    coloured: bool = False


def faults(seed: int, width_px: int, height_px: int) -> Iterator[Fault]:
    """Every fault of a camera."""
    for gain in (0.6, 1.4):
        yield Fault(f"gain {gain}", Cause.EXPOSURE, Toned(gain))
    for gamma in (0.7, 1.4):
        yield Fault(f"gamma {gamma}", Cause.EXPOSURE, Toned(gamma=gamma))
    yield Fault("white balance 1.25 / 0.8", Cause.WHITE_BALANCE, Toned((0.8, 1.0, 1.25)), coloured=True)
    yield Fault("five drops of mud", Cause.SOILED, SoiledLens(5, seed))
    yield Fault("fifteen drops of water", Cause.SOILED, WetLens(15, seed))
    yield Fault("eight drops that show the view", Cause.SOILED, RefractingDrops(8, seed))
    yield Fault("blur, 2 px", None, Blurred(2.0))
    sun = SunSeen(0.6 * width_px, 0.1 * height_px, 1.0)
    yield Fault("glare of the sun, one camera", Cause.GLARE, Glare(sun, seed))
    yield Fault("glare of the sun, all", Cause.GLARE, Glare(sun, seed), together=True)
    yield Fault("gain 1.4, all", None, Toned(1.4), together=True)


def happenings(kept: Sequence[Frame], rig: Rig, seed: int, *, each: bool) -> Iterator[Happening]:
    """Clean frames, and every fault: of each camera, or of one camera in turn."""
    yield Happening(CLEAN, None, None, kept)
    cameras = [camera.number for camera in rig.cameras]
    coloured = [number for number, image in kept[0].images.items() if image.pixels.ndim > 2]
    for place, fault in enumerate(faults(seed, rig.cameras[0].width_px, rig.cameras[0].height_px)):
        able = coloured if fault.coloured else cameras
        if fault.together:
            yield Happening(fault.name, fault.cause, None, [_on_all(frame, fault.what, able, rig) for frame in kept])
        elif able:
            for camera in able if each else [able[(seed + place) % len(able)]]:
                yield Happening(fault.name, fault.cause, camera, map(on(camera, fault.what, rig), kept))


def _on_all(frame: Frame, what: object, cameras: Sequence[int], rig: Rig) -> Frame:
    for camera in cameras:
        frame = on(camera, what, rig)(frame)
    return frame


if __name__ == "__main__":
    run(__doc__ or "", happenings)
