"""The radiances along a camera's rays in each of its channels, from one set of hits.

A channel is a weighting of four bands, and light adds up. So each channel needs, for each piece and kind of light, one
number alone: no picture of a band is ever made.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auditor.lab.simulation.conditions import ILLUMINANTS
from auditor.lab.simulation.daylight import Day, lamp_light
from auditor.lab.simulation.rays import Hits, Rays
from auditor.lab.simulation.shading import Lit, Scene, parts, sky
from auditor.lab.simulation.surfaces import Surfaces
from auditor.lab.simulation.textures import LAYERS, Atlas
from auditor.model.arrays import Floats, Floats32
from auditor.model.optics.geometry import Matrix

_MIRRORS_SKY = np.float32(0.85)  # of the surroundings' values; below are houses
_SURROUNDINGS_SKY = 1.2  # the value of their sky


@dataclass(frozen=True, eq=False)
class Channels:
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


def channels(weights: Floats, reflectance: Floats32, emission: Floats32 | None, day: Day) -> Channels:
    """The channels of a camera: weights are (K, 4), reflectance and emission (N, LAYERS, 4)."""
    flat = reflectance.reshape(-1, 4).T

    def table(light: Floats) -> Floats32:
        return np.ascontiguousarray((weights * light) @ flat, dtype=np.float32)

    def answer(light: Floats) -> Floats32:
        return (weights @ light).astype(np.float32)

    light = day.light
    around = light.ambient * day.ambient + light.direct * (1 - light.shade / 2) / 2 * day.sun
    return Channels(
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
    seen: Channels,
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


def _channel(lit: Lit, row: NDArray[np.int32], lamps: Floats32 | None, day: Day, seen: Channels, k: int) -> Floats32:
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


def _sky(rays: Rays, day: Day, seen: Channels, world_SE3_rig: Matrix) -> Floats32:
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
