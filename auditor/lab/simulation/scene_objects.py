"""The objects of a street, built of pieces. World frame: x right, y down with the road at 0, z along the road."""

import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import wraps
from typing import ParamSpec

import numpy as np

from auditor.lab.simulation.raycasting import Hits, Rays, cast
from auditor.lab.simulation.surfaces import Piece, Surfaces, Vector
from auditor.lab.simulation.textures import Atlas, Tile
from auditor.model.arrays import Indices
from auditor.model.optics.geometry import Matrix

_CAMERA_HEIGHT_M = 1.65

Span = tuple[float, float]
Given = ParamSpec("Given")


def one_body(maker: Callable[Given, Iterator[Piece]]) -> Callable[Given, Iterator[Piece]]:
    """Mark all pieces of an object as one body, by the place of its first one; nothing else changes."""

    @wraps(maker)
    def marked(*given: Given.args, **more: Given.kwargs) -> Iterator[Piece]:
        body = 0
        for piece in maker(*given, **more):
            body = body or zlib.crc32(np.array(piece.corner).tobytes())
            yield replace(piece, body=body)

    return marked


@dataclass(frozen=True)
class Look:
    """The appearance of an object's faces; see Piece."""

    tile: Tile
    tile_m: tuple[float, float] = (2.0, 2.0)
    albedo: float = 0.4
    contrast: float = 1.0
    stains: float = 0.1
    gloss: float = 0.0
    ambient: float = 1.0

    def piece(self, corner: Vector, across: Vector, up: Vector) -> Piece:
        """One face."""
        return Piece(corner, across, up, see_through=0.3 if self.gloss else 0.0, **vars(self))


def between(a: float, b: float) -> Span:
    """Two places, the lower one first."""
    return (a, b) if a < b else (b, a)


def strip(x: Span, z: Span, height_m: float, look: Look) -> Piece:
    """Level ground."""
    return look.piece((x[0], -height_m, z[0]), (x[1] - x[0], 0, 0), (0, 0, z[1] - z[0]))


def box(x: Span, z: Span, y: Span, look: Look) -> Iterator[Piece]:
    """The faces of a box that a vehicle sees that comes along z near x = 0; `y` are heights above the road."""
    (left, right), (near, far), (low, high) = x, z, y
    rise = (0.0, -(high - low), 0.0)
    yield look.piece((left, -low, near), (right - left, 0, 0), rise)
    side = left if left > 0 else right
    yield look.piece((side, -low, near), (0, 0, far - near), rise)
    if high < _CAMERA_HEIGHT_M:
        yield look.piece((left, -high, near), (right - left, 0, 0), (0, 0, far - near))


@one_body
def car(x_m: float, z_m: float, rng: np.random.Generator, *, speed: float = 0.0) -> Iterator[Piece]:
    """A car whose middle is at x and whose nearer end is at z."""
    length, width = rng.uniform(3.8, 4.8), rng.uniform(1.66, 1.85)
    waist, roof = rng.uniform(0.82, 0.98), rng.uniform(1.38, 1.55)
    albedo = float(rng.choice([0.02, 0.03, 0.04, 0.07, 0.15, 0.3, 0.5, 0.7]))
    left, right, far = x_m - width / 2, x_m + width / 2, z_m + length
    side = left if x_m > 0 else right
    inward = 0.16 if x_m > 0 else -0.16

    def face(corner: Vector, across: Vector, up: Vector, tile: Tile, **more: float) -> Piece:
        given = {"albedo": albedo, "gloss": 1.0, "bulge": 1.2, "stains": 0.0, "see_through": 0.0, **more}
        size = (float(np.linalg.norm(across)), float(np.linalg.norm(up)))
        return Piece(corner, across, up, tile, size, speed=speed, cut=tile is Tile.WHEEL, **given)  # type: ignore[arg-type]

    lost = 0.6 if albedo < 0.1 else 0.05  # dark paint reflects a LiDAR's pulses away
    yield face((left, -0.01, z_m), (width, 0, 0), (0, 0, length), Tile.ASPHALT, albedo=0.03, ambient=0.3, gloss=0.0)
    yield face((left, -0.25, z_m), (width, 0, 0), (0, -(waist - 0.25), 0.06), Tile.REAR, lost=lost * 0.6)
    yield face((side, -0.25, z_m), (0, 0, length), (0, -(waist - 0.25), 0), Tile.PAINT, lost=lost)
    yield face((left, -waist, z_m), (width, 0, 0), (0, -0.03, length), Tile.PAINT, lost=lost)
    glass = {"albedo": 0.12, "see_through": 0.25, "lost": 0.5, "bulge": 1.6}
    cabin, back = 0.58 * length, z_m + rng.uniform(0.15, 0.5)
    rise = roof - waist
    yield face(
        (left + 0.06, -waist, back), (width - 0.12, 0, 0), (0, -rise, rise * 0.9), Tile.GLASS, taper=0.08, **glass
    )
    yield face((side, -waist, back), (0, 0, cabin), (inward, -rise, 0), Tile.GLASS, taper=0.17, **glass)
    top = back + rise * 0.9
    yield face((left + 0.2, -roof, top), (width - 0.4, 0, 0), (0, -0.02, cabin - rise * 1.7), Tile.PAINT, lost=lost)
    for wheel in (z_m + 0.55, far - 1.15):
        at = side - 0.01 if x_m > 0 else side + 0.01
        yield face((at, 0.0, wheel), (0, 0, 0.62), (0, -0.62, 0), Tile.WHEEL, albedo=0.08, gloss=0.0, oval=True)


@one_body
def crown(
    middle: Vector, radius_m: float, height_m: float, layers: int, rng: np.random.Generator, *, tile: Tile = Tile.LEAVES
) -> Iterator[Piece]:
    """Leaves: ragged discs, some behind one another and some crossing, with sky between them."""
    x, y, z = middle
    albedo = float(rng.uniform(0.1, 0.3))
    grain = float(rng.uniform(1.2, 2.4))
    for across_road in (False, True):
        count = max(layers // 3, 1) if across_road else layers
        for offset in np.linspace(-0.9, 0.9, count) if count > 1 else [0.0]:
            reach = radius_m * float(np.sqrt(1 - offset * offset)) * rng.uniform(0.85, 1.1)
            tall = height_m * float(np.sqrt(1 - offset * offset)) * rng.uniform(0.85, 1.1)
            shift = offset * radius_m + rng.normal(0, 0.05)
            cx, cz = (x + shift, z - reach) if across_road else (x - reach, z + shift)
            width: Vector = (0, 0, 2 * reach) if across_road else (2 * reach, 0, 0)
            yield Piece(
                (cx, y + tall, cz),
                width,
                (0, -2 * tall, 0),
                tile,
                (grain, grain),
                albedo=albedo,
                contrast=0.9,
                stains=0.4,
                cut=True,
                oval=True,
                ambient=float(rng.uniform(0.5, 1.3)),
            )


@one_body
def tree(x_m: float, z_m: float, layers: int, rng: np.random.Generator) -> Iterator[Piece]:
    """A trunk and a crown."""
    thick, bare = rng.uniform(0.2, 0.5), rng.uniform(1.9, 3.0)
    look = Look(Tile.BARK, (1.0, 1.5), albedo=float(rng.uniform(0.1, 0.25)))
    yield from box((x_m - thick / 2, x_m + thick / 2), (z_m, z_m + thick), (0, bare + 1.5), look)
    reach, tall = rng.uniform(1.7, 3.0), rng.uniform(1.6, 2.8)
    yield from crown((x_m, -(bare + tall), z_m), reach, tall, layers, rng)


@one_body
def hedge(x_m: float, start_m: float, end_m: float, height_m: float, rng: np.random.Generator) -> Iterator[Piece]:
    """A rough face along the road, four leaves deep, with a rough top and an end."""
    side = 1 if x_m > 0 else -1
    leaves = Piece(
        (x_m, 0, start_m), (side * 1.0, 0, 0), (0, -height_m, 0), Tile.HEDGE, (1.3, 1.3),
        albedo=float(rng.uniform(0.12, 0.3)), contrast=0.9, stains=0.4,
    )  # fmt: skip
    along: Vector = (0, 0, end_m - start_m)
    for depth in range(4):
        rise = (0, -height_m - rng.uniform(-0.05, 0.1), 0)
        yield replace(
            leaves,
            corner=(x_m + side * 0.12 * depth, 0, start_m),
            across=along,
            up=rise,
            cut=depth < 3,
            ambient=1.2 - 0.25 * depth,
        )
    for layer in range(3):
        corner: Vector = (x_m + side * 0.05, -height_m + 0.1 * layer, start_m)
        yield replace(leaves, corner=corner, up=along, albedo=leaves.albedo * 1.2, cut=layer < 2)
    yield leaves


@one_body
def house(
    x_m: float, start_m: float, end_m: float, height_m: float, look: Look, *, roof: Look | None = None
) -> Iterator[Piece]:
    """A front along the road and the end that faces the vehicle; a roof that slopes away from the road."""
    side = 1 if x_m > 0 else -1
    depth = 9.0
    inner, outer = between(x_m, x_m + side * depth)
    yield from box((inner, outer), (start_m, end_m), (0, height_m), look)
    if roof is not None:
        eaves = x_m - side * 0.4
        yield roof.piece(
            (eaves, -height_m + 0.3, start_m), (0, 0, end_m - start_m), (side * depth / 2, -depth * 0.4, 0)
        )
        gable = look.piece((inner, -height_m, start_m), (outer - inner, 0, 0), (0, -depth * 0.36, 0))
        yield replace(gable, taper=0.49)


@one_body
def pole(x_m: float, z_m: float, height_m: float, rng: np.random.Generator) -> Iterator[Piece]:
    """A lamp post or a sign's post."""
    thick = rng.uniform(0.07, 0.18)
    look = Look(Tile.CONCRETE, (3.0, 7.0), albedo=float(rng.uniform(0.08, 0.5)))
    yield from box((x_m - thick / 2, x_m + thick / 2), (z_m, z_m + thick), (0, height_m), look)


@one_body
def sign(
    x_m: float, z_m: float, low_m: float, width_m: float, height_m: float, rng: np.random.Generator
) -> Iterator[Piece]:
    """A board on two posts that faces the vehicle."""
    yield from pole(x_m - width_m / 3, z_m + 0.1, low_m + height_m, rng)
    yield from pole(x_m + width_m / 3, z_m + 0.1, low_m + height_m, rng)
    look = Look(Tile.SIGN, (width_m, height_m), albedo=float(rng.uniform(0.3, 0.8)), stains=0.05)
    yield look.piece((x_m - width_m / 2, -low_m, z_m), (width_m, 0, 0), (0, -height_m, 0))


@one_body
def fence(x_m: float, start_m: float, end_m: float, height_m: float, rng: np.random.Generator) -> Iterator[Piece]:
    """Bars along the road, all alike."""
    yield Piece(
        (x_m, -0.1, start_m), (0, 0, end_m - start_m), (0, -height_m, 0), Tile.FENCE, (2.0, height_m),
        albedo=float(rng.uniform(0.1, 0.7)), cut=True,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Vehicle3D:
    """A vehicle of a street: (3,) least and greatest corner in the world frame at time 0, its speed, and its pieces."""

    low_m: Matrix
    high_m: Matrix
    speed_m_s: float
    pieces: Indices

    def corners_m(self, rig_SE3_world: Matrix, time_s: float) -> Matrix:
        """(8, 3) corners in the rig frame: its underside first, around the box, then its roof in the same order."""
        low, high = (end + np.array([0, 0, self.speed_m_s * time_s]) for end in (self.low_m, self.high_m))
        around = [(low[0], low[2]), (high[0], low[2]), (high[0], high[2]), (low[0], high[2])]
        world = np.array([(x, y, z) for y in (high[1], low[1]) for x, z in around])
        return np.asarray(world @ rig_SE3_world[:3, :3].T + rig_SE3_world[:3, 3])


def vehicles_among(pieces: Sequence[Piece]) -> tuple[Vehicle3D, ...]:
    """The vehicles that a street's pieces make up: bodies with a rear."""
    by_body: dict[int, list[int]] = {}
    for at, piece in enumerate(pieces):
        by_body.setdefault(piece.body, []).append(at)
    bodies = [at for at in by_body.values() if any(pieces[one].tile is Tile.REAR for one in at)]
    return tuple(_vehicle(pieces, at) for at in bodies)


def seen_share(vehicle: Vehicle3D, surfaces: Surfaces, rays: Rays, hits: Hits, atlas: Atlas) -> float:
    """The share of the rays to a vehicle that nothing else is met by before it; 0 where it is not in the view.

    `surfaces` and `hits` are of the whole street, in the rig frame.
    """
    alone = cast(rays, _chosen(surfaces, vehicle.pieces), atlas)
    whole = int(np.count_nonzero(alone.piece >= 0))
    return int(np.count_nonzero(np.isin(hits.piece, vehicle.pieces))) / whole if whole else 0.0


def _vehicle(pieces: Sequence[Piece], at: Sequence[int]) -> Vehicle3D:
    corners = []
    for piece in (pieces[one] for one in at):
        corner, across, up = (np.array(of) for of in (piece.corner, piece.across, piece.up))
        corners += [corner, corner + across, corner + up, corner + across + up]
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    return Vehicle3D(low, high, pieces[at[0]].speed, np.array(at))


def _chosen(surfaces: Surfaces, at: Indices) -> Surfaces:
    return replace(surfaces, **{name: values[at] for name, values in vars(surfaces).items()})
