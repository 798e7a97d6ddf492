"""What a ray brings back: light from textured, shaded, shadowed and glossy pieces, or from the sky."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auditor.geometry import Matrix
from auditor.lab.casting import Hits, Rays
from auditor.lab.surfaces import Surfaces
from auditor.lab.textures import Atlas, Tile, level_of

_STAIN_SHARE = np.float32(0.137)  # of a tile's frequency, so that repeated tiles differ
_HAZE_M = 400.0
_GRAZING = np.float32(0.2)

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class Light:
    """`sun` is the unit direction to the sun in the world frame; strengths are radiances of a white surface.

    `shade` is the share of the sun's light kept out where trees stand; `shade_m` the size of a shadow's tile.
    """

    sun: tuple[float, float, float]
    direct: float = 1.1
    ambient: float = 0.35
    sky: float = 1.3
    shade: float = 0.8
    shade_m: float = 18.0


def radiance(rays: Rays, hits: Hits, surfaces: Surfaces, atlas: Atlas, light: Light, world_SE3_rig: Matrix) -> Floats:
    """(H, W) radiances; `surfaces` are those that were cast at, in the rig frame."""
    result = _sky(rays, atlas, light)
    at = np.flatnonzero(hits.piece >= 0)
    piece = hits.piece.ravel()[at]
    s, t, distance = (values.ravel()[at] for values in (hits.s, hits.t, hits.distance))
    x, y, z = (np.broadcast_to(axis, rays.shape).ravel()[at] for axis in (rays.x, rays.y, rays.z))
    normal = surfaces.normal
    facing = _dot(normal, piece, x, y, z)
    length = np.sqrt(x * x + y * y + z * z)
    slant = np.maximum(np.abs(facing) / length, np.float32(0.02))

    value, mask = _texture(atlas, surfaces, piece, s, t, distance * rays.pixel / np.sqrt(slant))
    world = _world(rays, x, y, z, distance, world_SE3_rig)
    lit = _lit(atlas, light, world)
    to_sun = (normal @ (world_SE3_rig[:3, :3].T @ np.array(light.sun))).astype(np.float32) * np.float32(light.direct)
    # A side is lit if it is the sun's; leaves let light through.
    sun = np.where(surfaces.cut.take(piece), np.abs(to_sun).take(piece), to_sun.take(piece) * -np.sign(facing))
    bright = surfaces.albedo.take(piece) * value
    bright *= np.float32(light.ambient) * surfaces.ambient.take(piece) + np.maximum(sun, 0) * lit

    gloss = surfaces.gloss.take(piece) * mask
    glossy = np.flatnonzero(gloss > 0.02)
    if glossy.size:
        mine = piece[glossy]
        mirrored = _mirrored(
            atlas, surfaces, normal, mine, (x[glossy], y[glossy], z[glossy]), facing[glossy], (s[glossy], t[glossy])
        )
        # Schlick: a surface mirrors more the flatter it is looked at.
        grazing = gloss[glossy] + _GRAZING * (1 - slant[glossy]) ** 5
        bright[glossy] += grazing * (mirrored - bright[glossy])
    haze = 1 - np.exp(-distance / np.float32(_HAZE_M))
    bright += haze * (np.float32(0.7) - bright)
    result.ravel()[at] = bright
    return result


def _dot(normal: Floats, piece: NDArray[np.int32], x: Floats, y: Floats, z: Floats) -> Floats:
    return np.asarray(normal[:, 0].take(piece) * x + normal[:, 1].take(piece) * y + normal[:, 2].take(piece) * z)


def _texture(
    atlas: Atlas, surfaces: Surfaces, piece: NDArray[np.int32], s: Floats, t: Floats, footprint_m: Floats
) -> tuple[Floats, Floats]:
    """(N,) texture values, stains included, and masks (gloss)."""
    tile_m = np.linalg.norm(surfaces.across, axis=1) / surfaces.repeats[:, 0]
    footprint = footprint_m / tile_m.astype(np.float32).take(piece)
    level = level_of(footprint)
    tile = surfaces.tile.take(piece)
    across = s * surfaces.repeats[:, 0].take(piece) + surfaces.shift[:, 0].take(piece)
    up = t * surfaces.repeats[:, 1].take(piece) + surfaces.shift[:, 1].take(piece)
    value = 1 + surfaces.contrast.take(piece) * (atlas.bilinear(tile, across, up, level) - 1)
    stains = np.full(piece.size, Tile.STAINS, dtype=np.int32)
    coarse = np.maximum(level - 2, 0)
    stain = atlas.bilinear(stains, across * _STAIN_SHARE, up * _STAIN_SHARE, coarse)
    value *= 1 + surfaces.stains.take(piece) * (stain - 1)
    return np.maximum(value, np.float32(0.02)), atlas.masks(tile, across, up, level)


def _world(
    rays: Rays, x: Floats, y: Floats, z: Floats, distance: Floats, world_SE3_rig: Matrix
) -> tuple[Floats, Floats, Floats]:
    """Where the rays end, in the world frame; for a camera, whose rays start from one place."""
    R, translation = world_SE3_rig[:3, :3].astype(np.float32), world_SE3_rig[:3, 3].astype(np.float32)
    start = R @ np.array([float(axis) for axis in rays.origin], dtype=np.float32) + translation
    a, b, c = (start[row] + (R[row, 0] * x + R[row, 1] * y + R[row, 2] * z) * distance for row in range(3))
    return a, b, c


def _lit(atlas: Atlas, light: Light, world: tuple[Floats, Floats, Floats]) -> Floats:
    """(N,) share of the sun's light that arrives: crowns throw shadows."""
    x, y, z = world
    sx, sy, sz = light.sun
    across, along = x - y * np.float32(sx / sy), z - y * np.float32(sz / sy)
    tile = np.full(x.size, Tile.SHADE, dtype=np.int32)
    scale = np.float32(1 / light.shade_m)
    crowns = atlas.bilinear(tile, across * scale, along * scale * np.float32(0.7), np.zeros(x.size, dtype=np.int32))
    return np.asarray(1 - np.float32(light.shade) * (1 - crowns))


def _mirrored(
    atlas: Atlas,
    surfaces: Surfaces,
    normal: Floats,
    piece: NDArray[np.int32],
    direction: tuple[Floats, Floats, Floats],
    facing: Floats,
    place: tuple[Floats, Floats],
) -> Floats:
    """(N,) radiances that glossy pieces mirror: far surroundings, and closer the more a piece bulges."""
    x, y, z = (axis - 2 * facing * normal[:, row].take(piece) for row, axis in enumerate(direction))
    bulge = surfaces.bulge.take(piece)
    s, t = place
    azimuth = np.arctan2(x, z) + 2 * bulge * (s - np.float32(0.5))
    elevation = np.arctan2(-y, np.hypot(x, z)) + bulge * (t - np.float32(0.3))
    tile = np.full(piece.size, Tile.SURROUNDINGS, dtype=np.int32)
    row = np.clip(np.float32(0.5) + elevation / np.float32(np.pi), np.float32(0.02), np.float32(0.98))
    return atlas.bilinear(tile, azimuth / np.float32(2 * np.pi), row, np.zeros(piece.size, dtype=np.int32))


def _sky(rays: Rays, atlas: Atlas, light: Light) -> Floats:
    """(H, W) sky, brightest near the horizon."""
    up = np.broadcast_to(-rays.y, rays.shape)
    return np.asarray(np.float32(light.sky) * (1 - np.float32(0.8) * np.clip(up, 0, 1)), dtype=np.float32)
