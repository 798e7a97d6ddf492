"""The reflectances of a scene's pieces in four bands: blue, green, red and near infrared."""

import colorsys
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from auditor.lab.simulation.conditions import MATERIALS, Range, Spectrum
from auditor.lab.simulation.surfaces import Piece
from auditor.lab.simulation.textures import LAYERS, Tile
from auditor.model.arrays import Floats, Floats32

Bands = Floats  # (4,)

_TO_EYE = np.array([0.114, 0.587, 0.299])  # ITU-R BT.601's luma, of blue, green and red
_NEUTRAL = np.ones(4)


def reflectances(pieces: Sequence[Piece], seed: int) -> Floats32:
    """(N, LAYERS, 4) reflectances of pieces by layer of their tile and band, as multiples of their albedo.

    Pieces of one body and material are alike; `seed` is the street's.
    """
    known: dict[tuple[int, int], Floats] = {}
    found = np.empty((len(pieces), LAYERS, 4), dtype=np.float32)
    for row, piece in enumerate(pieces):
        material = _SAME_AS.get(piece.tile, piece.tile)
        key = piece.body, int(material)
        if key not in known:
            rng = np.random.default_rng([seed, *key])
            known[key] = np.stack([_body(material, piece, rng), _detail(material), _NEUTRAL])
        found[row] = known[key]
        found[row, :, :3] = np.minimum(found[row, :, :3], MATERIALS.brightest / max(piece.albedo, 1e-3))
    return found


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
