"""The checks of the LiDAR alone: isolated points, strips of a view that lack points, and sectors of rough ranges.

An object, real or bogus, returns many points at one range. Drops of rain return one each, all around the sensor and
near it: their light fades with the fourth power of range. Points spoofed at random ranges are isolated far away, too.
So are those of dust, which lie together, within some metres.
An attack that removes points leaves a strip without any. And a surface, the road above all, has the range between those
of a point's neighbours: where most points of a sector do not, their echoes came at no fixed time.
"""

from math import isnan, sqrt, tau

import numpy as np

from auditor.measurement.disparity.lidar import LidarView
from auditor.measurement.frame_views import FrameViews
from auditor.measurement.point_parameters import ISOLATED_POINTS, POINT_DROPOUT, POINT_SPACING, ROUGH_RANGES
from auditor.model.arrays import Floats, Indices, Mask, Points, median_of, quantile_of
from auditor.model.fault_features import IsolatedShares

_NEAR_M, _BEYOND_M = ISOLATED_POINTS.near_m, ISOLATED_POINTS.far_m
_ACROSS = ISOLATED_POINTS.parts_across
_STEP_PX = POINT_DROPOUT.step_px

_BEAMS_APART = 2.0 * tau
"""Added from beam to beam to the azimuths of one sort: a step within a beam is below half of it, one between is not."""


def isolated_shares(view: LidarView, mask: Mask, width_px: int) -> IsolatedShares:
    """The shares of isolated points, `mask` (M,), in a view, near the LiDAR and beyond; NaN under 200 points.

    Beyond, those of a plume do not count.
    """
    if view.row.size < ISOLATED_POINTS.fewest:
        return IsolatedShares()
    near, beyond = mask & (view.range_m < _NEAR_M), mask & (view.range_m >= _NEAR_M) & (view.range_m < _BEYOND_M)
    middle = view.row[(view.row.size - 1) // 2 : view.row.size // 2 + 1].mean()  # the median: points lie row by row
    across = (view.column * _ACROSS // width_px).astype(np.intp)
    part = across + _ACROSS * (view.row > middle)
    count = np.bincount(part, minlength=2 * _ACROSS)
    shares = np.bincount(part[near], minlength=2 * _ACROSS) / np.maximum(count, 1)
    alone = _alone(view, beyond, across)
    return IsolatedShares(quantile_of(np.sort(shares), ISOLATED_POINTS.near_quantile), alone / mask.size)


def _alone(view: LidarView, beyond: Mask, across: Indices) -> float:
    """How many of the isolated points `beyond` (M,) count, in the parts `across` (M,) of a view, less a plume's.

    Wet ground leaves single returns of the road and mirrors others, below it. Noise lies above it as well: so what lies
    lower counts beside more points above than a part has in clean frames.
    """
    highest = ISOLATED_POINTS.above_road_m + ISOLATED_POINTS.rises * view.range_m
    above = beyond & (view.below_m < view.road_m - highest)
    more, lower = (np.bincount(across[mask], minlength=_ACROSS) for mask in (above, beyond & ~above))
    noise = np.minimum(lower, ISOLATED_POINTS.lower_each * np.maximum(more - ISOLATED_POINTS.usual_above, 0))
    return max(float(more.sum() + noise.sum()) - _of_a_plume(view.point_m[beyond]), 0.0)


def _of_a_plume(points: Points) -> float:
    """How many of the isolated points (N, 3) are a plume's of dust: most of them lie together, and are many.

    They are no more than dust isolates: noise that is spoofed in a sector lies together, too.
    """
    if not len(points):
        return 0.0
    some = points[:: -(-len(points) // ISOLATED_POINTS.together_asked)]
    squares = (some * some).sum(axis=1)
    apart = squares[:, None] + squares - 2 * (some @ some.T)
    share = float((apart < ISOLATED_POINTS.together_m**2).mean(axis=1).max())
    if share < ISOLATED_POINTS.together_share:
        return 0.0
    together = share * len(points) - ISOLATED_POINTS.together_fewest
    return float(np.clip(together, 0, ISOLATED_POINTS.together_most))


def isolated_ratio(shares: IsolatedShares) -> float | None:
    """The statistic of isolated points 8 to 40 m away, 0 to 1; half a per cent of the view's points give a half.

    Drops of rain are isolated nearby many times as often: half of the share there is subtracted. None where too few
    points are in view, or where drops outweigh what is isolated farther away.
    """
    if isnan(shares.isolated_beyond):
        return None
    drops = ISOLATED_POINTS.near_weight * shares.isolated_near
    if drops > shares.isolated_beyond:
        return None
    more = shares.isolated_beyond - drops
    return more / (more + ISOLATED_POINTS.half_share)


def isolated(view: LidarView, focal_px: float) -> Mask:
    """(M,) mask of the points with at most one other in the 3 x 3 x 3 cells of row, column and range around theirs."""
    if not view.row.size:
        return np.zeros(0, dtype=np.bool_)
    side = max(ISOLATED_POINTS.cell * focal_px, 1.0)
    step = np.log(np.clip(view.range_m, *ISOLATED_POINTS.ranges_m)) / ISOLATED_POINTS.range_step
    cell = np.stack([view.row / side, view.column / side, step]).astype(np.intp)
    cell -= cell.min(axis=1, keepdims=True) - 1  # a cell more on every side, so that all have neighbours
    rows, columns, steps = shape = tuple((cell.max(axis=1) + 2).tolist())
    place = (cell[0] * columns + cell[1]) * steps + cell[2]
    counts = np.bincount(place, minlength=rows * columns * steps)
    mask: Mask = counts[place] <= ISOLATED_POINTS.most_together
    centre = np.ravel_multi_index((1, 1, 1), shape)
    neighbours = np.ravel_multi_index(np.indices((3, 3, 3)).reshape(3, -1), shape) - centre
    mask[mask] = counts.take(np.add.outer(neighbours, place[mask])).sum(axis=0) <= ISOLATED_POINTS.most_together
    return mask


def point_dropout(view: LidarView, width_px: int) -> float:
    """The share of the usual points that the upright strip with the fewest points lacks, 0 to 1.

    Strips are 104 px wide, every 8 px one; usual is the median strip's number of points. 1 where the view has none.
    Of a LiDAR that looks ahead alone the strips within its field count, unless that is narrower than two of them.
    """
    steps = np.bincount(view.column // _STEP_PX, minlength=-(-width_px // _STEP_PX))[: width_px // _STEP_PX]
    strips = np.convolve(steps, np.ones(min(POINT_DROPOUT.strip_steps, steps.size)), mode="valid")
    if view.looks_ahead and view.returns:
        left, right = np.ceil(view.span_px[0] / _STEP_PX), view.span_px[1] // _STEP_PX - POINT_DROPOUT.strip_steps
        within = strips[max(int(left), 0) : max(int(right) + 1, 0)]
        strips = within if within.size >= POINT_DROPOUT.strip_steps else strips
    usual = median_of(np.sort(strips))
    return max(1.0 - float(strips.min()) / usual, 0.0) if usual > 0 else 1.0


def rough_ranges(view: LidarView, focal_px: float) -> float | None:
    """How rough the roughest sector of a view is, 0 to 1; None where too few points are in view.

    Roughness is the lower quartile of by how much a point's range differs from what lies between its neighbours' in the
    same row: leaves, edges and other clutter hardly ever cover three quarters of a sector, which holds some road. It
    counts times by how much more it is than that of the median sector.
    """
    roughness_m = _roughness_m(view, focal_px)
    if roughness_m.size < ROUGH_RANGES.sector_strips:
        return None
    roughest = float(roughness_m.max())
    # Of rounded coordinates most sectors are as smooth as steps are flat, and a few are as rough as steps are high.
    usual = max(median_of(np.sort(roughness_m)), ROUGH_RANGES.least_usual_m, view.rounding_m / sqrt(12.0))
    rough = roughest * roughest / usual
    return rough * rough / (rough * rough + ROUGH_RANGES.half_m * ROUGH_RANGES.half_m)


def is_rounded(view: LidarView) -> bool:
    """Whether coordinates are rounded so coarsely that it makes sectors of the road rough, and points isolated."""
    return view.rounding_m > ROUGH_RANGES.coarsest_m


def is_thinned(view: LidarView) -> bool:
    """Whether the points of a beam lie so far apart that nothing can be said of what lies between them.

    So do those of a cloud of which only some points were recorded. Most LiDARs' own steps are half of that at most.
    """
    x, y, z = view.in_rig_axes_m
    beam = np.floor(np.arctan2(y, view.level_m) / POINT_SPACING.beam)
    steps = np.diff(np.sort(_BEAMS_APART * beam + np.arctan2(x, z)))
    steps = steps[steps < _BEAMS_APART - tau]
    return bool(steps.size) and bool(
        quantile_of(np.sort(steps), POINT_SPACING.quantile) > np.float32(POINT_SPACING.widest)
    )


def thinned(seen: FrameViews, k: int) -> bool:
    """Whether the cloud is thinned in the view of k."""
    return is_thinned(seen.views[k])


def isolated_of(seen: FrameViews, k: int) -> Mask:
    """(M,) the isolated points of a view."""
    return isolated(seen.views[k], seen.rig.camera(k).focal_px)


def shares_of_isolated(seen: FrameViews, k: int) -> IsolatedShares:
    """How many points of a view are isolated."""
    return isolated_shares(seen.views[k], seen.once(isolated_of, k), seen.rig.camera(k).width_px)


def measure_isolated_points(seen: FrameViews, k: int) -> float | None:
    """The statistic of isolated points in the view of k; None where the cloud is rounded coarsely."""
    return None if is_rounded(seen.views[k]) else isolated_ratio(seen.once(shares_of_isolated, k))


def measure_point_dropout(seen: FrameViews, k: int) -> float:
    """The share of its points that a strip of the view of k lacks."""
    return point_dropout(seen.views[k], seen.rig.camera(k).width_px)


def measure_rough_ranges(seen: FrameViews, k: int) -> float | None:
    """How rough the ranges of a sector of the view of k are; None where the cloud is thinned, or rounded coarsely."""
    if seen.once(thinned, k) or is_rounded(seen.views[k]):
        return None
    return rough_ranges(seen.views[k], seen.rig.camera(k).focal_px)


def _roughness_m(view: LidarView, focal_px: float) -> Floats:
    """The roughness of each sector that has enough points; points lie in row-major order."""
    u, range_m = view.u_px.astype(np.float64), view.range_m.astype(np.float64)
    before, here, after = slice(0, -2), slice(1, -1), slice(2, None)
    span = u[after] - u[before]
    between = (view.row[before] == view.row[after]) & (span > 0) & (span <= ROUGH_RANGES.gap * focal_px)
    first = np.flatnonzero(between & (range_m[here] < ROUGH_RANGES.farthest_m))
    left, middle, right = (range_m.take(first + place) for place in range(3))
    share = (u.take(first + 1) - u.take(first)) / span.take(first)
    differs = np.abs(middle - (left * (1 - share) + right * share))
    strip = np.floor(u.take(first + 1) / (ROUGH_RANGES.strip * focal_px)).astype(np.int16)  # sorted fast: few bits
    order = np.argsort(strip, kind="stable")
    bounds = np.searchsorted(strip[order], np.arange(int(strip.max(initial=-1)) + 2))
    count = bounds[ROUGH_RANGES.sector_strips :] - bounds[: -ROUGH_RANGES.sector_strips]
    if not count.size or median_of(np.sort(count)) < ROUGH_RANGES.fewest:
        return np.zeros(0)
    quantiles_m = []
    for sector in np.flatnonzero(count >= ROUGH_RANGES.fewest_of_sector).tolist():
        place = int(ROUGH_RANGES.quantile * (count[sector] - 1))
        some = order[bounds[sector] : bounds[sector + ROUGH_RANGES.sector_strips]]
        quantiles_m.append(np.partition(differs[some], place)[place])
    return np.array(quantiles_m)
