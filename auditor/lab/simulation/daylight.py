"""The light of one day under a condition: its spectra, and what it does to a street (water, lamps)."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from auditor.lab.simulation.conditions import ILLUMINANTS, MATERIALS, NIGHT_AND_RAIN, Condition, Spectrum
from auditor.lab.simulation.scene_objects import Look, pole
from auditor.lab.simulation.shading import Light
from auditor.lab.simulation.streets import BEYOND_M, Style
from auditor.lab.simulation.surfaces import Piece, Surfaces
from auditor.lab.simulation.textures import LAYERS, Atlas, Tile, cloud_noise, reductions
from auditor.model.arrays import Floats, Floats32

Bands = Floats  # (4,)

_GROUND = (Tile.ASPHALT, Tile.PAVING, Tile.CONCRETE)
_LAMP_TILE = Tile.STAINS  # no other piece shows it


@dataclass(frozen=True, eq=False)
class Day:
    """The light of a day; spectra are (4,), 1 in green or 0. `light` has the strengths of sun, sky and surroundings."""

    light: Light
    sun: Bands
    ambient: Bands
    sky_low: Bands
    sky_high: Bands
    lamp: Bands
    glow: float
    emitted: float
    lamps: float
    lamp_spacing_m: float
    wet: float
    level: float


def draw_day(condition: Condition, rng: np.random.Generator) -> Day:
    """A day under a condition."""
    elevation, azimuth = (np.deg2rad(rng.uniform(*r)) for r in (condition.elevation_deg, condition.azimuth_deg))
    flat = float(np.cos(elevation))
    ambient, blue = float(rng.uniform(*condition.ambient)), float(rng.uniform(*condition.blue))
    wet = float(rng.uniform(*condition.wet))
    light = Light(
        sun=(flat * float(np.sin(azimuth)), -float(np.sin(elevation)), flat * float(np.cos(azimuth))),
        direct=float(rng.uniform(*condition.direct)),
        ambient=ambient,
        sky=float(rng.uniform(*condition.sky)),
        shade=float(rng.uniform(*condition.shade)),
        shade_m=float(rng.uniform(*condition.shade_m)),
        one_sided=float(rng.choice([-1, 1]) * rng.uniform(*condition.one_sided)),
        grazing=float(rng.uniform(*NIGHT_AND_RAIN.grazing)) if wet else Light.grazing,
    )
    low = max(0.0, 1 - float(np.rad2deg(elevation)) / ILLUMINANTS.low_deg)
    lamps = float(rng.uniform(*condition.lamps))
    return Day(
        light=light,
        sun=_mixed(ILLUMINANTS.sun, ILLUMINANTS.low_sun, low),
        ambient=_mixed(ILLUMINANTS.clouds, ILLUMINANTS.blue_sky, blue),
        sky_low=_mixed(ILLUMINANTS.clouds, ILLUMINANTS.blue_sky, blue * 0.25),
        sky_high=_mixed(ILLUMINANTS.clouds, ILLUMINANTS.blue_sky, blue),
        lamp=_mixed(ILLUMINANTS.sodium, ILLUMINANTS.white_lamp, float(rng.choice([0, 1]))),
        glow=float(rng.uniform(*condition.glow)),
        emitted=float(rng.uniform(*condition.emitted)),
        lamps=lamps,
        lamp_spacing_m=float(rng.uniform(*NIGHT_AND_RAIN.lamp_spacing_m)),
        wet=wet,
        level=float(rng.uniform(*condition.level)),
    )


def overgrown(style: Style, condition: Condition) -> Style:
    """The style with as many trees and bushes as a condition asks for."""
    return replace(style, trees=max(style.trees, condition.trees), bushes=max(style.bushes, condition.trees))


def street_lamps(day: Day, style: Style, length_m: float, rng: np.random.Generator) -> Iterator[Piece]:
    """Lamps on posts on both sides, where the day has any."""
    if not day.lamps:
        return
    size, height = NIGHT_AND_RAIN.lamp_m, NIGHT_AND_RAIN.lamp_height_m
    head = Look(_LAMP_TILE, (size, size), albedo=0.5, contrast=0.0, stains=0.0)
    for z in np.arange(0.0, length_m + BEYOND_M, day.lamp_spacing_m):
        for side in (-1, 1):
            x = side * (style.road_m + 0.4)
            yield from pole(x, z, height, rng)
            left = x - side * NIGHT_AND_RAIN.lamp_reach_m - size / 2
            yield replace(head.piece((left, -height, z), (size, 0, 0), (0, -size, 0)), oval=True)


def emissions(pieces: Sequence[Piece], day: Day, seed: int) -> Floats32 | None:
    """(N, LAYERS, 4) radiances that pieces emit by layer and band: lamps, tail lamps and lit windows. None by day."""
    if not day.emitted:
        return None
    found = np.zeros((len(pieces), LAYERS, 4), dtype=np.float32)
    for row, piece in enumerate(pieces):
        if piece.tile is _LAMP_TILE:
            found[row] = day.emitted * day.lamp
        elif piece.tile is Tile.REAR:
            found[row, 1] = day.emitted * NIGHT_AND_RAIN.tail_lamp * np.array(MATERIALS.tail_lamp)
        elif piece.tile is Tile.WINDOWS and _lit(piece, seed):
            found[row, 1] = day.emitted * NIGHT_AND_RAIN.window * np.array(ILLUMINANTS.sodium)
    return found


def _lit(piece: Piece, seed: int) -> bool:
    return bool(np.random.default_rng([seed, piece.body]).random() < NIGHT_AND_RAIN.lit_fronts)


def watered(surfaces: Surfaces, atlas: Atlas, day: Day, rng: np.random.Generator) -> tuple[Surfaces, Atlas]:
    """The street after rain: its ground is darker, and where water stands it mirrors; a LiDAR's pulses are lost."""
    if not day.wet:
        return surfaces, atlas
    ground = np.isin(surfaces.tile, _GROUND) & (np.abs(surfaces.normal[:, 1]) > 0.9)
    depth = cloud_noise(rng, NIGHT_AND_RAIN.puddles)
    water = np.clip((depth - np.quantile(depth, 1 - day.wet)) * 2 + 0.5, NIGHT_AND_RAIN.film, 1)
    mask = atlas.mask.copy()
    flat = np.concatenate([level.ravel() for level in reductions(water.astype(np.float32))])
    for tile in _GROUND:
        mask[tile * atlas.tile_size : (tile + 1) * atlas.tile_size] = flat
    drier = np.where(ground, np.float32(rng.uniform(*NIGHT_AND_RAIN.darker)), np.float32(1))
    wet = replace(
        surfaces,
        albedo=surfaces.albedo * drier,
        gloss=np.where(ground, np.float32(rng.uniform(*NIGHT_AND_RAIN.gloss)), surfaces.gloss),
        see_through=np.where(ground, np.float32(NIGHT_AND_RAIN.mirrored_away), surfaces.see_through),
        lost=np.where(ground, np.float32(rng.uniform(*NIGHT_AND_RAIN.lost)), surfaces.lost),
    )
    return wet, replace(atlas, mask=mask)


def lamp_light(day: Day, road_m: float, place: tuple[Floats32, Floats32, Floats32]) -> Floats32:
    """(N,) light of the street lamps at places in the world frame; 1 of `lamps` below a lamp."""
    x, y, z = place
    spacing, height = np.float32(day.lamp_spacing_m), np.float32(NIGHT_AND_RAIN.lamp_height_m)
    ahead = (z + spacing / 2) % spacing - spacing / 2
    across = np.abs(x) - np.float32(road_m)
    squared = across * across + (y + height) ** 2 + ahead * ahead
    return np.asarray(
        np.float32(day.lamps) * (height * height / np.maximum(squared, NIGHT_AND_RAIN.nearest_m**2)) ** np.float32(1.5)
    )


def _mixed(first: Spectrum, second: Spectrum, share: float) -> Bands:
    return np.asarray((1 - share) * np.array(first) + share * np.array(second))
