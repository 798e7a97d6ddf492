"""The pieces of a scene: flat and textured, as columns of one table."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auditor.lab.simulation.textures import Tile
from auditor.model.arrays import Floats32, Mask

Vector = tuple[float, float, float]

_WHOLE = frozenset({Tile.PAINT, Tile.GLASS, Tile.REAR, Tile.WHEEL, Tile.SIGN, Tile.WINDOWS, Tile.FENCE})
"""Tiles whose origin is that of their piece."""

_AS_THEY_ARE = (
    "albedo", "contrast", "stains", "gloss", "bulge", "taper", "see_through", "lost", "speed", "ambient",
)  # fmt: skip
"""Numbers of a piece that the table holds as they are."""


@dataclass(frozen=True)
class Piece:
    """A rectangle, or a trapezoid, in the world frame: x right, y down (the road at 0), z along the road; metres.

    It spans `corner` + s `across` + t `up`, s and t in 0..1, the two at right angles; at t = 1 it is narrower by
    `taper` of its width on either side. A tile spans `tile_m` (across, up). `gloss` is the share of the tile's mask
    that mirrors; with `cut` the mask marks instead where the piece exists. An `oval` piece ends at its ellipse.
    Of a LiDAR's beams the share `see_through` passes where the tile is glass, and `lost` never comes back. `speed`
    moves the piece along the road, in m/s. Pieces of one `body` (any number) and material have one colour.
    """

    corner: Vector
    across: Vector
    up: Vector
    tile: Tile
    tile_m: tuple[float, float] = (2.0, 2.0)
    albedo: float = 0.4
    contrast: float = 1.0
    stains: float = 0.1
    gloss: float = 0.0
    bulge: float = 0.0
    taper: float = 0.0
    cut: bool = False
    oval: bool = False
    see_through: float = 0.0
    lost: float = 0.0
    speed: float = 0.0
    ambient: float = 1.0
    body: int = 0


@dataclass(frozen=True, eq=False)
class Surfaces:
    """N pieces as arrays; see Piece. `shift` (N, 2) is the place in its tile at which each piece begins."""

    corner: Floats32
    across: Floats32
    up: Floats32
    tile: NDArray[np.int32]
    repeats: Floats32  # (N, 2): tiles to the whole piece
    shift: Floats32
    albedo: Floats32
    contrast: Floats32
    stains: Floats32
    gloss: Floats32
    bulge: Floats32
    taper: Floats32
    cut: Mask
    oval: Mask
    see_through: Floats32
    lost: Floats32
    speed: Floats32
    ambient: Floats32

    def __len__(self) -> int:
        return len(self.tile)

    @property
    def normal(self) -> Floats32:
        """(N, 3) unit normals; which of the two directions is not defined."""
        normal = np.cross(self.across, self.up)
        return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True), dtype=np.float32)

    def footprints(self, pixel: float) -> Floats32:
        """(N,) The share of its tile that a ray covers at a distance of 1, straight on, across each piece.

        `pixel` is the angle in radians between neighbouring rays.
        """
        width_m = np.linalg.norm(self.across, axis=1) / self.repeats[:, 0]
        return np.asarray(pixel / width_m, dtype=np.float32)


def gather(pieces: Sequence[Piece], rng: np.random.Generator) -> Surfaces:
    """Make the table; every piece begins at a place of its own in its tile."""

    def column(name: str) -> Floats32:
        return np.array([getattr(piece, name) for piece in pieces], dtype=np.float32)

    across, up = column("across"), column("up")
    size = np.stack([np.linalg.norm(across, axis=1), np.linalg.norm(up, axis=1)], axis=1)
    return Surfaces(
        corner=column("corner"),
        across=across,
        up=up,
        tile=np.array([piece.tile for piece in pieces], dtype=np.int32),
        repeats=np.asarray(size / column("tile_m"), dtype=np.float32),
        shift=_shifts(pieces, rng),
        cut=column("cut").astype(bool),
        oval=column("oval").astype(bool),
        **{name: column(name) for name in _AS_THEY_ARE},
    )


def _shifts(pieces: Sequence[Piece], rng: np.random.Generator) -> Floats32:
    shift = rng.random((len(pieces), 2), dtype=np.float32)
    shift[[piece.tile in _WHOLE for piece in pieces]] = 0
    return shift
