"""Casts rays of sensors at a scene: the first piece that each ray meets, the place on it, and the distance."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auditor.lab.simulation.surfaces import Surfaces
from auditor.lab.simulation.textures import Atlas, level_of
from auditor.model.arrays import Floats32, Indices, Mask
from auditor.model.optics.geometry import Matrix


@dataclass(frozen=True, eq=False)
class Rays:
    """A grid of H x W rays in the rig frame.

    `x`, `y` and `z` are their directions and `origin` the places they start from; each broadcasts to (H, W). `pixel` is
    the angle in radians between neighbours. A grid with `focal_px` is a camera's: z = 1, distances along the rays are
    depths, and `principal_px` is the pixel straight ahead. Without one it is a LiDAR's: columns are evenly spaced
    azimuths from `first_azimuth` on. A camera whose rays are bent has x and y for each pixel and no `principal_px`.
    """

    shape: tuple[int, int]
    x: Floats32
    y: Floats32
    z: Floats32
    origin: tuple[Floats32, Floats32, Floats32]
    pixel: float
    principal_px: tuple[float, float] | None = None
    focal_px: float | None = None
    first_azimuth: float = 0.0

    def camera_directions(self, at: Indices) -> tuple[Floats32, Floats32]:
        """The x and y of a camera's rays at (N,) flat places of the grid."""
        if self.principal_px is None:
            return self.x.take(at), self.y.take(at)
        row, column = np.divmod(at, self.shape[1])
        return self.x.take(column), self.y.take(row)


@dataclass(frozen=True, eq=False)
class Hits:
    """The hits of H x W rays: the piece (-1: none), its s and t there, and the distance in lengths of the ray (inf)."""

    piece: NDArray[np.int32]
    s: Floats32
    t: Floats32
    distance: Floats32


_NEAR_M = 0.2
_SLACK_M = 0.02  # that rounding may add to a piece
_CAMERA_MARGIN = 2
_LIDAR_MARGIN = 24  # columns: its beams do not start from one place


def windows(rays: Rays, surfaces: Surfaces) -> tuple[Floats32, NDArray[np.int32]]:
    """The nearest depth of each piece, (N,) metres, and the part of the grid in which it may lie.

    The latter is (N, 4): first row, one past the last, first column, one past the last.
    """
    start = np.array([float(np.mean(axis)) for axis in rays.origin], dtype=np.float32)
    a = surfaces.corner - start
    b, c = a + surfaces.across, a + surfaces.up
    corners = np.stack([a, b, b + surfaces.up, c], axis=1)
    following = np.roll(corners, -1, axis=1)
    # Where an edge passes through the plane just ahead of the sensor, that point bounds the visible part of the piece.
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (_NEAR_M - corners[:, :, 2]) / (following[:, :, 2] - corners[:, :, 2])
    crosses = (share > 0) & (share < 1)
    crossing = corners + np.where(crosses, share, 0)[:, :, None] * (following - corners)
    crossing[:, :, 2] = np.where(crosses, _NEAR_M, -1)
    points = np.concatenate([corners, crossing], axis=1)
    ahead = points[:, :, 2] >= _NEAR_M
    nearest = np.where(ahead, points[:, :, 2], np.inf).min(axis=1)
    depth = np.where(ahead, points[:, :, 2], 1)
    x, y = points[:, :, 0], points[:, :, 1]
    if rays.focal_px is None:
        azimuth = np.arctan2(x, depth)
        left, right = _range((azimuth - rays.first_azimuth) / rays.pixel, ahead, _LIDAR_MARGIN, rays.shape[1])
        return nearest, np.stack([*_beams(rays, corners), left, right], axis=1)
    if rays.principal_px is None:
        columns = _bent_range(x / depth, ahead, rays.x.min(axis=0), rays.x.max(axis=0))
        rows = _bent_range(y / depth, ahead, rays.y.min(axis=1), rays.y.max(axis=1))
        return nearest, np.stack([*rows, *columns], axis=1)
    u0, v0 = rays.principal_px
    left, right = _range(x / depth * rays.focal_px + u0, ahead, _CAMERA_MARGIN, rays.shape[1])
    top, bottom = _range(y / depth * rays.focal_px + v0, ahead, _CAMERA_MARGIN, rays.shape[0])
    return nearest, np.stack([top, bottom, left, right], axis=1)


def spread_m(rays: Rays) -> float:
    """How far apart the places may be from which rays start, metres."""
    return sum(float(np.ptp(axis)) for axis in rays.origin)


def _beams(rays: Rays, corners: Floats32) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """First and one past the last row of a LiDAR whose beams may meet each piece; (N, 4, 3) corners from its middle.

    The edges of a piece are bent in elevation: what bounds it are its heights, and how near and far it may be.
    """
    moved = spread_m(rays)
    low, high = corners.min(axis=1) - _SLACK_M, corners.max(axis=1) + _SLACK_M
    beside = np.maximum(np.maximum(low, -high), 0)[:, [0, 2]]
    near = np.maximum(np.hypot(*beside.T) - moved, _SLACK_M)
    far = np.hypot(corners[:, :, 0], corners[:, :, 2]).max(axis=1) + _SLACK_M + moved
    top, bottom = low[:, 1], high[:, 1]
    slopes = np.stack([top / np.where(top < 0, near, far), bottom / np.where(bottom > 0, near, far)], axis=1)
    of_rays = rays.y / np.hypot(rays.x, rays.z)
    first, last = _bent_range(slopes, np.True_, of_rays.min(axis=1), of_rays.max(axis=1))
    # One row at least: pieces that are equally near are met in an order that depends on how many there are.
    first = np.minimum(first, rays.shape[0] - 1)
    return first, np.maximum(last, first + 1)


def _bent_range(
    places: NDArray[np.floating], ahead: Mask | np.bool_, least: Floats32, most: Floats32
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """As `_range`, for columns (or rows) whose rays reach from `least` to `most`, both rising but for their noise."""
    low, high = np.where(ahead, places, np.inf).min(axis=1), np.where(ahead, places, -np.inf).max(axis=1)
    first = np.searchsorted(np.maximum.accumulate(most), low)
    last = np.searchsorted(np.minimum.accumulate(least[::-1])[::-1], high, side="right")
    return first.astype(np.int32), np.maximum(first, last).astype(np.int32)


def _range(
    places: NDArray[np.floating], ahead: Mask, margin: int, size: int
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """First and one past the last row (or column) that lies within the grid."""
    low = np.where(ahead, places, np.inf).min(axis=1)
    high = np.where(ahead, places, -np.inf).max(axis=1)
    first = np.clip(np.nan_to_num(np.floor(low)) - margin, 0, size)
    last = np.clip(np.nan_to_num(np.ceil(high)) + margin + 1, 0, size)
    return first.astype(np.int32), last.astype(np.int32)


_FAR_M = 180.0
_TOGETHER = 128  # pieces
_FEW = 2000  # rays: a piece with more of them is met alone
_THERE = 0.5  # of a mask
_GLASS = 0.11


def placed(surfaces: Surfaces, rig_SE3_world: Matrix, time_s: float) -> Surfaces:
    """The pieces in the rig frame at a time."""
    R, translation = rig_SE3_world[:3, :3].astype(np.float32), rig_SE3_world[:3, 3].astype(np.float32)
    moved = surfaces.corner.copy()
    moved[:, 2] += surfaces.speed * np.float32(time_s)
    return replace(surfaces, corner=moved @ R.T + translation, across=surfaces.across @ R.T, up=surfaces.up @ R.T)


def cast(rays: Rays, surfaces: Surfaces, atlas: Atlas, rng: np.random.Generator | None = None) -> Hits:
    """Meet rays with pieces that are in the rig frame.

    With `rng` see-through pieces let their share of the rays pass (a LiDAR); without one they are there for all.
    """
    hits = Hits(
        piece=np.full(rays.shape, -1, dtype=np.int32),
        s=np.zeros(rays.shape, dtype=np.float32),
        t=np.zeros(rays.shape, dtype=np.float32),
        distance=np.full(rays.shape, np.inf, dtype=np.float32),
    )
    nearest, boxes = windows(rays, surfaces)
    seen = np.flatnonzero((boxes[:, 0] < boxes[:, 1]) & (boxes[:, 2] < boxes[:, 3]) & (nearest < _FAR_M))
    order = seen[np.argsort(nearest[seen])]
    rank = np.zeros(len(surfaces), dtype=np.intp)
    rank[order] = np.arange(order.size)
    target = _Target(rays, surfaces, atlas, _planes(surfaces), surfaces.footprints(rays.pixel), nearest, boxes, rank)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        if rng is not None:  # What is drawn depends on the pieces before.
            _meet_in_turn(target, order, hits, rng)
        else:
            few = _areas(boxes) <= _FEW
            for first in range(0, order.size, _TOGETHER):
                part = order[first : first + _TOGETHER]
                _meet_in_turn(target, part[~few[part]], hits, rng)
                _meet_together(target, part[few[part]], hits)
    return hits


@dataclass(frozen=True, eq=False)
class _Target:
    """What rays are cast at: N pieces with what is needed to meet each.

    `planes` are of `_planes`, `footprint` of `Surfaces.footprints`, `nearest` and `boxes` of `windows`; `rank` is the
    place of each in the order in which they are met.
    """

    rays: Rays
    surfaces: Surfaces
    atlas: Atlas
    planes: Floats32
    footprint: Floats32
    nearest: Floats32
    boxes: NDArray[np.int32]
    rank: Indices


def _planes(surfaces: Surfaces) -> Floats32:
    """(N, 4, 3): corners, normals of any length, and what a step of s and t is in the scene's axes."""
    across, up = surfaces.across, surfaces.up
    along = [axis / np.sum(axis * axis, axis=1, keepdims=True) for axis in (across, up)]
    return np.stack([surfaces.corner, np.cross(across, up), *along], axis=1)


def _meet_in_turn(target: _Target, pieces: Indices, hits: Hits, rng: np.random.Generator | None) -> None:
    """Enter pieces into the hits, one after the other."""
    moved = spread_m(target.rays)
    for piece in pieces.tolist():
        top, bottom, left, right = target.boxes[piece].tolist()
        window = (slice(top, bottom), slice(left, right))
        # A ray is at least as long as the depth that it reaches, from where it starts.
        if hits.distance[window].max() > target.nearest[piece] - moved:
            _meet(target, piece, window, hits, rng)


def _meet(
    target: _Target, piece: int, window: tuple[slice, slice], hits: Hits, rng: np.random.Generator | None
) -> None:
    """Enter one piece into the hits of one window."""
    rays, surfaces = target.rays, target.surfaces
    ray = [_part(axis, window) for axis in (rays.x, rays.y, rays.z)]
    corner, normal, across, up = target.planes[piece]
    start = [_part(axis, window) - at for axis, at in zip(rays.origin, corner, strict=True)]
    distance = -_dot(normal, start) / _dot(normal, ray)
    met = (distance > 0) & (distance < hits.distance[window])
    if not met.any():
        return
    t = _dot(up, ray) * distance + _dot(up, start)
    met &= (t >= 0) & (t <= 1)
    s = _dot(across, ray) * distance + _dot(across, start)
    if surfaces.oval[piece]:
        met &= (s - 0.5) ** 2 + (t - 0.5) ** 2 <= 0.25
    elif surfaces.taper[piece]:
        met &= np.abs(s - 0.5) <= 0.5 - surfaces.taper[piece] * t
    else:
        met &= (s >= 0) & (s <= 1)
    if not met.any():
        return
    if surfaces.cut[piece] or (rng is not None and surfaces.see_through[piece]):
        at = np.flatnonzero(met)
        mask = _masks(target, piece, *(values.ravel()[at] for values in (s, t, distance)))
        if surfaces.cut[piece]:
            met.ravel()[at] = mask > _THERE
        else:
            assert rng is not None
            passed = rng.random(at.size, dtype=np.float32) < surfaces.see_through[piece]
            met.ravel()[at] = (mask < _GLASS) | ~passed
    for grid, new in ((hits.distance, distance), (hits.s, s), (hits.t, t), (hits.piece, np.int32(piece))):
        np.copyto(grid[window], new, where=met)


class _PieceHits(NamedTuple):
    """N rays that met a piece, each with the piece, the place on it, and the distance; `at` are flat places of rays."""

    at: Indices
    piece: Indices
    s: Floats32
    t: Floats32
    distance: Floats32

    def chosen(self, rows: Indices) -> "_PieceHits":
        """Some of them."""
        at, piece = self.at.take(rows), self.piece.take(rows)
        return _PieceHits(at, piece, self.s.take(rows), self.t.take(rows), self.distance.take(rows))


def _meet_together(target: _Target, pieces: Indices, hits: Hits) -> None:
    """Enter pieces into the hits of rays that start from one place, with the outcome of one after the other."""
    met = _met(target, pieces, hits)
    met = met.chosen(np.flatnonzero(_within(target.surfaces, met.piece, met.s, met.t)))
    there = np.ones(met.at.size, dtype=np.bool_)
    cut = np.flatnonzero(target.surfaces.cut.take(met.piece))
    of_cut = met.chosen(cut)
    there[cut] = _masks(target, of_cut.piece, of_cut.s, of_cut.t, of_cut.distance) > _THERE
    met = met.chosen(np.flatnonzero(there))
    np.minimum.at(hits.distance.ravel(), met.at, met.distance)
    # The nearest piece comes first in `met`, and of several values for one place the last is written.
    nearest = met.chosen(np.flatnonzero(hits.distance.take(met.at) == met.distance)[::-1])
    hits.piece.ravel()[nearest.at] = nearest.piece
    hits.s.ravel()[nearest.at] = nearest.s
    hits.t.ravel()[nearest.at] = nearest.t


def _met(target: _Target, pieces: Indices, hits: Hits) -> _PieceHits:
    """Meet the planes of pieces, each with the rays of its window, where none is met nearer."""
    rays = target.rays
    piece, at = _pairs(target, pieces)
    kept = np.flatnonzero(hits.distance.take(at) >= target.nearest[pieces].take(piece))
    piece, at = piece.take(kept), at.take(kept)
    x, y = rays.camera_directions(at)
    corner, normal, across, up = target.planes[pieces].transpose(1, 2, 0)
    start = [axis - of_corners for axis, of_corners in zip(rays.origin, corner, strict=True)]
    distance = -_dot(normal, start).take(piece) / _towards(normal, piece, x, y)
    old = hits.distance.take(at)
    # Of pieces that are equally far the one stays that would have come first.
    first = (distance == old) & (target.rank[pieces].take(piece) < target.rank.take(hits.piece.take(at)))
    kept = np.flatnonzero((distance > 0) & ((distance < old) | first))
    piece, at, distance, x, y = piece.take(kept), at.take(kept), distance.take(kept), x.take(kept), y.take(kept)
    s = _towards(across, piece, x, y) * distance + _dot(across, start).take(piece)
    t = _towards(up, piece, x, y) * distance + _dot(up, start).take(piece)
    return _PieceHits(at, pieces.take(piece), s, t, distance)


def _pairs(target: _Target, pieces: Indices) -> tuple[Indices, Indices]:
    """Pairs of a piece, by its place among `pieces`, and a ray of its window, by its flat place; piece by piece."""
    top, _, left, right = target.boxes[pieces].T.astype(np.intp)
    areas = _areas(target.boxes[pieces])
    piece = np.repeat(np.arange(pieces.size), areas)
    row, column = np.divmod(
        np.arange(piece.size) - np.repeat(np.cumsum(areas) - areas, areas), (right - left).take(piece)
    )
    return piece, (row + top.take(piece)) * target.rays.shape[1] + column + left.take(piece)


def _dot(a: Floats32, b: Sequence[Floats32]) -> Floats32:
    """Products of vectors whose components are rows."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def _towards(axis: Floats32, piece: Indices, x: Floats32, y: Floats32) -> Floats32:
    """The products of the axes (3, P) of pieces with rays (x, y, 1), each with its own."""
    return np.asarray(axis[0].take(piece) * x + axis[1].take(piece) * y + axis[2].take(piece))


def _within(surfaces: Surfaces, piece: Indices, s: Floats32, t: Floats32) -> Mask:
    """Whether places lie within the outlines of their pieces."""
    taper, oval = surfaces.taper.take(piece), surfaces.oval.take(piece)
    across = np.where(taper > 0, np.abs(s - 0.5) <= 0.5 - taper * t, (s >= 0) & (s <= 1))
    across = np.where(oval, (s - 0.5) ** 2 + (t - 0.5) ** 2 <= 0.25, across)
    return np.asarray(across & (t >= 0) & (t <= 1))


def _masks(target: _Target, piece: Indices | int, s: Floats32, t: Floats32, distance: Floats32) -> Floats32:
    """The values of pieces' masks at (N,) places, which are this far away."""
    surfaces = target.surfaces
    repeats, shift = surfaces.repeats[piece].T, surfaces.shift[piece].T
    level = level_of(distance * target.footprint[piece])
    return target.atlas.masks(surfaces.tile[piece], s * repeats[0] + shift[0], t * repeats[1] + shift[1], level)


def _areas(boxes: NDArray[np.int32]) -> NDArray[np.int32]:
    """(N,) How many rays lie in each box."""
    return np.asarray((boxes[:, 1] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 2]))


def _part(values: Floats32, window: tuple[slice, slice]) -> Floats32:
    """The window of an array that broadcasts to the grid."""
    if values.ndim == 0:
        return values
    rows = window[0] if values.shape[0] > 1 else slice(None)
    columns = window[1] if values.shape[1] > 1 else slice(None)
    return values[rows, columns]
