"""Procedural surfaces: one atlas of square, periodic tiles with all their reductions."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auditor.model.arrays import Floats32, Image, Mask

SIZE = 256
_LEVELS = 9

LAYERS = 3
"""Layers of a tile: its body, its detail (lamps of a car, panes, dry or woody parts of plants), the rest."""

_BODY, _DETAIL, _REST = range(LAYERS)

Ints = NDArray[np.int32]
Drawn = tuple[NDArray[Any], NDArray[Any]]


class Tile(IntEnum):
    """Tiles by content. The comment gives the mask's meaning: gloss (reflecting share) or cover (where it exists)."""

    ASPHALT = 0
    PAVING = 1
    GRASS = 2
    PLASTER = 3
    RIBS = 4
    BRICKS = 5
    WINDOWS = 6  # gloss
    ROOF = 7
    LEAVES = 8  # cover
    HEDGE = 9  # cover
    CONCRETE = 10
    PAINT = 11  # gloss
    GLASS = 12  # gloss
    REAR = 13  # gloss
    WHEEL = 14  # cover
    FENCE = 15  # cover
    SIGN = 16
    BARK = 17
    STAINS = 18
    SHADE = 19
    SURROUNDINGS = 20


@dataclass(frozen=True, eq=False)
class Atlas:
    """All tiles: `value` (mean about 1), `mask` (0..1) and `layer`, flat, and where each tile's reductions start."""

    value: Floats32
    mask: Floats32
    layer: Image
    starts: Ints  # (levels,): within a tile
    sizes: Ints  # (levels,): of a side
    tile_size: int

    def bilinear(self, tile: Ints | int, s: Floats32, t: Floats32, level: Ints | int) -> Floats32:
        """Values at (N,) coordinates in tiles, periodic."""
        size, first = self._places(tile, level)
        x, y = s * size - np.float32(0.5), t * size - np.float32(0.5)
        left, top = np.floor(x), np.floor(y)
        right_share, lower_share = x - left, y - top
        wrap = size - 1
        column, row = left.astype(np.int32), top.astype(np.int32)
        column_l, column_r = column & wrap, (column + 1) & wrap
        row_t, row_b = first + (row & wrap) * size, first + ((row + 1) & wrap) * size
        upper = self.value.take(row_t + column_l)
        upper += right_share * (self.value.take(row_t + column_r) - upper)
        lower = self.value.take(row_b + column_l)
        lower += right_share * (self.value.take(row_b + column_r) - lower)
        upper += lower_share * (lower - upper)
        return np.asarray(upper)

    def masks(self, tile: Ints | int, s: Floats32, t: Floats32, level: Ints) -> Floats32:
        """The masks of the nearest texels at (N,) coordinates."""
        return np.asarray(self.mask.take(self.nearest(tile, s, t, level)))

    def nearest(self, tile: Ints | int, s: Floats32, t: Floats32, level: Ints) -> Ints:
        """The places of the nearest texels at (N,) coordinates."""
        size, first = self._places(tile, level)
        column = np.floor(s * size).astype(np.int32) & (size - 1)
        row = np.floor(t * size).astype(np.int32) & (size - 1)
        return np.asarray(first + row * size + column)

    def _places(self, tile: Ints | int, level: Ints | int) -> tuple[Ints, Ints]:
        """Sizes and starts of the reductions."""
        return self.sizes.take(level), self.starts.take(level) + np.int32(self.tile_size) * np.asarray(tile, np.int32)


def level_of(footprint: Floats32) -> Ints:
    """The reduction whose texels are about as large as a pixel's footprint, which is in shares of a tile."""
    return np.asarray(np.clip(np.log2(footprint * np.float32(SIZE)), 0, _LEVELS - 1), dtype=np.int32)


def make_atlas(rng: np.random.Generator) -> Atlas:
    """Draw all tiles."""
    values, masks = zip(*(_draw(tile, rng) for tile in Tile), strict=True)
    value = [np.concatenate([level.ravel() for level in reductions(tile)]) for tile in values]
    mask = [np.concatenate([level.ravel() for level in reductions(tile)]) for tile in masks]
    layer = [_layers(*drawn) for drawn in zip(Tile, values, masks, strict=True)]
    sizes = [(SIZE >> level) ** 2 for level in range(_LEVELS)]
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int32)
    sides = np.array([SIZE >> level for level in range(_LEVELS)], dtype=np.int32)
    return Atlas(np.concatenate(value), np.concatenate(mask), np.concatenate(layer), starts, sides, sum(sizes))


def cloud_noise(rng: np.random.Generator, slope: float, size: int = SIZE) -> Floats32:
    """Periodic (size, size) noise of standard deviation 1; its amplitude goes with frequency to the power of slope."""
    frequency = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None, :]) * size
    frequency[0, 0] = np.inf
    spectrum = np.fft.rfft2(rng.standard_normal((size, size))) * frequency**slope
    noise = np.fft.irfft2(spectrum, s=(size, size))
    return np.asarray(noise / noise.std(), dtype=np.float32)


def reductions(tile: Floats32) -> list[Floats32]:
    """The tile and its halvings."""
    levels = [tile]
    while levels[-1].shape[0] > 1:
        fine = levels[-1]
        levels.append((fine[::2, ::2] + fine[1::2, ::2] + fine[::2, 1::2] + fine[1::2, 1::2]) * np.float32(0.25))
    return levels


def _layers(tile: Tile, value: Floats32, mask: Floats32) -> Image:
    """The layer of each texel of a tile and of its reductions, one after the other."""
    layer = np.zeros((SIZE, SIZE), dtype=np.uint8)
    for number, chosen in _LAYERS.get(tile, {}).items():
        layer[chosen(value, mask)] = number
    return np.concatenate([layer[:: 1 << level, :: 1 << level].ravel() for level in range(_LEVELS)])


def _draw(tile: Tile, rng: np.random.Generator) -> tuple[Floats32, Floats32]:
    """One tile's value and mask. Rows run upwards on upright surfaces."""
    value, mask = _DRAWERS[tile](rng)
    return value.astype(np.float32), mask.astype(np.float32)


def _nothing() -> Floats32:
    return np.zeros((SIZE, SIZE), dtype=np.float32)


def _ribs(rng: np.random.Generator) -> Drawn:
    wave = np.cos(2 * np.pi * 16 * np.arange(SIZE) / SIZE)
    ribs = 0.2 * np.sign(wave) * np.abs(wave) ** 0.5 + np.repeat(0.2 * rng.standard_normal(16), SIZE // 16)
    return 1 + ribs * np.ones((SIZE, 1)) + 0.05 * cloud_noise(rng, -1), _nothing()


def _windows(rng: np.random.Generator) -> Drawn:
    value, mask = 1 + 0.02 * cloud_noise(rng, -0.8), _nothing()
    half = SIZE // 2
    for row in (0, 1):
        for column in (0, 1):
            rows = slice(row * half + 40, row * half + 108)
            columns = slice(column * half + 36, column * half + 92)
            value[rows.start - 6 : rows.stop + 4, columns.start - 4 : columns.stop + 4] = 1.35
            value[rows, columns] = rng.uniform(0.12, 0.4)
            mask[rows, columns] = 0.25
            if rng.random() < 0.5:  # a blind
                value[rows.stop - 30 : rows.stop, columns], mask[rows.stop - 30 : rows.stop, columns] = 1.2, 0.05
            value[rows, columns.start + 27 : columns.start + 30] = 1.3
            mask[rows, columns.start + 27 : columns.start + 30] = 0
    return value, mask


def _concrete(rng: np.random.Generator) -> Drawn:
    value = 1 + 0.03 * cloud_noise(rng, -0.4) + 0.07 * cloud_noise(rng, -2)
    value[:3] *= 0.6
    value[:, :2] *= 0.6
    return value, _nothing()


def _paint(rng: np.random.Generator) -> Drawn:
    value, mask = 1 + 0.01 * cloud_noise(rng, -1), np.full((SIZE, SIZE), 0.045)
    for column in (8, 90, 170, 250):
        value[:, column : column + 2] = 0.3
    value[150:156] = 1.5
    value[:24] = 0.35
    value[170:178, 70:86] = value[170:178, 150:166] = 2.0
    return value, mask


def _glass(rng: np.random.Generator) -> Drawn:
    value, mask = 0.3 + 0.25 * np.abs(cloud_noise(rng, -0.9)), np.full((SIZE, SIZE), 0.12)
    value[60:130, 60:95] = value[60:130, 160:195] = 0.9  # headrests
    value[:6] = value[-6:] = 0.2
    mask[:6] = mask[-6:] = 0.1
    value[:, 120:130], mask[:, 120:130] = 0.2, 0.1
    return value, mask


def _rear(rng: np.random.Generator) -> Drawn:
    value, mask = 1 + 0.01 * cloud_noise(rng, -1), np.full((SIZE, SIZE), 0.045)
    value[:50] = 0.3
    value[150:210, 4:52] = value[150:210, 204:252] = 2.2
    value[176:184, 4:52] = value[176:184, 204:252] = 0.8
    value[90:125, 96:160] = 5.0
    letters = rng.random((1, 8)) < 0.55
    value[96:119, 100:156] = np.kron(np.where(letters, 0.8, 5.0), np.ones((23, 7)))
    value[215:219], value[128:131, 60:196] = 0.4, 0.5
    return value, mask


def _wheel(rng: np.random.Generator) -> Drawn:
    across = (np.arange(SIZE) - SIZE / 2 + 0.5) / (SIZE / 2)
    radius, angle = np.hypot(across[:, None], across), np.arctan2(across[:, None], across)
    spokes = (radius < 0.62) & (np.cos(5 * angle + rng.uniform(0, 6)) > 0.1)
    return np.where(spokes, 3.0, 0.35), radius < 0.98


def _fence(rng: np.random.Generator) -> Drawn:
    at = np.arange(SIZE)
    bars, rails = (at % 32) < 8, (np.abs(at - 30) < 7) | (np.abs(at - 220) < 7)
    return 1 + 0.1 * cloud_noise(rng, -0.5), bars[None, :] | rails[:, None]


def _sign(rng: np.random.Generator) -> Drawn:
    value = np.ones((SIZE, SIZE))
    blocks = rng.random((12, 24)) < 0.5
    value[32:224, 32:224] = np.where(np.kron(blocks, np.ones((16, 8))) > 0, 0.25, 1.1)
    value[118:138, 16:240] = 1.1
    return value, _nothing()


def _bark(rng: np.random.Generator) -> Drawn:
    noise = cloud_noise(rng, -0.7)
    return np.exp(0.35 * (noise + np.roll(noise, 3, axis=0) + np.roll(noise, 6, axis=0)) / 2), _nothing()


def _surroundings(rng: np.random.Generator) -> Drawn:
    """The surroundings that glossy surfaces reflect: columns are azimuths, rows run from straight down to up."""
    height = np.arange(SIZE)[:, None] / SIZE
    skyline = 0.52 + 0.03 * np.cumsum(rng.standard_normal(SIZE))[None, :] / 16
    skyline += 0.05 * (np.kron(rng.random(32), np.ones(8)) > 0.6)
    above = height > skyline
    town = 0.35 * np.exp(0.6 * cloud_noise(rng, -1.1))
    return np.where(above, 1.2 + 0.2 * cloud_noise(rng, -2), np.where(height > 0.48, town, 0.45)), _nothing()


def _courses(rng: np.random.Generator, *, rows: int, columns: int, joint: float, spread: float) -> Floats32:
    """Stones in courses, every other one shifted by half a stone; joints darker by `joint` (brighter below zero)."""
    at = np.arange(SIZE)
    row = at * rows // SIZE
    shift = np.where(row % 2 == 0, 0.0, 0.5)[:, None]
    along = (at[None, :] * columns / SIZE + shift) % columns
    stone = along.astype(np.intp)
    value = 1 + spread * rng.standard_normal((rows, columns))[row[:, None], stone]
    edges = ((at * rows / SIZE) % 1 < 0.12)[:, None] | (along % 1 < 0.06)
    return np.asarray(np.where(edges, 1 - joint * 2, value), dtype=np.float32)


def _share(noise: Floats32, share: float) -> Floats32:
    """1 at the given share of pixels, the highest ones."""
    return np.asarray(noise > np.quantile(noise, 1 - share), dtype=np.float32)


_DRAWERS: dict[Tile, Callable[[np.random.Generator], Drawn]] = {
    Tile.ASPHALT: lambda rng: (1 + 0.13 * cloud_noise(rng, -0.35) + 0.05 * cloud_noise(rng, -1.5), _nothing()),
    Tile.PAVING: lambda rng: (
        _courses(rng, rows=24, columns=12, joint=0.12, spread=0.10) + 0.06 * cloud_noise(rng, -0.5),
        _nothing(),
    ),
    Tile.GRASS: lambda rng: (1 + 0.24 * cloud_noise(rng, -0.7) + 0.15 * cloud_noise(rng, -1.5), _nothing()),
    Tile.PLASTER: lambda rng: (1 + 0.012 * cloud_noise(rng, -0.3) + 0.02 * cloud_noise(rng, -2), _nothing()),
    Tile.RIBS: _ribs,
    Tile.BRICKS: lambda rng: (
        _courses(rng, rows=32, columns=10, joint=-0.18, spread=0.12) + 0.04 * cloud_noise(rng, -0.5),
        _nothing(),
    ),
    Tile.WINDOWS: _windows,
    Tile.ROOF: lambda rng: (
        _courses(rng, rows=16, columns=20, joint=0.35, spread=0.12) + 0.05 * cloud_noise(rng, -0.8),
        _nothing(),
    ),
    Tile.LEAVES: lambda rng: (np.exp(0.65 * cloud_noise(rng, -0.55)), _share(cloud_noise(rng, -0.85), 0.42)),
    Tile.HEDGE: lambda rng: (np.exp(0.5 * cloud_noise(rng, -0.5)), _share(cloud_noise(rng, -0.6), 0.6)),
    Tile.CONCRETE: _concrete,
    Tile.PAINT: _paint,
    Tile.GLASS: _glass,
    Tile.REAR: _rear,
    Tile.WHEEL: _wheel,
    Tile.FENCE: _fence,
    Tile.SIGN: _sign,
    Tile.BARK: _bark,
    Tile.STAINS: lambda rng: (1 + 0.5 * cloud_noise(rng, -1.3), _nothing()),
    # Light that comes through crowns: 1 lit, 0 in shade.
    Tile.SHADE: lambda rng: (np.clip(0.5 + 2.2 * cloud_noise(rng, -1.35), 0, 1), _nothing()),
    Tile.SURROUNDINGS: _surroundings,
}

_LAYERS: dict[Tile, dict[int, Callable[[Floats32, Floats32], Mask]]] = {
    Tile.WINDOWS: {_REST: lambda value, _: value > 1.2, _DETAIL: lambda _, mask: mask > 0},
    Tile.PAINT: {_REST: lambda value, _: (value < 0.5) | (value > 1.8)},
    Tile.REAR: {
        _REST: lambda value, _: (value < 0.5) | (value > 4),
        _DETAIL: lambda value, _: (value > 2.1) & (value < 2.3),
    },
    Tile.BRICKS: {_REST: lambda value, _: value > 1.3},
    Tile.SIGN: {_REST: lambda value, _: value < 0.5},
    Tile.GRASS: {_DETAIL: lambda value, _: value > 1.3},
    Tile.LEAVES: {_DETAIL: lambda value, _: value < 0.55},
    Tile.HEDGE: {_DETAIL: lambda value, _: value < 0.6},
}
"""Which texels of a tile, by value and mask, are of another layer than the body's; the last that fits holds."""
