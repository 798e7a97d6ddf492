"""Lost returns: cameras see something on the road where the LiDAR, which scans there, has a hole.

Spoofers make a LiDAR lose an object or a whole sector. A beam that points below the horizon meets the ground, or what
stands on it, so that something has to return: the sky, which returns nothing, is above. Black paint, glass and wet
ground lose returns as well, here and there: some beams beside come back, from a tyre, a frame, a number plate. So a
surface is lost only where a disc as wide as a vehicle's side, and several beams high, holds no return at all; then it
is lost all over.

Two images may be wrong about what they see there. Along their rows a level edge, as the roof of a dark car, matches
itself at any disparity. So the images have to match less well at that of the sky, 0, and what is seen stands on the
road, not in it. Beside a facade the sky takes its disparity, and where the road falls away the sky begins below the
LiDAR's horizon. So what is seen has to stand there: the next return below it is as far away, not of a field beyond or,
under an open sky, of a hedge before it. And the next return above it is not of its own upper edge: a black car returns
nothing from its doors, but does from its roof.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from auditor.measurement.checks.photometric_consistency import PairConsistency, consistency_of, ncc_at
from auditor.measurement.checks.point_distribution import thinned
from auditor.measurement.count_grid import cells_of_directions
from auditor.measurement.disparity.lidar import LidarView
from auditor.measurement.disparity.stereo import StereoMap
from auditor.measurement.frame_views import FrameViews
from auditor.measurement.parameters import COUNT_GRID, HALF, MATCHER_RANGE, PATCH_CORRELATION
from auditor.measurement.point_parameters import LOST_RETURNS
from auditor.model.arrays import Floats32, Image, Indices, Mask
from auditor.model.measurement import Cells

_FINER = LOST_RETURNS.finer
_RADIANS = COUNT_GRID.lidar_cell / _FINER
_ROWS, _COLUMNS = (size * _FINER for size in COUNT_GRID.lidar_cells)
_HORIZON = _ROWS // 2


@dataclass(frozen=True, eq=False)
class ScannedView:
    """Where a LiDAR scans below the horizon, on a grid of directions finer than the count grid, in the rig's axes.

    A hole is what lacks returns among others. `within_rad` (rows, columns) is how far each of its directions is from
    its edge, and `hole_rad` (rows, columns) the radius of the widest disc of the hole that covers the direction,
    infinite where a sector lacks all returns down to the lowest beam; both are 0 outside. `nearest_m` (rows, columns)
    is how far the nearest return of each direction is, infinite without any. `gap_rad` (rows,) is how far apart the
    LiDAR's beams are there. `scanned` (rows,) are the rows between the horizon, or the LiDAR's uppermost beam, and its
    lowest; `road_m` is how far the road is below the LiDAR; `span_px` are the columns of the view within its field,
    and `reach_m` is how near and how far the cloud's points are, as some are cropped before they are recorded.
    """

    within_rad: Floats32
    hole_rad: Floats32
    nearest_m: Floats32
    gap_rad: Floats32
    scanned: Mask
    road_m: float
    span_px: tuple[float, float]
    reach_m: tuple[float, float]


@dataclass(frozen=True, eq=False)
class _Surfaces:
    """(M,) half-resolution pixels of the reference where a pair sees a surface, its disparity, and how well it matches.

    `u_px` and `v_px` are their columns and rows at full resolution.
    """

    row: Indices
    column: Indices
    disparity_px: Floats32
    ncc: Floats32

    def chosen(self, some: Indices) -> "_Surfaces":
        """Those of these numbers."""
        return _Surfaces(self.row.take(some), self.column.take(some), self.disparity_px.take(some), self.ncc.take(some))

    @property
    def u_px(self) -> Floats32:
        return _full_resolution(self.column)

    @property
    def v_px(self) -> Floats32:
        return _full_resolution(self.row)


def scanned_view(view: LidarView) -> ScannedView:
    """Where the LiDAR of a view scans, by the frame's own points; those that the camera does not see count as well."""
    points, ahead_m = view.in_rig_axes_m, view.level_m
    place = _places(points, ahead_m)
    inside = place >= 0
    range_m = np.sqrt(ahead_m * ahead_m + points[1] * points[1])
    nearest_m = np.full((_ROWS, _COLUMNS), np.inf, dtype=np.float32)
    np.minimum.at(nearest_m.ravel(), place[inside], range_m[inside])
    hit = np.isfinite(nearest_m)
    scanned = _scanned_rows(hit)
    scanned[:_HORIZON] = False
    within = np.zeros(hit.shape, dtype=np.float32)
    hole = np.zeros(hit.shape, dtype=np.float32)
    if scanned.any():
        below = slice(_HORIZON - 1, np.flatnonzero(scanned)[-1] + 2)
        within[below] = _within(_enclosed(hit[below]))
        hole[below] = _discs(within[below])
        hole[below, _sectors(hit[below])] = np.inf
    return ScannedView(within, hole, nearest_m, _gaps(hit), scanned, view.road_m, view.span_px, view.reach_m)


def count_lost_returns(
    view: LidarView,
    scanned: ScannedView,
    stereo: StereoMap,
    consistency: PairConsistency,
    source: int,
    half_res: tuple[Image, Image],
) -> Cells:
    """Count the surface samples that a pair sees, and those whose returns are lost, by direction from the LiDAR.

    Samples are two a cell of the count grid, across and down. A sample is a surface where both cameras see it, with a
    consistent match, below the horizon, nearer than the farthest distance that is looked at, and above the road, or in
    a sector that lacks all returns. One that lacks returns is none if it may be out of the cloud's reach, if it could
    be sky, stands on nothing or returns in part. `half_res` are the half-resolution grey images of the reference and
    the source.
    """
    surfaces = _surfaces(view, stereo, consistency, source)
    u_px, (left, right) = surfaces.u_px, scanned.span_px
    surfaces = surfaces.chosen(np.flatnonzero((u_px >= left) & (u_px <= right)))
    place, range_m, below_m = _directions(view, surfaces, source)
    hole = scanned.hole_rad.take(place)
    # Wet ground loses returns, but not all of a sector down to the lowest beam.
    above_road = (below_m < scanned.road_m - LOST_RETURNS.above_road_m) | np.isinf(hole)
    inside = np.flatnonzero((place >= 0) & scanned.scanned.take(place // _COLUMNS) & above_road)
    surfaces, place = surfaces.chosen(inside), place.take(inside)
    range_m, hole, below_m = (one.take(inside) for one in (range_m, hole, below_m))
    within = scanned.within_rad.take(place)
    patch = HALF * PATCH_CORRELATION.radius_px / view.rig.camera(view.reference).focal_px
    least = max(LOST_RETURNS.narrowest, patch + LOST_RETURNS.beside_patch)
    lost = hole >= np.maximum(LOST_RETURNS.hole_m / range_m, least)
    lost &= hole >= LOST_RETURNS.gaps * scanned.gap_rad[place // _COLUMNS]
    lost &= within > patch  # a patch that reaches beyond the hole's edge may show what is there
    surface = ~lost
    surface[lost] = _has_to_return(scanned, range_m[lost], below_m[lost])
    surface[lost] &= _no_sky(surfaces.chosen(np.flatnonzero(lost)), half_res)
    surface[lost] &= np.isinf(hole[lost]) | _all_lost(scanned.nearest_m, place[lost], range_m[lost])
    place, lost = place[surface], lost[surface]
    return cells_of_directions(place // _COLUMNS // _FINER, place % _COLUMNS // _FINER, lost)


def scanned(seen: FrameViews, k: int) -> ScannedView:
    """Where the LiDAR of a view scans."""
    return scanned_view(seen.views[k])


def measure_lost_returns(seen: FrameViews, j: int, k: int) -> Cells:
    """The surface samples that a pair sees, and those whose returns are lost; none where the cloud is thinned."""
    if seen.once(thinned, k):
        none = np.zeros(0, dtype=np.intp)
        return cells_of_directions(none, none, none.astype(np.bool_))
    consistency = seen.once(consistency_of, j, k)
    return count_lost_returns(seen.views[k], seen.once(scanned, k), seen.maps[j, k], consistency, j, seen.halves(j, k))


def _enclosed(hit: Mask) -> Mask:
    """(rows, columns) which directions lack returns below the first row, among others.

    Beyond the LiDAR's or the camera's view nothing is missed: below the lowest return of a column that has any, and
    beside the first and the last of these.
    """
    lowest = np.where(hit.any(axis=0), len(hit) - 1 - np.argmax(hit[::-1], axis=0), len(hit))
    missed = ~hit & (np.arange(len(hit))[:, None] < lowest) & _within_field(hit)
    missed[0] = False
    return missed


def _sectors(hit: Mask) -> Mask:
    """(columns,) which directions lack all returns below the first row, as wide as the narrowest disc, among others."""
    none = _within_field(hit) & ~hit[1:].any(axis=0)
    disc = np.ones((1, math.ceil(2 * LOST_RETURNS.narrowest / _RADIANS)), dtype=np.uint8)
    return np.asarray(cv2.morphologyEx(none[None].view(np.uint8), cv2.MORPH_OPEN, disc)[0] > 0)


def _within_field(hit: Mask) -> Mask:
    """(columns,) those between the first and the last with a return."""
    columns = np.asarray(hit.any(axis=0))
    return np.asarray(np.logical_or.accumulate(columns) & np.logical_or.accumulate(columns[::-1])[::-1])


def _within(mask: Mask) -> Floats32:
    """(rows, columns) how far each direction of a mask is from those outside of it, radians."""
    cells = cv2.distanceTransform(mask.view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.asarray(cells * np.float32(_RADIANS), dtype=np.float32)


def _gaps(hit: Mask) -> Floats32:
    """(rows,) how far the beam at or below each row is from the one above it, radians.

    It is that of the middle one of the columns with both, since an attack takes returns. Infinite where none has.
    """
    rows = np.arange(len(hit), dtype=np.float32)[:, None]
    above = np.full(hit.shape, -np.inf, dtype=np.float32)
    above[1:] = np.maximum.accumulate(np.where(hit, rows, -np.inf), axis=0)[:-1]
    below = np.minimum.accumulate(np.where(hit, rows, np.inf)[::-1], axis=0)[::-1]
    gaps = np.sort(below - above, axis=1)
    middle = np.minimum(np.isfinite(gaps).sum(axis=1) // 2, hit.shape[1] - 1)
    return np.asarray(gaps[np.arange(len(hit)), middle] * np.float32(_RADIANS), dtype=np.float32)


def _discs(within_rad: Floats32) -> Floats32:
    """(rows, columns) the radius of the widest disc that lies in a hole and covers the direction, of some radii.

    These are morphological openings: what is nearer than a radius to a direction that is farther than it from the edge.
    """
    widest = np.zeros_like(within_rad)
    for step in range(LOST_RETURNS.discs):
        radius = np.float32(LOST_RETURNS.narrowest * LOST_RETURNS.wider**step)
        middles = within_rad > radius
        if not middles.any():
            break
        widest[_within(~middles) <= radius] = radius
    return widest


def _all_lost(nearest_m: Floats32, place: Indices, range_m: Floats32) -> Mask:
    """(M,) mask of the surfaces, at places of the finer grid, that stand on what returns next below them, and are lost.

    Below that is the nearest return of some columns, in the first row that has any. What returns next above, below the
    horizon and as far away as the surface, is a car's own roof: it is dark, and not all of it is lost.
    """
    row, column = np.divmod(place, _COLUMNS)
    each, above = np.arange(len(place)), np.arange(_ROWS) < row[:, None]
    over = np.where(above, nearest_m.T[column], np.inf)
    beside = cv2.erode(nearest_m, np.ones((1, LOST_RETURNS.foot_columns), dtype=np.uint8))
    under = np.where(above, np.inf, beside.T[column])
    roof = _ROWS - 1 - np.isfinite(over)[:, ::-1].argmax(axis=1)
    roof_m, foot_m = over[each, roof], under[each, np.isfinite(under).argmax(axis=1)]
    hidden = np.isinf(roof_m) & (foot_m < LOST_RETURNS.foot_nearer * range_m)
    stands = (foot_m <= range_m + LOST_RETURNS.foot_behind_m) & ~hidden
    dark = (roof >= _HORIZON) & (np.abs(roof_m - range_m) < LOST_RETURNS.as_far * range_m)
    return np.asarray(stands & ~dark)


def _has_to_return(scanned: ScannedView, range_m: Floats32, below_m: Floats32) -> Mask:
    """(M,) mask of the surfaces that do not begin nearer than the cloud, before a road that lies within its reach.

    Leaves, fences and panes let beams through, which return from the road behind them at last. Where no road is known
    the surface has to be within reach.
    """
    nearest_m, farthest_m = scanned.reach_m
    begins = range_m * np.float32(1 - LOST_RETURNS.as_far) > nearest_m
    if np.isinf(scanned.road_m):
        return np.asarray(begins & (range_m <= farthest_m))
    return np.asarray(begins & (scanned.road_m * range_m <= farthest_m * below_m))


def _no_sky(surfaces: _Surfaces, half_res: tuple[Image, Image]) -> Mask:
    """(M,) mask of the surfaces whose images match less well at the disparity of the sky, 0."""
    if not surfaces.row.size:
        return np.zeros(0, dtype=np.bool_)
    at_infinity = ncc_at(*half_res, surfaces.row, surfaces.column, np.zeros(surfaces.row.size, dtype=np.float32))
    return np.asarray(at_infinity < surfaces.ncc - np.float32(LOST_RETURNS.less_at_infinity))


def _surfaces(view: LidarView, stereo: StereoMap, consistency: PairConsistency, source: int) -> _Surfaces:
    """The surfaces that a pair sees, at every so many-th pixel, nearer than the farthest distance."""
    camera = view.rig.camera(view.reference)
    every = max(round(camera.focal_px * _RADIANS / HALF), 1)
    some = (slice(every // 2, None, every),) * 2
    grid = HALF // stereo.step
    disparity = stereo.disparity_px[::grid, ::grid][some]
    ncc = consistency.ncc[some]
    surface = consistency.matches.seen[some] & (ncc > LOST_RETURNS.consistent)
    farthest = camera.focal_px * view.rig.baseline_m(source, view.reference) / LOST_RETURNS.farthest_m
    surface &= (disparity > farthest) & (disparity < stereo.range_px - MATCHER_RANGE.margin_px)
    chosen = np.flatnonzero(surface)
    row, column = (at * every + every // 2 for at in np.divmod(chosen, surface.shape[1]))
    return _Surfaces(row, column, disparity.take(chosen), ncc.take(chosen))


def _directions(view: LidarView, surfaces: _Surfaces, source: int) -> tuple[Indices, Floats32, Floats32]:
    """(M,) places on the finer grid, -1 outside, distances from the LiDAR, and metres below it, of what a pair sees."""
    rig, camera = view.rig, view.rig.camera(view.reference)
    assert rig.lidar is not None
    depth = (camera.focal_px * rig.baseline_m(source, view.reference) / surfaces.disparity_px).astype(np.float32)
    # X = K^-1 (z (u, v, 1) - p), with P = (K | p), seen from the LiDAR.
    inverse = np.linalg.inv(camera.projection[:, :3])
    start = inverse @ camera.projection[:, 3] + rig.lidar.rig_SE3_lidar[:3, 3]
    pixels: Floats32 = np.stack([surfaces.u_px, surfaces.v_px, np.ones_like(surfaces.u_px)])
    points: Floats32 = inverse.astype(np.float32) @ (pixels * depth)
    points -= start.astype(np.float32)[:, None]
    return _places(points, np.hypot(points[0], points[2])), np.sqrt(np.einsum("cm,cm->m", points, points)), points[1]


def _full_resolution(half_px: Indices) -> Floats32:
    """(M,) where the middles of half-resolution pixels lie."""
    return half_px.astype(np.float32) * np.float32(HALF) + np.float32((HALF - 1) / 2)


def _places(points_m: Floats32, ahead_m: Floats32) -> Indices:
    """(M,) cells of the finer grid, row by row, of directions (3, M) to right, down and forward; -1 outside.

    `ahead_m` (M,) is how far they are without what is down.
    """
    x, y, z = points_m
    row = np.floor(np.arctan2(y, ahead_m) / np.float32(_RADIANS)).astype(np.intp) + _ROWS // 2
    column = np.floor(np.arctan2(x, z) / np.float32(_RADIANS)).astype(np.intp) + _COLUMNS // 2
    inside = (row >= 0) & (row < _ROWS) & (column >= 0) & (column < _COLUMNS)
    return np.where(inside, row * _COLUMNS + column, -1)


def _scanned_rows(hit: Mask) -> Mask:
    """(rows,) those between the first and the last row of cells in a quarter of whose columns there are returns.

    Those two are left out: a beam at the edge of the field crosses them.
    """
    in_rows = np.logical_or.reduce(hit.reshape(-1, _FINER, _COLUMNS), axis=1)
    used = in_rows[:, in_rows.any(axis=0)]
    crossed = np.flatnonzero(used.mean(axis=1) > LOST_RETURNS.least_crossed) if used.size else np.zeros(0, np.intp)
    scanned = np.zeros(len(in_rows), dtype=np.bool_)
    if crossed.size:
        scanned[crossed[0] + 1 : crossed[-1]] = True
    return np.repeat(scanned, _FINER)
