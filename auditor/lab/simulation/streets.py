"""Streets of different styles, drawn from a seed."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from auditor.errors import SettingError
from auditor.lab.simulation.scene_objects import (
    Look,
    between,
    box,
    car,
    crown,
    fence,
    hedge,
    house,
    pole,
    sign,
    strip,
    tree,
)
from auditor.lab.simulation.surfaces import Piece
from auditor.lab.simulation.textures import Tile

BEHIND_M = 12.0
BEYOND_M = 130.0


@dataclass(frozen=True)
class Style:
    """A style of street; lengths in metres, the others probabilities for each section, or weights.

    `fronts` gives the weights of the fronts along the road, by names of `_FRONTS`.
    """

    road_m: float
    path_m: float
    paving: Tile
    verge: Tile
    parked: float
    trees: float
    tree_layers: int
    bushes: float
    poles: float
    signs: float
    traffic: float
    setback_m: tuple[float, float]
    fronts: Mapping[str, float]

    @property
    def lane_m(self) -> float:
        """The lane's place: a metre and a half beside the parked vehicles."""
        return self.road_m - 3.5


STYLES: Mapping[str, Style] = MappingProxyType(
    {
        "city": Style(
            road_m=5.0, path_m=2.6, paving=Tile.PAVING, verge=Tile.PAVING, parked=0.5, trees=0.55, tree_layers=10,
            bushes=0.35, poles=0.6, signs=0.25, traffic=1.0, setback_m=(0.3, 3.0),
            fronts={"windows": 3, "bricks": 1, "plain": 1, "ribs": 1, "glass": 0.5, "wall": 1, "fence": 0.5, "open": 1},
        ),
        "residential": Style(
            road_m=4.6, path_m=1.8, paving=Tile.PAVING, verge=Tile.GRASS, parked=0.3, trees=0.5, tree_layers=10,
            bushes=0.7, poles=0.45, signs=0.08, traffic=0.6, setback_m=(3.0, 8.0),
            fronts={"cottage": 4, "plain": 0.6, "hedge": 3, "fence": 1, "wall": 0.7, "open": 1.5},
        ),
        "industrial": Style(
            road_m=4.8, path_m=3.0, paving=Tile.CONCRETE, verge=Tile.GRASS, parked=0.4, trees=0.3, tree_layers=9,
            bushes=0.4, poles=0.6, signs=0.4, traffic=0.8, setback_m=(1.0, 6.0),
            fronts={"ribs": 2, "plain": 1.5, "glass": 0.4, "wall": 1.5, "fence": 1, "hedge": 1, "open": 1.5},
        ),
    }
)  # fmt: skip


def style_named(name: str) -> Style:
    """One of STYLES. Raises SettingError that lists them."""
    if name not in STYLES:
        raise SettingError(f"there is no street style {name!r}", where="style", remedy=f"use {', '.join(STYLES)}")
    return STYLES[name]


def street(style: Style, length_m: float, seed: int) -> list[Piece]:
    """The static pieces of a straight street for a vehicle that drives from z = 0 to `length_m`.

    A longer street of the same seed begins like a shorter one.
    """
    end = length_m + BEYOND_M
    parts = [_ground(style, end, np.random.default_rng([seed, 0]))]
    for side in (-1, 1):
        parts.append(_lined(style, side, end, np.random.default_rng([seed, 2, side + 1])))
        parts.append(_beside(style, side, end, np.random.default_rng([seed, 3, side + 1])))
    parts.append(_closed(end, np.random.default_rng([seed, 4])))
    return [piece for part in parts for piece in part]


def traffic(style: Style, length_m: float, speed_m_s: float, rng: np.random.Generator) -> Iterator[Piece]:
    """One vehicle ahead, and some oncoming ones."""
    yield from car(style.lane_m, rng.uniform(14, 30), rng, speed=speed_m_s * rng.uniform(0.97, 1.1))
    z = rng.uniform(25, 60)
    while z < 2.2 * length_m + BEYOND_M:
        yield from car(-style.lane_m - 0.4, z, rng, speed=-rng.uniform(7, 11))
        z += rng.uniform(25, 70) / style.traffic


def _ground(style: Style, end: float, rng: np.random.Generator) -> Iterator[Piece]:
    road = Look(Tile.ASPHALT, (3.1, 3.1), albedo=float(rng.uniform(0.28, 0.4)), stains=0.35)
    path = Look(style.paving, (1.7, 1.7), albedo=float(rng.uniform(0.4, 0.55)), stains=0.3)
    verge = Look(style.verge, (1.9, 1.9), albedo=float(rng.uniform(0.2, 0.35)), stains=0.5)
    kerb = Look(Tile.CONCRETE, (1.0, 1.0), albedo=0.55)
    whole = (-BEHIND_M, end)
    yield strip((-style.road_m, style.road_m), whole, 0, road)
    for side in (-1, 1):
        edge, back = side * style.road_m, side * (style.road_m + style.path_m)
        yield kerb.piece((edge, 0, -BEHIND_M), (0, 0, end + BEHIND_M), (0, -0.12, 0))
        yield strip(between(edge, edge + side * 0.2), whole, 0.121, kerb)
        yield strip(between(edge, back), whole, 0.12, path)
        yield strip(between(back, side * 60.0), whole, 0.1, verge)
    marking = Look(Tile.PLASTER, albedo=0.75, contrast=3.0, stains=0.3)
    for z in np.arange(-BEHIND_M, end, 9.0):
        yield strip((-0.08, 0.08), (z, z + 4.0), 0.004, marking)
    patch = Look(Tile.ASPHALT, (2.3, 2.3), albedo=0.2, stains=0.2)
    for z in np.arange(0, end, 14.0):
        left, start = rng.uniform(-style.road_m, style.road_m - 1.5), z + rng.uniform(0, 10)
        yield strip((left, left + rng.uniform(0.5, 1.5)), (start, start + rng.uniform(1, 5)), 0.003, patch)


def _lined(style: Style, side: int, end: float, rng: np.random.Generator) -> Iterator[Piece]:
    """Fronts one after the other along one side."""
    names, weights = list(style.fronts), np.array(list(style.fronts.values()))
    z = -BEHIND_M + rng.uniform(-4, 4)
    while z < end:
        length = rng.uniform(6, 13)
        x = side * (style.road_m + style.path_m + rng.uniform(*style.setback_m))
        name = str(rng.choice(names, p=weights / weights.sum()))
        yield from _FRONTS[name](x, z, z + length, rng)
        z += length + (rng.uniform(1.5, 6) if rng.random() < 0.4 else 0.0)


def _beside(style: Style, side: int, end: float, rng: np.random.Generator) -> Iterator[Piece]:
    """Parked vehicles at the kerb; trees, bushes, poles and signs behind it."""
    kerb = side * style.road_m
    for z in np.arange(-4.0, end, 5.9):
        if rng.random() < style.parked:
            yield from car(kerb - side * 1.05, z + rng.uniform(0, 0.8), rng)
    for z in np.arange(-4.0, end, 8.5):
        x = kerb + side * rng.uniform(0.5, 1.1)
        if rng.random() < style.trees:
            yield from tree(x, z + rng.uniform(0, 4), style.tree_layers, rng)
        if rng.random() < style.poles:
            yield from pole(x, z + rng.uniform(4.5, 6), rng.uniform(3, 8), rng)
        if rng.random() < style.signs:
            low, width, height = rng.uniform(1.2, 2.4), rng.uniform(0.6, 1.8), rng.uniform(0.5, 1.3)
            yield from sign(x + side * 0.8, z + rng.uniform(6, 8), low, width, height, rng)
        if rng.random() < style.bushes:
            radius, height = rng.uniform(0.5, 1.3), rng.uniform(0.4, 0.8)
            at = kerb + side * (style.path_m + rng.uniform(0.3, 1.5))
            yield from crown((at, -height, z + rng.uniform(0, 6)), radius, height, 6, rng, tile=Tile.HEDGE)


def _closed(end: float, rng: np.random.Generator) -> Iterator[Piece]:
    """The building across the street's far end."""
    look = Look(Tile.WINDOWS, (6.0, 6.0), albedo=0.5)
    yield look.piece((-40, 0, end - 2), (80, 0, 0), (0, -9, 0))
    for x in np.arange(-30, 31, 5.0):
        yield from crown((x, -3.5, end - 8 + rng.uniform(-3, 3)), 3.5, 3.5, 3, rng)


def _bright(rng: np.random.Generator) -> float:
    return float(rng.choice([rng.uniform(0.12, 0.35), rng.uniform(0.4, 0.7), rng.uniform(0.75, 0.95)]))


def _windows(x: float, z0: float, z1: float, rng: np.random.Generator) -> Iterator[Piece]:
    look = Look(Tile.WINDOWS, (6.4, 6.2), albedo=_bright(rng) * 0.9, gloss=0.7, stains=0.2)
    return house(x, z0, z1, rng.uniform(6, 13), look)


def _bricks(x: float, z0: float, z1: float, rng: np.random.Generator) -> Iterator[Piece]:
    return house(
        x, z0, z1, rng.uniform(4, 9), Look(Tile.BRICKS, (2.4, 2.6), albedo=rng.uniform(0.2, 0.45), stains=0.15)
    )


def _plain(x: float, z0: float, z1: float, rng: np.random.Generator) -> Iterator[Piece]:
    return house(x, z0, z1, rng.uniform(3.5, 8), Look(Tile.PLASTER, (4.0, 4.0), albedo=_bright(rng), stains=0.03))


def _ribs(x: float, z0: float, z1: float, rng: np.random.Generator) -> Iterator[Piece]:
    look = Look(Tile.RIBS, (3.2, 3.2), albedo=_bright(rng), contrast=rng.uniform(0.1, 0.4), stains=0.25)
    return house(x, z0, z1, rng.uniform(5, 9), look)


def _glass(x: float, z0: float, z1: float, rng: np.random.Generator) -> Iterator[Piece]:
    look = Look(Tile.GLASS, (2.6, 3.2), albedo=0.15, gloss=0.9)
    return house(x, z0, z1, rng.uniform(4, 9), look)


def _wall(x: float, z0: float, z1: float, rng: np.random.Generator) -> Iterator[Piece]:
    look = Look(Tile.PLASTER if rng.random() < 0.5 else Tile.CONCRETE, (4.0, 4.0), albedo=_bright(rng), stains=0.06)
    return box(between(x, x + np.sign(x) * 0.25), (z0, z1), (0, rng.uniform(1.7, 3)), look)


def _fenced(x: float, z0: float, z1: float, rng: np.random.Generator) -> Iterator[Piece]:
    yield from fence(x, z0, z1, rng.uniform(0.9, 1.5), rng)
    yield from _open(x + np.sign(x) * 4, z0, z1, rng)


def _hedged(x: float, z0: float, z1: float, rng: np.random.Generator) -> Iterator[Piece]:
    side = np.sign(x)
    yield from hedge(x, z0, z1, rng.uniform(0.9, 2.2), rng)
    if rng.random() < 0.6:
        yield from _cottage(x + side * 5, z0 + 1, z1 - 1, rng)


def _cottage(x: float, z0: float, z1: float, rng: np.random.Generator) -> Iterator[Piece]:
    look = Look(Tile.WINDOWS, (6.0, 5.6), albedo=_bright(rng), gloss=0.7, stains=0.15)
    return house(x, z0, z1, rng.uniform(3, 6), look, roof=Look(Tile.ROOF, (4.0, 4.0), albedo=rng.uniform(0.15, 0.35)))


def _open(x: float, z0: float, z1: float, rng: np.random.Generator) -> Iterator[Piece]:
    side = np.sign(x)
    for z in np.arange(z0, z1, 5.0):
        if rng.random() < 0.7:
            yield from tree(x + side * rng.uniform(1, 9), z, 6, rng)
        if rng.random() < 0.5:
            yield from crown(
                (x + side * rng.uniform(0, 5), -0.7, z + 2), rng.uniform(0.7, 1.8), 0.7, 6, rng, tile=Tile.HEDGE
            )
        if rng.random() < 0.3:
            yield from car(x + side * rng.uniform(3, 8), z, rng)
    behind = Look(Tile.WINDOWS, (6, 6), albedo=_bright(rng))
    yield from box(between(x + side * 16, x + side * 26), (z0, z1), (0, rng.uniform(4, 8)), behind)


_FRONTS: Mapping[str, Callable[[float, float, float, np.random.Generator], Iterator[Piece]]] = MappingProxyType(
    {
        "windows": _windows,
        "bricks": _bricks,
        "plain": _plain,
        "ribs": _ribs,
        "glass": _glass,
        "wall": _wall,
        "fence": _fenced,
        "hedge": _hedged,
        "cottage": _cottage,
        "open": _open,
    }
)
