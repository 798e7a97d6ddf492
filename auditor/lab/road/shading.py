"""How bright a camera sees what its rays meet."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auditor.geometry import Matrix
from auditor.lab.road.atlas import Atlas, mip_level
from auditor.lab.road.casting import Hits, View
from auditor.lab.road.noise import Plane
from auditor.lab.road.rays import Rays
from auditor.lab.road.surfaces import Surfaces

_BAND_ROWS = 24
"""Rows shaded together: few enough for the processor's cache."""

_LEAST_REFLECTION = 0.12

Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Light:
    """Sun and sky. `to_sun` is a unit vector of the world frame; brightness 1 is white in full sunlight.

    `shadow` names the picture that says how much sun comes through above the ground rectangle that begins at
    `shadow_corner` (x, z) and is `shadow_size_m` (x, z) large. `surroundings` names what glossy surfaces mirror:
    columns go by x, rows by height, of the mirrored direction.
    """

    to_sun: Plane
    sun: float
    sky: float
    shadow: str
    shadow_corner: tuple[float, float]
    shadow_size_m: tuple[float, float]
    surroundings: str
    horizon_brightness: float
    zenith_brightness: float


@dataclass(frozen=True, eq=False)
class Scenery:
    """Everything that does not move with the vehicle."""

    surfaces: Surfaces
    atlas: Atlas
    light: Light


@dataclass(frozen=True, eq=False)
class _Columns:
    """Per surface what shading needs, in the sensor's frame."""

    lambert: Plane
    texels_m: Plane
    detail_times_s: Plane
    detail_times_r: Plane
    ground: Plane
    ground_s: Plane
    ground_r: Plane
    turn_s: Plane
    turn_r: Plane


@dataclass(frozen=True, eq=False)
class _Pixels:
    """Where rays met surfaces: (N,) numbers of surfaces, places on them, and metres a pixel covers there."""

    surface: NDArray[np.int32]
    s: Plane
    r: Plane
    footprint: Plane


def shade(scenery: Scenery, seen: View, hits: Hits, rays: Rays, world_SE3_sensor: Matrix) -> Plane:
    """(H, W) brightness of what the rays meet."""
    columns = _columns(scenery, seen, world_SE3_sensor)
    rotation = world_SE3_sensor[:3, :3].astype(np.float32)
    tops = range(0, len(rays.q), _BAND_ROWS)
    bands = (slice(top, top + _BAND_ROWS) for top in tops)
    return np.concatenate([_shade_band(scenery, seen, columns, hits, rays, rotation, rows) for rows in bands])


def _columns(scenery: Scenery, seen: View, world_SE3_sensor: Matrix) -> _Columns:
    surfaces, light = scenery.surfaces, scenery.light
    rotation = world_SE3_sensor[:3, :3].astype(np.float32)
    facing = seen.normal @ (rotation.T @ light.to_sun)
    facing = np.where(surfaces.both_sided, np.abs(facing), facing)
    length_s = np.linalg.norm(surfaces.edge_s, axis=1)
    length_r = np.linalg.norm(surfaces.edge_r, axis=1)
    width = scenery.atlas.size[surfaces.picture, 1]
    return _Columns(
        lambert=(np.maximum(facing, 0) * surfaces.sunlit).astype(np.float32),
        texels_m=(width * surfaces.times[:, 0] / length_s).astype(np.float32),
        detail_times_s=length_s / surfaces.detail_m,
        detail_times_r=length_r / surfaces.detail_m,
        ground=_on_ground(light, surfaces.corner, np.array(light.shadow_corner)),
        ground_s=_on_ground(light, surfaces.edge_s, np.zeros(2)),
        ground_r=_on_ground(light, surfaces.edge_r, np.zeros(2)),
        turn_s=(seen.edge_s / length_s[:, None] * surfaces.bend[:, None]).astype(np.float32),
        turn_r=(seen.edge_r / length_r[:, None] * surfaces.bend[:, None]).astype(np.float32),
    )


def _on_ground(light: Light, vector: Plane, origin: NDArray[np.float64]) -> Plane:
    """(M, 2) where sunlight through points (or along edges) meets the ground, in lengths of the shadow picture."""
    along = vector[:, 1] / light.to_sun[1]
    on_ground = vector[:, [0, 2]] - along[:, None] * light.to_sun[[0, 2]]
    return np.asarray((on_ground - origin) / np.array(light.shadow_size_m), dtype=np.float32)


def _shade_band(
    scenery: Scenery, seen: View, columns: _Columns, hits: Hits, rays: Rays, rotation: Plane, rows: slice
) -> Plane:
    surface = hits.surface[rows].ravel()
    brightness = _sky(scenery.light, rays, rows)
    index = np.flatnonzero(surface >= 0)
    if index.size == 0:
        return brightness
    number = surface[index]
    row, column = np.divmod(index, brightness.shape[1])
    p, q = rays.p[rows][row], rays.q[rows][row]
    dx, dz = p * rays.x[column], p * rays.z[column]
    t = hits.t[rows].ravel()[index]
    slant = np.abs(_dot(seen.normal, number, dx, q, dz)) / np.sqrt(dx * dx + q * q + dz * dz)
    pixels = _Pixels(
        surface=number,
        s=t * _dot(seen.along_s, number, dx, q, dz) - seen.at_s[number],
        r=t * _dot(seen.along_r, number, dx, q, dz) - seen.at_r[number],
        footprint=t * np.float32(rays.spread) / np.sqrt(np.maximum(slant, np.float32(0.01))),
    )
    colour, gloss = _worn(scenery, columns, pixels)
    sunlight = columns.lambert[number] * _sunshine(scenery, columns, pixels)
    value = colour * (np.float32(scenery.light.sky) + np.float32(scenery.light.sun) * sunlight)
    glossy = np.flatnonzero(gloss > 0)
    if glossy.size:
        direction = np.stack([dx[glossy], q[glossy], dz[glossy]], axis=1)
        mirrored, squarely = _mirrored(scenery, seen, columns, pixels, glossy, direction, rotation)
        weight = gloss[glossy] * (_LEAST_REFLECTION + (1 - _LEAST_REFLECTION) * (1 - squarely) ** 3)
        value[glossy] = value[glossy] * (1 - weight) + weight * mirrored
    brightness.ravel()[index] = value
    return brightness


def _dot(vectors: Plane, number: NDArray[np.int32], dx: Plane, dy: Plane, dz: Plane) -> Plane:
    x, y, z = (np.ascontiguousarray(vectors[:, axis]) for axis in range(3))
    return np.asarray(x[number] * dx + y[number] * dy + z[number] * dz)


def _worn(scenery: Scenery, columns: _Columns, pixels: _Pixels) -> tuple[Plane, Plane]:
    """Albedo and gloss."""
    surfaces, atlas, number = scenery.surfaces, scenery.atlas, pixels.surface
    times_s, times_r = surfaces.times[:, 0][number], surfaces.times[:, 1][number]
    level = mip_level(pixels.footprint * columns.texels_m[number])
    texel = atlas.texels(surfaces.picture[number], pixels.s * times_s, pixels.r * times_r, level)
    grain = np.full(number.shape, atlas.number["grain"], dtype=np.int32)
    grain_texels = np.float32(atlas.size[atlas.number["grain"], 1])
    fine = atlas.texels(
        grain,
        pixels.s * columns.detail_times_s[number],
        pixels.r * columns.detail_times_r[number],
        mip_level(pixels.footprint * grain_texels / surfaces.detail_m[number]),
    )
    detail = np.maximum(1 + surfaces.detail[number] * atlas.albedo[fine], np.float32(0.1))
    return atlas.albedo[texel] * surfaces.albedo[number] * detail, atlas.gloss[texel] * surfaces.gloss[number]


def _sunshine(scenery: Scenery, columns: _Columns, pixels: _Pixels) -> Plane:
    """The share of sunlight that trees let through."""
    atlas, light, number = scenery.atlas, scenery.light, pixels.surface
    shadow = atlas.number[light.shadow]
    x, z = (
        columns.ground[:, axis][number]
        + pixels.s * columns.ground_s[:, axis][number]
        + pixels.r * columns.ground_r[:, axis][number]
        for axis in (0, 1)
    )
    level = mip_level(pixels.footprint * np.float32(atlas.size[shadow, 1] / light.shadow_size_m[0]))
    return atlas.albedo[atlas.texels(np.full(number.shape, shadow, np.int32), x, z, level)]


def _mirrored(
    scenery: Scenery,
    seen: View,
    columns: _Columns,
    pixels: _Pixels,
    glossy: Indices,
    direction: Plane,
    rotation: Plane,
) -> tuple[Plane, Plane]:
    """What glossy pixels mirror, and how squarely (0..1) they face the camera."""
    atlas, number = scenery.atlas, pixels.surface[glossy]
    normal = seen.normal[number]
    normal = normal + columns.turn_s[number] * (pixels.s[glossy] - np.float32(0.5))[:, None]
    normal += columns.turn_r[number] * (pixels.r[glossy] - np.float32(0.5))[:, None]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    direction = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    towards = np.einsum("ij,ij->i", normal, direction)
    out = (direction - 2 * towards[:, None] * normal) @ rotation.T
    around = np.float32(0.5) + np.float32(0.5) * out[:, 0] / (np.abs(out[:, 0]) + np.abs(out[:, 2]) + np.float32(1e-6))
    around = np.where(out[:, 2] < 0, -around, around)
    height = np.clip(np.float32(0.5) + np.float32(0.5) * out[:, 1], 0, np.float32(0.999))
    surroundings = np.full(number.shape, atlas.number[scenery.light.surroundings], dtype=np.int32)
    texel = atlas.texels(surroundings, around, height, np.zeros(number.shape, np.int32))
    return atlas.albedo[texel], np.clip(np.abs(towards), 0, 1)


def _sky(light: Light, rays: Rays, rows: slice) -> Plane:
    """The sky pales towards the horizon."""
    up = -rays.q[rows, None] / np.sqrt(1 + rays.x[None, :] ** 2)
    share = np.clip(up * 2, 0, 1)
    return (light.horizon_brightness + share * (light.zenith_brightness - light.horizon_brightness)).astype(np.float32)
