"""Pictures that surfaces wear, all in one flat memory with their mip levels."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Plane = NDArray[np.float32]
Texels = NDArray[np.int32]

_LEVELS = 9


@dataclass(frozen=True, eq=False)
class Picture:
    """What a surface looks like, (h, w) each, sides powers of two, repeated beyond its borders.

    `albedo` and `gloss` lie in 0..1; where `hole` is True there is nothing; `glass` lets laser light through.
    """

    albedo: Plane
    gloss: Plane | None = None
    hole: NDArray[np.bool_] | None = None
    glass: NDArray[np.bool_] | None = None


@dataclass(frozen=True, eq=False)
class Atlas:
    """Pictures by name. `start` (pictures, levels) is where each mip level begins in the flat planes."""

    names: tuple[str, ...]
    size: NDArray[np.int32]
    start: NDArray[np.int32]
    albedo: NDArray[np.float32]
    gloss: NDArray[np.float32]
    hole: NDArray[np.bool_]
    glass: NDArray[np.bool_]
    has_hole: NDArray[np.bool_]
    has_glass: NDArray[np.bool_]

    @cached_property
    def number(self) -> dict[str, int]:
        """The number of each picture by its name."""
        return {name: number for number, name in enumerate(self.names)}

    def texels(self, picture: Texels, s: Plane, r: Plane, level: Texels) -> Texels:
        """Where the pictures' values at (s, r), in picture lengths, lie in the flat planes."""
        height, width = self.size[picture, 0], self.size[picture, 1]
        column = np.floor(s * width).astype(np.int32) & (width - 1)
        row = np.floor(r * height).astype(np.int32) & (height - 1)
        level = np.minimum(level, _LEVELS - 1)
        return np.asarray(self.start[picture, level] + (row >> level) * _halved(width, level) + (column >> level))


def make_atlas(pictures: Mapping[str, Picture]) -> Atlas:
    """Lay the pictures out with their mip levels; their share of holes stays the same."""
    planes: dict[str, list[NDArray[np.generic]]] = {"albedo": [], "gloss": [], "hole": [], "glass": []}
    start = np.zeros((len(pictures), _LEVELS), dtype=np.int32)
    position = 0
    for number, picture in enumerate(pictures.values()):
        shape = picture.albedo.shape
        albedo = picture.albedo.astype(np.float32)
        gloss = np.zeros(shape, np.float32) if picture.gloss is None else picture.gloss.astype(np.float32)
        hole = np.zeros(shape, bool) if picture.hole is None else picture.hole
        glass = np.zeros(shape, bool) if picture.glass is None else picture.glass
        for level in range(_LEVELS):
            start[number, level] = position
            position += albedo.size
            for name, plane in (("albedo", albedo), ("gloss", gloss), ("hole", hole), ("glass", glass)):
                planes[name].append(plane.ravel())
            albedo, gloss = _mean_of_four(albedo), _mean_of_four(gloss)
            hole, glass = _fewer_holes(hole), _one_of_four(glass)
    values = list(pictures.values())
    return Atlas(
        names=tuple(pictures),
        size=np.array([picture.albedo.shape for picture in values], dtype=np.int32),
        start=start,
        albedo=np.concatenate(planes["albedo"]).astype(np.float32),
        gloss=np.concatenate(planes["gloss"]).astype(np.float32),
        hole=np.concatenate(planes["hole"]).astype(np.bool_),
        glass=np.concatenate(planes["glass"]).astype(np.bool_),
        has_hole=np.array([picture.hole is not None and bool(picture.hole.any()) for picture in values]),
        has_glass=np.array([picture.glass is not None and bool(picture.glass.any()) for picture in values]),
    )


def mip_level(texels_a_pixel: Plane) -> Texels:
    """The level whose texels are between half a pixel and one pixel wide: finer, since the nearest texel is taken."""
    exponent = (np.maximum(texels_a_pixel, np.float32(1.0)).view(np.int32) >> 23) - 127
    return np.asarray(exponent, dtype=np.int32)


def _halved(width: Texels, level: Texels) -> Texels:
    return np.asarray(np.maximum(width >> level, 1))


def _mean_of_four(plane: Plane) -> Plane:
    if plane.shape[0] > 1:
        plane = np.float32(0.5) * (plane[::2] + plane[1::2])
    if plane.shape[1] > 1:
        plane = np.float32(0.5) * (plane[:, ::2] + plane[:, 1::2])
    return plane


def _fewer_holes(hole: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Half the size, the emptiest quarters empty, and as much of it as before."""
    mean = _mean_of_four(hole.astype(np.float32))
    return np.asarray(mean > np.quantile(mean, 1 - hole.mean()))


def _one_of_four(plane: NDArray[np.bool_]) -> NDArray[np.bool_]:
    return plane[:: 2 if plane.shape[0] > 1 else 1, :: 2 if plane.shape[1] > 1 else 1]
