"""False ranges: neighbouring returns of one surface that pairs of cameras contradict, and sectors that are shifted.

Spoofed points are few among thousands, but each is off by tens of pixels. So a cluster of them, as large as the back of
a car and of one range, is tested by itself: that all the cameras can look at is contradicted, against what surfaces
that are there have. Of a window that mirrors the street, or of a dark roof, cameras see something else as well; the
rest of that surface they confirm. What they cannot look at counts a little for it too: of a plain wall only what lies
before a pattern, at its edge, can be looked at. At such an edge a patch shows what is behind it. So what is narrower or
lower than a patch, as a pole or the upper edge of a fence, is no cluster. What scatters, as in dust, is a check of its
own.

A delay moves all returns of a sector by the same, and hardly changes a disparity far away. Nearby the median of many
points is far more precise than one, and the frame's other sectors show what the calibration is off by. Most of
them have to be moved: in puddles cameras see what is mirrored, in parts of a sector.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import log1p, sqrt
from typing import NamedTuple

import numpy as np

from auditor.measurement.checks.lidar_conflict import PointVotes
from auditor.measurement.checks.lost_returns import scanned
from auditor.measurement.checks.scattered_returns import NUMBERS as SCATTERED_RETURNS
from auditor.measurement.checks.scattered_returns import scatter
from auditor.measurement.disparity.lidar import LidarView
from auditor.measurement.disparity.stereo import StereoMap
from auditor.measurement.frame_views import FrameViews
from auditor.measurement.parameters import HALF, PATCH_CORRELATION
from auditor.measurement.point_parameters import FALSE_RANGES
from auditor.model.arrays import Floats, Floats32, Indices, Mask, median_of
from auditor.model.checks import FEWEST_VOTERS, Pair, conflict_cameras

_STRIPS = round(np.pi / FALSE_RANGES.strip)
"""Strips of the half circle ahead."""

_EVENLY = sqrt(12)
"""The width of what is spread evenly, in standard deviations."""

_SECTOR = FALSE_RANGES.sector_strips
_QUARTILES = (FALSE_RANGES.not_shifted, 0.5, 1 - FALSE_RANGES.not_shifted)


@dataclass(frozen=True, eq=False)
class DirectedPoints:
    """The points of a view from the LiDAR, in the rig's axes.

    `upright` (M,) are the numbers of those above the road and no nearer than a cluster may be, from left to right, and
    `place` (3, M) what they are to the right and down, in radians, and the logarithm of their range. `near` (K,) are
    those of which sectors are made, in the order of their `strip` (K,).
    """

    upright: Indices
    place: Floats32
    near: Indices
    strip: Indices


@dataclass(frozen=True, eq=False)
class PairRanges:
    """What a pair of cameras says of the LiDAR's ranges.

    `place` (3, M) are those of DirectedPoints; `contradicted` (M,) the points that the pair contradicts; `against` (M,)
    by how much a point speaks for a surface that is there. `patch` is how wide a patch is, in radians. `farther_m`
    (sectors,) is by how much three quarters of a sector's ranges are too large at least, or too small, less the median
    sector's median; NaN where unknown.
    """

    place: Floats32
    patch: float
    contradicted: Mask
    against: Floats32
    farther_m: Floats


def directed_points(view: LidarView, road_m: float) -> DirectedPoints:
    """The points of a view by direction; the road is `road_m` below the LiDAR."""
    assert view.rig.lidar is not None
    x, y, z = view.rig.lidar.rig_SE3_lidar[:3, :3].astype(np.float32) @ view.point_m.T
    right = np.arctan2(x, z)
    upright = np.flatnonzero((y < road_m - FALSE_RANGES.above_road_m) & (view.range_m > FALSE_RANGES.nearest_m))
    upright = upright[np.argsort(right[upright])]
    down = np.arctan2(y[upright], np.hypot(x[upright], z[upright]))
    nearest, farthest = FALSE_RANGES.sector_ranges_m
    near = np.flatnonzero((view.range_m > nearest) & (view.range_m < farthest))
    strip = np.floor(right[near] / np.float32(FALSE_RANGES.strip)).astype(np.int16) + _STRIPS // 2
    order = np.argsort(strip, kind="stable")
    return DirectedPoints(
        upright, np.stack([right[upright], down, np.log(view.range_m[upright])]), near[order], strip[order]
    )


def directed(seen: FrameViews, k: int) -> DirectedPoints:
    """The points of a view by their directions."""
    return directed_points(seen.views[k], seen.once(scanned, k).road_m)


def pair_ranges(
    points: DirectedPoints, view: LidarView, stereo: StereoMap, votes: PointVotes, source: int
) -> PairRanges:
    """What a pair says of the points of its reference's view."""
    contradicted = votes.contradicted[points.upright]
    against = np.where(votes.confirmed[points.upright], np.float32(1), np.float32(FALSE_RANGES.undecided))
    against[contradicted] = 0
    patch = HALF * (2 * PATCH_CORRELATION.radius_px + 1) / view.rig.camera(view.reference).focal_px
    return PairRanges(points.place, patch, contradicted, against, _farther_m(points, view, stereo, votes.clear, source))


class RangesFound(NamedTuple):
    """How surely, 0 to 1, a cluster of points is `false`, or a sector shifted, and a cluster that is false scatters."""

    false: float
    scattered: float


class _Clusters(NamedTuple):
    """(pairs, clusters) how many points each pair contradicts of those that do not scatter, and of those that do.

    `against` is how much speaks for a surface that is there.
    """

    together: Floats
    scattering: Floats
    against: Floats


def false_ranges(pairs: Mapping[Pair, PairRanges]) -> dict[tuple[int, ...], RangesFound]:
    """What the cameras of some pairs say of clusters and sectors.

    One pair alone says nothing: what it mismatches looks as false.
    """
    several = [cameras for cameras in conflict_cameras([*pairs]) if len(cameras) > FEWEST_VOTERS]
    if not several:
        return {}
    clusters = _clusters([*pairs.values()])
    ranges_of: dict[tuple[int, ...], RangesFound] = {}
    for cameras in several:
        some = [place for place, pair in enumerate(pairs) if set(pair) <= set(cameras)]
        shift = _shift([pair.farther_m for place, pair in enumerate(pairs.values()) if place in some])
        against = clusters.against[some].mean(axis=0)
        false, scattered = (
            _surely(lot[some].mean(axis=0), against) for lot in (clusters.together, clusters.scattering)
        )
        ranges_of[cameras] = RangesFound(max(false, shift / (shift + FALSE_RANGES.half_m)), scattered)
    return ranges_of


def _surely(contradicted: Floats, against: Floats) -> float:
    """The statistic, 0 to 1, of (clusters,)."""
    ratio = _ratio(contradicted, against)
    return ratio / (ratio + FALSE_RANGES.half_ratio)


def _clusters(pairs: Sequence[PairRanges]) -> _Clusters:
    """The clusters around some contradicted points.

    A cluster is what lies within half a car's width and height, at its range; what is against it may lie a bit above,
    or below.
    """
    middles = np.concatenate([pair.place[:, pair.contradicted] for pair in pairs], axis=1)
    middles = middles[:, :: max(-(-middles.shape[1] // FALSE_RANGES.most_clusters), 1)]
    range_m = np.exp(middles[2])
    across, down = (np.float32(size) / range_m for size in FALSE_RANGES.half_size_m)
    over = np.float32(FALSE_RANGES.over_m) / range_m
    contradicted, against = np.zeros((2, len(pairs), middles.shape[1]))
    surfaces: dict[tuple[int, int], tuple[slice, Mask]] = {}
    for number, pair in enumerate(pairs):
        first, end = (np.searchsorted(pair.place[0], middles[0] + off) for off in (-across, across))
        for cluster, (_, down_at, far) in enumerate(middles.T):
            some = slice(first[cluster], end[cluster])
            off = np.abs(pair.place[1, some] - down_at)
            surface = (off <= down[cluster] + over[cluster]) & (
                np.abs(pair.place[2, some] - far) <= FALSE_RANGES.as_far
            )
            against[number, cluster] = pair.against[some] @ surface
            surface &= pair.contradicted[some] & (off <= down[cluster])
            contradicted[number, cluster], surfaces[number, cluster] = np.count_nonzero(surface), (some, surface)
    # Where no pair's share is above a clean surface's, that of several is not either.
    above = np.any(contradicted > FALSE_RANGES.clean_share * (contradicted + against), axis=0).tolist()
    scattering = np.zeros_like(contradicted)
    for (number, cluster), (some, surface) in surfaces.items():
        if not above[cluster]:
            continue
        pair = pairs[number]
        shape = pair.place[:, some][:, surface]
        if _is_narrow(shape, pair.patch):
            contradicted[number, cluster] = 0
        elif scatter(shape) * range_m[cluster] > SCATTERED_RETURNS.least_m:
            scattering[number, cluster] = contradicted[number, cluster]
    return _Clusters(contradicted - scattering, scattering, against)


def _is_narrow(place: Floats32, patch: float) -> bool:
    """Whether points (3, N) are no wider than a patch, or no higher."""
    return not place.size or bool(place[:2].std(axis=1).min() * _EVENLY <= patch)


def _ratio(contradicted: Floats, against: Floats) -> float:
    """The logarithm of the largest generalised likelihood ratio of (clusters,), less that of how many there are.

    It compares the share of contradicted points that a cluster has with the largest that a clean surface has.
    """
    if not contradicted.size:
        return 0.0
    share = contradicted / np.maximum(contradicted + against, 1)
    clean = FALSE_RANGES.clean_share
    ratio = contradicted * np.log(np.maximum(share, clean) / clean)
    rest = np.maximum(1 - np.maximum(share, clean), np.finfo(np.float64).tiny)
    ratio += against * np.log(rest / (1 - clean))
    return max(float(ratio.max()) - log1p(contradicted.size), 0.0)


def _farther_m(points: DirectedPoints, view: LidarView, stereo: StereoMap, clear: Mask, source: int) -> Floats:
    """(sectors,) by how much the LiDAR's depths exceed stereo's, of what is near: see PairRanges."""
    camera = view.rig.camera(view.reference)
    focal_times_baseline = camera.focal_px * view.rig.baseline_m(source, view.reference)
    farthest_m = sqrt(focal_times_baseline * FALSE_RANGES.most_of_a_pixel_m)
    seen = clear[points.near] & (view.range_m[points.near] < farthest_m)
    near, strip = points.near[seen], points.strip[seen]
    ds = stereo.disparity_px.take(view.place(stereo.step, stereo.disparity_px.shape[1])[near])
    farther = focal_times_baseline / view.disparity_px(source)[near] - focal_times_baseline / np.maximum(ds, 1)
    same = np.abs(farther) < FALSE_RANGES.most_m
    farther, bounds = farther[same], np.searchsorted(strip[same], np.arange(_STRIPS + 1))
    quartiles = np.full((len(_QUARTILES), _STRIPS - _SECTOR + 1), np.nan)
    for sector in np.flatnonzero(bounds[_SECTOR:] - bounds[:-_SECTOR] >= FALSE_RANGES.sector_fewest).tolist():
        ordered = np.sort(farther[bounds[sector] : bounds[sector + _SECTOR]])
        quartiles[:, sector] = ordered[[int(share * (ordered.size - 1)) for share in _QUARTILES]]
    measured = ~np.isnan(quartiles[1])
    lower, _, upper = quartiles - (median_of(np.sort(quartiles[1, measured])) if measured.any() else 0.0)
    return np.asarray(np.where(measured, np.maximum(lower, 0) + np.minimum(upper, 0), np.nan))


def _shift(farther_m: Sequence[Floats]) -> float:
    """By how many metres more than usual the sector is shifted that is shifted most, by what all pairs say that know.

    Two pairs at least must know it, where there are two, and it is the smallest of what they say.
    """
    told = np.stack(farther_m)
    measured = ~np.isnan(told)
    enough = measured.sum(axis=0) >= min(len(told), 2)
    least = np.maximum(np.where(measured, told, np.inf).min(axis=0), np.where(measured, -told, np.inf).min(axis=0))
    return max(float(least[enough].max(initial=0.0)) - FALSE_RANGES.usual_m, 0.0)
