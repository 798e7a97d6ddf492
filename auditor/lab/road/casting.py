"""What each ray of a sensor meets first."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auditor.geometry import Matrix
from auditor.lab.road.atlas import Atlas, Texels, mip_level
from auditor.lab.road.rays import Box, Plane, Rays, product
from auditor.lab.road.surfaces import Surfaces

NEAREST_M = 0.4
NOTHING = -1
_PAD = 2
"""Rows and columns around a surface's corners: a wall's edge bulges a little in a LiDAR's grid."""


@dataclass(frozen=True, eq=False)
class View:
    """Surfaces in the frame of a sensor at one moment; `normal` (M, 3) points outwards and has length 1.

    A ray d meets surface m at t = distance / (normal d), at s = t (d along_s) - at_s in lengths of edge_s, r likewise.
    """

    corner: Plane
    edge_s: Plane
    edge_r: Plane
    normal: Plane
    distance: Plane
    along_s: Plane
    at_s: Plane
    along_r: Plane
    at_r: Plane


@dataclass(frozen=True, eq=False)
class Hits:
    """What the rays meet, (H, W): t, infinite where there is nothing, and the number of the surface or NOTHING.

    `pane_t` is where a laser's ray passes the nearest pane of glass, infinite where it passes none.
    """

    t: Plane
    surface: NDArray[np.int32]
    pane_t: Plane


def view(surfaces: Surfaces, world_SE3_sensor: Matrix, time_s: float) -> View:
    """The surfaces as a sensor at that pose and time sees them."""
    rotation = world_SE3_sensor[:3, :3]
    moved = surfaces.corner.astype(np.float64)
    moved[:, 2] += surfaces.speed_m_s * time_s
    corner = (moved - world_SE3_sensor[:3, 3]) @ rotation
    edge_s, edge_r = surfaces.edge_s @ rotation, surfaces.edge_r @ rotation
    normal = np.cross(edge_r, edge_s)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    along_s = np.cross(normal, edge_r)
    along_s /= np.einsum("ij,ij->i", along_s, edge_s)[:, None]
    along_r = np.cross(normal, edge_s)
    along_r /= np.einsum("ij,ij->i", along_r, edge_r)[:, None]

    def dot(a: Matrix, b: Matrix) -> Plane:
        return np.asarray(np.einsum("ij,ij->i", a, b), dtype=np.float32)

    return View(
        corner=corner.astype(np.float32),
        edge_s=edge_s.astype(np.float32),
        edge_r=edge_r.astype(np.float32),
        normal=normal.astype(np.float32),
        distance=dot(normal, corner),
        along_s=along_s.astype(np.float32),
        at_s=dot(along_s, corner),
        along_r=along_r.astype(np.float32),
        at_r=dot(along_r, corner),
    )


def cast(surfaces: Surfaces, seen: View, rays: Rays, atlas: Atlas, *, through_glass: bool = False) -> Hits:
    """Meet every ray with the nearest surface; holes are passed, and glass where a LiDAR looks."""
    shape = (len(rays.q), len(rays.x))
    t = np.full(shape, np.inf, dtype=np.float32)
    surface = np.full(shape, NOTHING, dtype=np.int32)
    pane_t = np.full(shape, np.inf, dtype=np.float32)
    glazed = atlas.has_glass[surfaces.picture] & through_glass
    pierced = atlas.has_hole[surfaces.picture] | glazed
    for number, nearest, box in _in_view(surfaces, seen, rays):
        before = t[box]
        if not (before > nearest).any():
            continue
        met, s, r = _meet(seen, number, rays, box)
        hit = (met < before) & (met > NEAREST_M) & (s >= 0) & (s <= 1) & (r >= 0) & (r <= 1)
        if pierced[number]:
            index = np.flatnonzero(hit)
            texel = _texel(surfaces, number, rays, atlas, met.ravel()[index], s.ravel()[index], r.ravel()[index])
            hole = atlas.hole[texel]
            if glazed[number]:
                pane = _only(hit, index[atlas.glass[texel] & ~hole])
                np.copyto(pane_t[box], np.minimum(pane_t[box], met), where=pane)
                hole = hole | atlas.glass[texel]
            hit = _only(hit, index[~hole])
        np.copyto(before, met, where=hit)
        np.copyto(surface[box], np.int32(number), where=hit)
    return Hits(t, surface, pane_t)


def _in_view(surfaces: Surfaces, seen: View, rays: Rays) -> Iterator[tuple[int, np.float32, Box]]:
    """The surfaces that face the sensor within its view, near to far, with their least distance and their box."""
    faces = (seen.distance < 0) | surfaces.both_sided
    candidate = np.flatnonzero(faces)
    outline, before = _outline(seen, candidate)
    candidate, outline = candidate[before], outline[before]
    rows, columns = rays.locate(outline)
    height, width = len(rays.q), len(rays.x)
    top, bottom = np.floor(rows.min(1)) - _PAD, np.ceil(rows.max(1)) + _PAD + 1
    left, right = np.floor(columns.min(1)) - _PAD, np.ceil(columns.max(1)) + _PAD + 1
    inside = (bottom > 0) & (top < height) & (right > 0) & (left < width)
    # The depth z of a pinhole; a lower bound of the range of a LiDAR's ray as well.
    least = outline[..., 2].min(1)
    for index in np.flatnonzero(inside)[np.argsort(least[inside], kind="stable")]:
        box = (
            slice(max(int(top[index]), 0), min(int(bottom[index]), height)),
            slice(max(int(left[index]), 0), min(int(right[index]), width)),
        )
        yield int(candidate[index]), least[index], box


def _outline(seen: View, candidate: NDArray[np.intp]) -> tuple[Plane, NDArray[np.bool_]]:
    """(M, 20, 3) points that span the outlines of surfaces cut off at NEAREST_M, and (M,) whether anything is left."""
    corner, edge_s, edge_r = seen.corner[candidate], seen.edge_s[candidate], seen.edge_r[candidate]
    start = np.stack([corner, corner + edge_s, corner + edge_s + edge_r, corner + edge_r], axis=1)
    end = np.roll(start, -1, axis=1)
    before = (start[..., 2] > NEAREST_M).any(1)
    rise = end[..., 2] - start[..., 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        cut = np.clip((np.float32(NEAREST_M * 1.01) - start[..., 2]) / rise, 0, 1)
    cut = np.nan_to_num(cut)[..., None]
    low, high = np.where(rise[..., None] > 0, cut, 0), np.where(rise[..., None] < 0, cut, 1)
    first, last = start + low * (end - start), start + high * (end - start)
    # Of each edge the point nearest to the vertical axis too, where a LiDAR sees it highest or lowest.
    step = (last - first)[..., [0, 2]]
    share = -np.einsum("...i,...i", first[..., [0, 2]], step) / np.maximum(np.einsum("...i,...i", step, step), 1e-9)
    middle = first + np.clip(share, 0, 1)[..., None] * (last - first)
    points = np.concatenate([first, last, middle, _along_cut(first, last, rise)], axis=1)
    # An edge that lies wholly behind has no part in the outline: replace its points by one that has.
    ahead = points[..., 2] > NEAREST_M
    some = np.take_along_axis(points, ahead.argmax(1)[:, None, None], axis=1)
    return np.where(ahead[..., None], points, some).astype(np.float32), np.asarray(before)


def _along_cut(first: Plane, last: Plane, rise: Plane) -> Plane:
    """(M, 8, 3) the ends of edges; those at the cut are moved along it to where it passes the vertical axis nearest."""
    ends = np.concatenate([first, last], axis=1)
    is_cut = np.concatenate([rise > 0, rise < 0], axis=1) & (ends[..., 2] < NEAREST_M * 1.02)
    x = ends[..., 0]
    low, high = np.where(is_cut, x, np.inf).min(1), np.where(is_cut, x, -np.inf).max(1)
    nearest = np.where(low <= high, np.clip(0, low, np.maximum(low, high)), 0)
    ends[..., 0] = np.where(is_cut, nearest[:, None], x)
    return ends


def _meet(seen: View, number: int, rays: Rays, box: Box) -> tuple[Plane, Plane, Plane]:
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        t = seen.distance[number] / product(rays, seen.normal[number], box)
        s = t * product(rays, seen.along_s[number], box)
        s -= seen.at_s[number]
        r = t * product(rays, seen.along_r[number], box)
        r -= seen.at_r[number]
    return t, s, r


def _texel(surfaces: Surfaces, number: int, rays: Rays, atlas: Atlas, t: Plane, s: Plane, r: Plane) -> Texels:
    picture = surfaces.picture[number]
    times_s, times_r = surfaces.times[number]
    texels_m = atlas.size[picture, 1] * times_s / np.linalg.norm(surfaces.edge_s[number])
    return atlas.texels(picture, s * times_s, r * times_r, mip_level(t * np.float32(rays.spread * texels_m)))


def _only(hit: NDArray[np.bool_], index: NDArray[np.intp]) -> NDArray[np.bool_]:
    """A mask of the same shape that is True at the flat indices."""
    kept = np.zeros(hit.size, dtype=np.bool_)
    kept[index] = True
    return kept.reshape(hit.shape)
