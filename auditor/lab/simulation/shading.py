"""The radiance along a camera's rays: from textured, shaded, shadowed and glossy pieces, or from the sky.

The light of one day under a condition has spectra, and does something to a street (water, lamps).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auditor.lab.simulation.conditions import ILLUMINANTS, MATERIALS, NIGHT_AND_RAIN, Condition, Spectrum
from auditor.lab.simulation.raycasting import Hits, Rays
from auditor.lab.simulation.scene_objects import Look, pole
from auditor.lab.simulation.streets import BEYOND_M, Style
from auditor.lab.simulation.surfaces import Piece, Surfaces
from auditor.lab.simulation.textures import LAYERS, Atlas, Tile, cloud_noise, level_of, reductions
from auditor.model.arrays import Floats, Floats32, Image, Indices
from auditor.model.optics.geometry import Matrix

_PART = 1 << 15  # rays at a time: their data fit into the processor's cache
_STAIN_SHARE = np.float32(0.137)  # of a tile's frequency, so that repeated tiles differ
_HAZE_M = np.float32(400.0)
_HAZE = np.float32(0.7)
_DULL = np.float32(0.02)
_HALF = np.float32(0.5)
_SIDE_M = 4.0  # from the middle of the road to where one-sided shade is full

Ints = NDArray[np.int32]


@dataclass(frozen=True)
class Illumination:
    """`sun` is the unit direction to the sun in the world frame; strengths are radiances of a white surface.

    `shade` is the share of the sun's light kept out where trees stand; `shade_m` the size of a shadow's tile.
    `one_sided` is how much more of it is kept out towards the right, or the left where it is negative; 1 is all of it.
    `grazing` is how much more glossy surfaces mirror at grazing angles.
    """

    sun: tuple[float, float, float]
    direct: float = 1.1
    ambient: float = 0.35
    sky: float = 1.3
    shade: float = 0.8
    shade_m: float = 18.0
    one_sided: float = 0.0
    grazing: float = 0.2


class RayHits(NamedTuple):
    """Rays that met a piece, (N,) each: direction (its z is 1), depth, piece, place on it, and n . direction."""

    x: Floats32
    y: Floats32
    depth: Floats32
    piece: Ints
    s: Floats32
    t: Floats32
    facing: Floats32

    def chosen(self, rows: Indices) -> "RayHits":
        """Some of the rays."""
        x, y, depth, s, t, facing = (v.take(rows) for v in (self.x, self.y, self.depth, self.s, self.t, self.facing))
        return RayHits(x, y, depth, self.piece.take(rows), s, t, facing)


def radiance(
    rays: Rays, hits: Hits, surfaces: Surfaces, atlas: Atlas, light: Illumination, world_SE3_rig: Matrix
) -> Floats32:
    """(H, W) radiances that a camera sees; `surfaces` are those that were cast at, in the rig frame."""
    result = sky(rays, light)
    scene = Scene(rays, surfaces, atlas, light, world_SE3_rig)
    for part, met in parts(rays, hits, scene):
        result.ravel()[part] = scene.light_from(met)
    return result


def parts(rays: Rays, hits: Hits, scene: "Scene") -> Iterator[tuple[Indices, RayHits]]:
    """The rays that met a piece, some at a time, with their (flat) places in the grid."""
    at = np.flatnonzero(hits.piece >= 0)
    for first in range(0, at.size, _PART):
        part = at[first : first + _PART]
        piece = hits.piece.take(part)
        depth, s, t = (grid.take(part) for grid in (hits.distance, hits.s, hits.t))
        x, y = rays.camera_directions(part)
        nx, ny, nz = (axis.take(piece) for axis in scene.normal)
        yield part, RayHits(x, y, depth, piece, s, t, nx * x + ny * y + nz)


class Lit(NamedTuple):
    """Rays that met a piece: (N,) the share of light that each reflects, and the light that falls there.

    `place` are places in the world frame; of the rays `glossy` the `share` is `mirrored` instead; `haze` is the share
    of each ray that the air between adds.
    """

    reflected: Floats32
    layer: Image
    ambient: Floats32
    sun: Floats32
    place: tuple[Floats32, Floats32, Floats32]
    glossy: Indices
    share: Floats32
    mirrored: Floats32
    haze: Floats32


class Scene:
    """The columns of a table of pieces as shading needs them, one after the other in memory."""

    def __init__(
        self, rays: Rays, surfaces: Surfaces, atlas: Atlas, light: Illumination, world_SE3_rig: Matrix
    ) -> None:
        self._atlas = atlas
        self._light = light
        self._surfaces = surfaces
        self.normal = np.ascontiguousarray(surfaces.normal.T)
        R = world_SE3_rig[:3, :3]
        start = R @ np.array([float(axis) for axis in rays.origin]) + world_SE3_rig[:3, 3]
        self._R, self._start = R.astype(np.float32), start.astype(np.float32)
        sun = (R.T @ np.array(light.sun) * light.direct).astype(np.float32)
        self._to_sun = sun @ self.normal
        self._ambient = surfaces.ambient * np.float32(light.ambient)
        self._footprint = surfaces.footprints(rays.pixel)
        self._repeats = np.ascontiguousarray(surfaces.repeats.T)
        self._shift = np.ascontiguousarray(surfaces.shift.T)

    def light_from(self, met: RayHits) -> Floats32:
        """(N,) radiances."""
        lit = self.lit(met)
        bright = lit.reflected
        bright *= lit.ambient + lit.sun
        if lit.glossy.size:
            bright[lit.glossy] += lit.share * (lit.mirrored - bright.take(lit.glossy))
        bright += lit.haze * (_HAZE - bright)
        return np.asarray(bright)

    def lit(self, met: RayHits) -> Lit:
        """What light there is, and what becomes of it."""
        length = np.sqrt(met.x * met.x + met.y * met.y + 1)
        slant = np.maximum(np.abs(met.facing) / length, _DULL)
        value, texel = self._texture(met, slant)
        place = self._place(met)
        gloss = self._surfaces.gloss.take(met.piece) * self._atlas.mask.take(texel)
        glossy = np.flatnonzero(gloss > _DULL)
        # Schlick's approximation: a surface reflects more at grazing angles.
        grazing = np.float32(self._light.grazing)
        return Lit(
            reflected=self._surfaces.albedo.take(met.piece) * value,
            layer=self._atlas.layer.take(texel),
            ambient=self._ambient.take(met.piece),
            sun=self._sun(met, place),
            place=place,
            glossy=glossy,
            share=gloss.take(glossy) + grazing * (1 - slant.take(glossy)) ** 5,
            mirrored=self._mirrored(met.chosen(glossy)) if glossy.size else np.empty(0, dtype=np.float32),
            haze=1 - np.exp(met.depth / -_HAZE_M),
        )

    def _texture(self, met: RayHits, slant: Floats32) -> tuple[Floats32, Ints]:
        """(N,) texture values, stains included, and the nearest texels."""
        footprint = met.depth * self._footprint.take(met.piece) / np.sqrt(slant)
        level = level_of(np.asarray(footprint, dtype=np.float32))
        tile = self._surfaces.tile.take(met.piece)
        across = met.s * self._repeats[0].take(met.piece) + self._shift[0].take(met.piece)
        up = met.t * self._repeats[1].take(met.piece) + self._shift[1].take(met.piece)
        value = 1 + self._surfaces.contrast.take(met.piece) * (self._atlas.bilinear(tile, across, up, level) - 1)
        coarse = np.maximum(level - 2, 0)
        stain = self._atlas.bilinear(Tile.STAINS, across * _STAIN_SHARE, up * _STAIN_SHARE, coarse)
        value *= 1 + self._surfaces.stains.take(met.piece) * (stain - 1)
        return np.maximum(value, _DULL), self._atlas.nearest(tile, across, up, level)

    def _place(self, met: RayHits) -> tuple[Floats32, Floats32, Floats32]:
        """(N,) x, y and z in the world frame."""
        R, start = self._R, self._start
        x, y, z = (start[row] + (R[row, 0] * met.x + R[row, 1] * met.y + R[row, 2]) * met.depth for row in range(3))
        return x, y, z

    def _sun(self, met: RayHits, place: tuple[Floats32, Floats32, Floats32]) -> Floats32:
        """(N,) light from the sun: a side is lit if it is the sun's, leaves let it through, crowns throw shadows."""
        x, y, z = place
        sx, sy, sz = (np.float32(axis) for axis in self._light.sun)
        scale = np.float32(1 / self._light.shade_m)
        across, along = (x - y * (sx / sy)) * scale, (z - y * (sz / sy)) * (scale * np.float32(0.7))
        open_ = self._atlas.bilinear(Tile.SHADE, across, along, 0)
        if self._light.one_sided:
            open_ = np.clip(open_ - np.float32(self._light.one_sided / _SIDE_M) * x, 0, 1)
        to_sun = self._to_sun.take(met.piece)
        sun = np.where(self._surfaces.cut.take(met.piece), np.abs(to_sun), to_sun * -np.sign(met.facing))
        return np.asarray(np.maximum(sun, 0) * (1 - np.float32(self._light.shade) * (1 - open_)))

    def _mirrored(self, met: RayHits) -> Floats32:
        """(N,) radiances that glossy pieces mirror: far surroundings, and closer the more a piece bulges."""
        nx, ny, nz = (axis.take(met.piece) for axis in self.normal)
        double = 2 * met.facing
        x, y, z = met.x - double * nx, met.y - double * ny, 1 - double * nz
        bulge = self._surfaces.bulge.take(met.piece)
        azimuth = np.asarray(np.arctan2(x, z), dtype=np.float32) + 2 * bulge * (met.s - _HALF)
        elevation = np.asarray(np.arctan2(-y, np.hypot(x, z)), dtype=np.float32) + bulge * (met.t - np.float32(0.3))
        row = np.clip(_HALF + elevation / np.float32(np.pi), np.float32(0.02), np.float32(0.98))
        return self._atlas.bilinear(Tile.SURROUNDINGS, azimuth / np.float32(2 * np.pi), row, 0)


def sky(rays: Rays, light: Illumination) -> Floats32:
    """(H, W) sky, brightest near the horizon."""
    up = np.broadcast_to(-rays.y, rays.shape)
    return np.asarray(np.float32(light.sky) * (1 - np.float32(0.8) * np.clip(up, 0, 1)), dtype=np.float32)


Bands = Floats  # (4,)

_GROUND = (Tile.ASPHALT, Tile.PAVING, Tile.CONCRETE)
_LAMP_TILE = Tile.STAINS  # no other piece shows it


@dataclass(frozen=True, eq=False)
class Day:
    """The light of a day; spectra are (4,), 1 in green or 0. `light` has the strengths of sun, sky and surroundings."""

    light: Illumination
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
    light = Illumination(
        sun=(flat * float(np.sin(azimuth)), -float(np.sin(elevation)), flat * float(np.cos(azimuth))),
        direct=float(rng.uniform(*condition.direct)),
        ambient=ambient,
        sky=float(rng.uniform(*condition.sky)),
        shade=float(rng.uniform(*condition.shade)),
        shade_m=float(rng.uniform(*condition.shade_m)),
        one_sided=float(rng.choice([-1, 1]) * rng.uniform(*condition.one_sided)),
        grazing=float(rng.uniform(*NIGHT_AND_RAIN.grazing)) if wet else Illumination.grazing,
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
    radiances = np.zeros((len(pieces), LAYERS, 4), dtype=np.float32)
    for row, piece in enumerate(pieces):
        if piece.tile is _LAMP_TILE:
            radiances[row] = day.emitted * day.lamp
        elif piece.tile is Tile.REAR:
            radiances[row, 1] = day.emitted * NIGHT_AND_RAIN.tail_lamp * np.array(MATERIALS.tail_lamp)
        elif piece.tile is Tile.WINDOWS and _lit(piece, seed):
            radiances[row, 1] = day.emitted * NIGHT_AND_RAIN.window * np.array(ILLUMINANTS.sodium)
    return radiances


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
