"""The reflectances of a scene's pieces in four bands: blue, green, red and near infrared."""

import colorsys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from auditor.lab.simulation.conditions import ILLUMINANTS, MATERIALS, Range, Spectrum
from auditor.lab.simulation.raycasting import Hits, Rays
from auditor.lab.simulation.shading import Day, Lit, Scene, lamp_light, parts, sky
from auditor.lab.simulation.surfaces import Piece, Surfaces
from auditor.lab.simulation.textures import LAYERS, Atlas, Tile
from auditor.model.arrays import Floats, Floats32
from auditor.model.optics.geometry import Matrix

_MIRRORS_SKY = np.float32(0.85)  # of the surroundings' values; below are houses
_SURROUNDINGS_SKY = 1.2  # the value of their sky


@dataclass(frozen=True, eq=False)
class SpectralResponse:
    """What a camera's K channels make of each kind of light; rows are pieces times layers.

    `sun`, `ambient` and `lamp` are (K, rows) reflectances times the light's spectrum, `emitted` radiances (None: none);
    the others are (K,) answers to the light of the sky, of the sun beside it, of houses and of hazy air.
    """

    sun: Floats32
    ambient: Floats32
    lamp: Floats32
    emitted: Floats32 | None
    sky_low: Floats32
    sky_high: Floats32
    glow: Floats32
    houses: Floats32
    air: Floats32


def channels(weights: Floats, reflectance: Floats32, emission: Floats32 | None, day: Day) -> SpectralResponse:
    """The channels of a camera: weights are (K, 4), reflectance and emission (N, LAYERS, 4)."""
    flat = reflectance.reshape(-1, 4).T

    def table(light: Floats) -> Floats32:
        return np.ascontiguousarray((weights * light) @ flat, dtype=np.float32)

    def answer(light: Floats) -> Floats32:
        return (weights @ light).astype(np.float32)

    light = day.light
    around = light.ambient * day.ambient + light.direct * (1 - light.shade / 2) / 2 * day.sun
    return SpectralResponse(
        sun=table(day.sun),
        ambient=table(day.ambient),
        lamp=table(day.lamp),
        emitted=None if emission is None else np.asarray(weights @ emission.reshape(-1, 4).T, dtype=np.float32),
        sky_low=answer(day.sky_low),
        sky_high=answer(day.sky_high),
        glow=answer(day.sun),
        houses=answer(around),
        air=answer(light.sky / 2 * day.sky_low),
    )


def spectral_radiance(
    rays: Rays,
    hits: Hits,
    surfaces: Surfaces,
    atlas: Atlas,
    day: Day,
    road_m: float,
    seen: SpectralResponse,
    world_SE3_rig: Matrix,
) -> Floats32:
    """(K, H, W) radiances in a camera's channels; `surfaces` are those that were cast at, in the rig frame."""
    result = _sky(rays, day, seen, world_SE3_rig)
    flat = result.reshape(result.shape[0], -1)
    scene = Scene(rays, surfaces, atlas, day.light, world_SE3_rig)
    for part, met in parts(rays, hits, scene):
        lit = scene.lit(met)
        row = met.piece * LAYERS + lit.layer
        lamps = lamp_light(day, road_m, lit.place) if day.lamps else None
        for k in range(len(flat)):
            flat[k, part] = _channel(lit, row, lamps, day, seen, k)
    return result


def _channel(
    lit: Lit, row: NDArray[np.int32], lamps: Floats32 | None, day: Day, seen: SpectralResponse, k: int
) -> Floats32:
    """(N,) radiances in one channel."""
    bright = seen.ambient[k].take(row) * lit.ambient
    bright += seen.sun[k].take(row) * lit.sun
    if lamps is not None:
        bright += seen.lamp[k].take(row) * lamps
    bright *= lit.reflected
    if seen.emitted is not None:
        bright += seen.emitted[k].take(row)
    if lit.glossy.size:
        sky_seen = seen.sky_low[k] * np.float32(day.light.sky / _SURROUNDINGS_SKY)
        mirrored = lit.mirrored * np.where(lit.mirrored > _MIRRORS_SKY, sky_seen, seen.houses[k])
        bright[lit.glossy] += lit.share * (mirrored - bright.take(lit.glossy))
    bright += lit.haze * (seen.air[k] - bright)
    return np.asarray(bright)


def _sky(rays: Rays, day: Day, seen: SpectralResponse, world_SE3_rig: Matrix) -> Floats32:
    """(K, H, W) sky: whiter near the horizon, brighter beside the sun."""
    level = sky(rays, day.light)
    blue = np.clip(np.broadcast_to(-rays.y, rays.shape) * np.float32(ILLUMINANTS.blue_up), 0, 1)
    result = np.stack(
        [level * (low + (high - low) * blue) for low, high in zip(seen.sky_low, seen.sky_high, strict=True)]
    )
    sun = world_SE3_rig[:3, :3].T @ np.array(day.light.sun)
    if day.glow and sun[2] > 0:
        x, y, z = (np.float32(axis) for axis in sun)
        cosine = (rays.x * x + rays.y * y + z) / np.sqrt(rays.x * rays.x + rays.y * rays.y + 1)
        angle = np.rad2deg(np.arccos(np.clip(cosine, -1, 1)))
        result += seen.glow[:, None, None] * np.float32(day.glow) * np.exp(-angle / np.float32(ILLUMINANTS.glow_deg))
    return np.asarray(result, dtype=np.float32)


Bands = Floats  # (4,)

_TO_EYE = np.array([0.114, 0.587, 0.299])  # ITU-R BT.601's luma, of blue, green and red
_NEUTRAL = np.ones(4)


def reflectances(pieces: Sequence[Piece], seed: int) -> Floats32:
    """(N, LAYERS, 4) reflectances of pieces by layer of their tile and band, as multiples of their albedo.

    Pieces of one body and material are alike; `seed` is the street's.
    """
    cache: dict[tuple[int, int], Floats] = {}
    table = np.empty((len(pieces), LAYERS, 4), dtype=np.float32)
    for row, piece in enumerate(pieces):
        material = _SAME_AS.get(piece.tile, piece.tile)
        key = piece.body, int(material)
        if key not in cache:
            rng = np.random.default_rng([seed, *key])
            cache[key] = np.stack([_body(material, piece, rng), _detail(material), _NEUTRAL])
        table[row] = cache[key]
        table[row, :, :3] = np.minimum(table[row, :, :3], MATERIALS.brightest / max(piece.albedo, 1e-3))
    return table


def _body(material: Tile, piece: Piece, rng: np.random.Generator) -> Bands:
    if material is Tile.PLASTER and piece.body == 0:  # a marking on the road
        return _NEUTRAL
    drawn = _BODIES[material](rng) if material in _BODIES else _NEUTRAL
    return np.asarray(drawn * np.exp(rng.normal(0, MATERIALS.spread, 4)))


def _detail(material: Tile) -> Bands:
    """What the second layer of a tile is made of."""
    if material is Tile.PAINT:
        return _even(MATERIALS.tail_lamp)
    if material is Tile.GRASS:
        return _even(MATERIALS.dry)
    return _even(MATERIALS.bark) if material in (Tile.LEAVES, Tile.HEDGE) else _NEUTRAL


def _even(spectrum: Spectrum | Bands) -> Bands:
    """The spectrum with a brightness of 1 to the eye."""
    bands = np.array(spectrum, dtype=np.float64)
    return np.asarray(bands / (_TO_EYE @ bands[:3]))


def _of(spectrum: Spectrum) -> Callable[[np.random.Generator], Bands]:
    return lambda _: _even(spectrum)


def _plant(rng: np.random.Generator) -> Bands:
    """Green, autumn's or dry leaves, or something between two of them."""
    if rng.random() < MATERIALS.green_share:
        first, second, share = MATERIALS.green, MATERIALS.dry, rng.uniform(0, 0.4)
    else:
        first, second, share = MATERIALS.autumn, MATERIALS.dry, rng.uniform(0, 1)
    mixed = (1 - share) * _even(first) + share * _even(second)
    return np.asarray(mixed * np.array([1, 1, 1, rng.uniform(*MATERIALS.plant_infrared)]))


def _dyed(probability: float, saturation: Range) -> Callable[[np.random.Generator], Bands]:
    """Any hue, or none."""

    def draw(rng: np.random.Generator) -> Bands:
        if rng.random() >= probability:
            return _NEUTRAL
        r, g, b = colorsys.hsv_to_rgb(rng.random(), rng.uniform(*saturation), 1.0)
        return np.append(_even(np.array([b, g, r])), rng.uniform(*MATERIALS.dye_infrared))

    return draw


_car = _dyed(MATERIALS.saturated_paint, MATERIALS.paint_saturation)
_front = _dyed(MATERIALS.saturated_front, MATERIALS.front_saturation)
_stone, _brick = _of(MATERIALS.stone), _of(MATERIALS.brick)

_SAME_AS: Mapping[Tile, Tile] = MappingProxyType({Tile.REAR: Tile.PAINT})

_BODIES: Mapping[Tile, Callable[[np.random.Generator], Bands]] = MappingProxyType(
    {
        Tile.ASPHALT: _of(MATERIALS.asphalt),
        Tile.PAVING: _stone,
        Tile.CONCRETE: _stone,
        Tile.GRASS: _plant,
        Tile.LEAVES: _plant,
        Tile.HEDGE: _plant,
        Tile.PLASTER: _front,
        Tile.RIBS: _front,
        Tile.WINDOWS: _front,
        Tile.FENCE: _front,
        Tile.BRICKS: _brick,
        Tile.ROOF: lambda rng: (
            _brick(rng) if rng.random() < MATERIALS.clay_roofs else _NEUTRAL
        ),  # tiles of clay, or slates
        Tile.BARK: _of(MATERIALS.bark),
        Tile.PAINT: _car,
        Tile.SIGN: _dyed(MATERIALS.saturated_paint, MATERIALS.paint_saturation),
    }
)
