"""Stray light in a lens: a veil over the picture, blooming beside bright parts, and the sun's glare and ghosts.

All of it is smooth, and is made on a grid of every fourth pixel.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from auditor.lab.simulation.conditions import CAMERAS, FLARE
from auditor.model.arrays import Floats32

_STEP = 4
_KITTI_WIDTH = 1242
_SOFT = 0.25  # of a ghost's radius, its edge
_PADDED = 1.5


@dataclass(frozen=True)
class Ghost:
    """A disc of light at `place` times the way from the picture's middle to the sun; pixels of a 1242 px wide one."""

    place: float
    radius_px: float
    levels: tuple[float, ...]


@dataclass(frozen=True)
class LensFlare:
    """The stray light of one lens: shares of all light, and levels (shares of white) while it sees the sun."""

    veil: float
    bloom: float
    glare: float
    glare_px: float
    ghosts: tuple[Ghost, ...]


@dataclass(frozen=True)
class SunSeen:
    """The sun's image in pixels, and the share of it that nothing hides."""

    u: float
    v: float
    share: float


def draw_lens(rng: np.random.Generator) -> LensFlare:
    """A lens with the flaws of its own."""
    ghosts = tuple(
        Ghost(
            place=float(rng.uniform(*FLARE.place)),
            radius_px=float(rng.uniform(*FLARE.radius_px)),
            levels=tuple(rng.uniform(*FLARE.ghost) * rng.uniform(*FLARE.tint, 3)),
        )
        for _ in range(int(rng.integers(*FLARE.ghosts)))
    )
    return LensFlare(
        veil=float(rng.uniform(*CAMERAS.veil)),
        bloom=float(rng.uniform(*CAMERAS.bloom)),
        glare=float(rng.uniform(*FLARE.glare)),
        glare_px=float(rng.uniform(*FLARE.glare_px)),
        ghosts=ghosts,
    )


def with_stray_light(image: Floats32, lens: LensFlare, sun: SunSeen | None) -> Floats32:
    """(K, H, W) exposed light with what the lens does to it, 1 white; `image` is changed."""
    _, height, width = image.shape
    scale = width / _KITTI_WIDTH
    kernel = _kernel(-(-height // _STEP), -(-width // _STEP), lens.veil, lens.bloom, scale)
    flare = _flare(lens, sun, image.shape, scale) if sun is not None and sun.share > 0 else None
    for k in range(len(image)):
        stray = _convolved(_reduced(image[k]), kernel)
        if flare is not None:
            stray += flare[k]
        image[k] *= np.float32(1 - lens.veil - lens.bloom)
        image[k] += _enlarged(stray, height, width)
    return image


def _reduced(channel: Floats32) -> Floats32:
    height, width = channel.shape
    padded = np.pad(channel, ((0, -height % _STEP), (0, -width % _STEP)), mode="edge")
    rows = padded.reshape(padded.shape[0] // _STEP, _STEP, -1).mean(axis=1)
    return np.asarray(rows.reshape(rows.shape[0], -1, _STEP).mean(axis=2))


@lru_cache(maxsize=16)
def _kernel(height: int, width: int, veil: float, bloom: float, scale: float) -> NDArray[np.complex64]:
    """The Fourier transform of what a lens does with a point of light."""
    shape = int(height * _PADDED), int(width * _PADDED)
    far = np.hypot(*(np.minimum(np.arange(n), n - np.arange(n))[s] for n, s in zip(shape, _AXES, strict=True)))
    spread = np.zeros(shape)
    for share, width_px in ((veil, CAMERAS.veil_px), (bloom, CAMERAS.bloom_px)):
        profile = np.exp(-far * _STEP / (width_px * scale))
        spread += share * profile / profile.sum()
    return np.asarray(np.fft.rfft2(spread), dtype=np.complex64)


_AXES = (slice(None), None), (None, slice(None))


def _convolved(small: Floats32, kernel: NDArray[np.complex64]) -> Floats32:
    height, width = small.shape
    shape = int(height * _PADDED), int(width * _PADDED)
    spread = np.fft.irfft2(np.fft.rfft2(small, s=shape) * kernel, s=shape)
    return np.asarray(spread[:height, :width], dtype=np.float32)


def _enlarged(small: Floats32, height: int, width: int) -> Floats32:
    """Bilinear: the small grid's values lie in the middle of their pixels."""
    rows = _between(small, height)
    return _between(rows.T, width).T


def _between(values: Floats32, size: int) -> Floats32:
    """Rows between rows."""
    at = np.clip((np.arange(size, dtype=np.float32) - (_STEP - 1) / 2) / _STEP, 0, len(values) - 1)
    first = np.minimum(at.astype(np.intp), len(values) - 2)
    share = (at - first).astype(np.float32)[:, None]
    return np.asarray(values[first] * (1 - share) + values[first + 1] * share)


def _flare(lens: LensFlare, sun: SunSeen, shape: tuple[int, ...], scale: float) -> Floats32:
    """(K, h, w) light of the sun in the lens."""
    channels, height, width = shape
    y = np.arange(_STEP / 2, height + _STEP / 2, _STEP, dtype=np.float32)[: -(-height // _STEP), None]
    x = np.arange(_STEP / 2, width + _STEP / 2, _STEP, dtype=np.float32)[None, : -(-width // _STEP)]
    glare = np.exp(-np.hypot(x - sun.u, y - sun.v) / np.float32(lens.glare_px * scale)) * np.float32(lens.glare)
    light = np.repeat(glare[None], channels, axis=0)
    for ghost in lens.ghosts:
        u, v = (m + ghost.place * (at - m) for m, at in ((width / 2, sun.u), (height / 2, sun.v)))
        radius = ghost.radius_px * scale
        disc = np.clip((1 - np.hypot(x - u, y - v) / radius) / _SOFT, 0, 1)
        levels = ghost.levels if channels > 1 else (sum(ghost.levels) / len(ghost.levels),)
        light += np.array(levels, dtype=np.float32)[:, None, None] * disc
    return np.asarray(light * np.float32(sun.share), dtype=np.float32)
