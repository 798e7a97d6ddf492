"""How well images and points fit a rig where they fit best: what no attack on a portion of the view can take away.

A view is cut into regions. In each the LiDAR's points are compared with stereo wherever the two images are consistent,
and the share that agrees within 1 px is taken. The fit of a pair is that of its better regions. A rig that is wrong
altogether fits by chance, in all regions of all pairs alike.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from math import nan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auditor.measurement.checks.photometric_consistency import PairConsistency
from auditor.measurement.disparity.lidar import LidarView, lidar_view
from auditor.measurement.fault_features.lidar_agreement import LidarComparison, differences
from auditor.measurement.pairwise_views import OF_TWO
from auditor.measurement.parameters import HALF, LIDAR_AGREEMENT, PATCH_CORRELATION
from auditor.measurement.shared_view import FrameArrays
from auditor.measurement.warning_parameters import GEOMETRY_FIT
from auditor.model.arrays import Floats, Indices, Mask, quantile_of
from auditor.model.checks import Pair, resolves_depth

_ROWS, _COLUMNS = GEOMETRY_FIT.regions


_Part = tuple[FrameArrays, int, int]

_OTHER_AXES = {
    "y negated": (1.0, -1.0, 1.0),
    "z negated": (1.0, 1.0, -1.0),
    "x and y negated": (-1.0, -1.0, 1.0),
    "y and z negated": (1.0, -1.0, -1.0),
}
"""Other axes of points that show a road as the right ones do, and nothing else: left-handed, turned or upside down."""


class FrameFit(NamedTuple):
    """The fit of one frame: shares of the better regions, NaN where too few regions could be compared.

    `points`: the LiDAR's points agree with stereo, by the best pair. `pictures`: the two images of a pair are
    consistent, the mean of the pairs. `of_cameras`: the images of each camera by its best pair. `in_view`: how many
    points lie in the view of a camera; -1 without a LiDAR. `other_axes`: as `points`, of points with other axes; known
    only where `points` fit badly.
    """

    points: float
    pictures: float
    of_cameras: Mapping[int, float]
    in_view: int
    other_axes: Mapping[str, float]


def geometry_fit(arrays: FrameArrays) -> FrameFit:
    """The fit of a measured frame, by its wide pairs: others hardly depend on where the cameras stand."""
    of_pairs = _by_pair(arrays)
    fits = {pair: _of_pictures(own.frame_checks.consistencies[i, k]) for pair, (own, i, k) in of_pairs.items()}
    wide = _wide(of_pairs)
    parts = list(wide.values())
    pictures = _measured(fits[pair] for pair in wide)
    seen = [part for part in parts if part[2] in part[0].lidar]
    points = _best(_of_points(part[0].lidar[part[2]], part) for part in seen)
    others = (
        {} if points >= GEOMETRY_FIT.in_doubt else {name: _of_axes(seen, axes) for name, axes in _OTHER_AXES.items()}
    )
    return FrameFit(
        points,
        float(np.mean(pictures)) if pictures else nan,
        {camera: _best(fit for pair, fit in fits.items() if camera in pair) for camera in chain(*fits)},
        max((own.lidar[k].returns for own, _, k in seen), default=-1),
        others,
    )


def better_quarter(shares: Iterable[float]) -> float:
    """The share that is good in the better ones of regions, or of frames; NaN where none was measured.

    So an attack on up to three quarters of them is not taken for a rig that does not fit.
    """
    measured = np.sort(_measured(shares))
    return quantile_of(measured, GEOMETRY_FIT.better_quantile) if measured.size else nan


def views_of_sides(arrays: FrameArrays) -> dict[Pair, LidarView]:
    """The LiDAR's views by the wide pairs whose sides are compared."""
    parts = _wide(_by_pair(arrays))
    return {pair: own.lidar[k] for pair, (own, _, k) in parts.items() if k in own.lidar}


def fit_of_sides(arrays: FrameArrays, views: Mapping[Pair, LidarView]) -> float:
    """The share of the LiDAR's points that agree with stereo at both sides of the views; NaN where too few are there.

    A lens that is read wrongly bends the sides, and hardly the middle; points of another moment lie elsewhere there.
    `views` are those of this frame's cloud, or of another one's by the same rig.
    """
    compared, agreeing, parts = 0, 0, _by_pair(arrays)
    for pair in views.keys() & parts:
        region, agree = _compared_points(views[pair], parts[pair])
        column = region % _COLUMNS
        aside = np.minimum(column, _COLUMNS - 1 - column) < GEOMETRY_FIT.side_columns
        compared += int(np.count_nonzero(aside))
        agreeing += int(np.count_nonzero(agree & aside))
    return agreeing / compared if compared >= GEOMETRY_FIT.fewest_points * GEOMETRY_FIT.fewest_regions else nan


def _by_pair(arrays: FrameArrays) -> dict[Pair, _Part]:
    return dict(zip(arrays.maps, _parts(arrays), strict=True))


def _wide(of_pairs: Mapping[Pair, _Part]) -> dict[Pair, _Part]:
    """The pairs that resolve depth, less those much narrower than the widest."""
    deep = {pair: one for pair, one in of_pairs.items() if resolves_depth(one[0].rig, *one[1:])}
    widest_m = max((own.rig.baseline_m(i, k) for own, i, k in deep.values()), default=0.0)
    wide_m = GEOMETRY_FIT.least_width * widest_m
    return {pair: one for pair, one in deep.items() if one[0].rig.baseline_m(*one[1:]) >= wide_m}


def _of_axes(parts: Sequence[_Part], axes: tuple[float, float, float]) -> float:
    """As the points' fit, each coordinate multiplied."""
    clouds = ((part, part[0].cloud) for part in parts)
    return _best(
        _of_points(
            lidar_view(replace(cloud, xyz_m=cloud.xyz_m * np.array(axes, dtype=np.float32)), part[0].rig, part[2]), part
        )
        for part, cloud in clouds
        if cloud is not None
    )


def _parts(arrays: FrameArrays) -> Iterator[_Part]:
    """The matched pairs (i, k), each with the arrays of its view."""
    for pair in arrays.maps:
        own, (i, k) = (arrays.pairs[pair].own, OF_TWO) if pair in arrays.pairs else (arrays, pair)
        yield own, i, k


def _of_points(view: LidarView, part: _Part) -> float:
    return _better_regions(*_compared_points(view, part), GEOMETRY_FIT.fewest_points)


def _compared_points(view: LidarView, part: _Part) -> tuple[Indices, Mask]:
    """The regions of the points that can be compared, and whether they agree with stereo."""
    own, i, k = part
    consistency = own.frame_checks.consistencies[i, k]
    points = LidarComparison.of(view, own.maps[i, k], consistency, i)
    apart_px = differences(points, points.sure_px)
    compared = ~np.isnan(apart_px)
    region = _region(points.row[compared] // HALF, points.column[compared] // HALF, consistency.ncc.shape)
    return region, np.abs(apart_px[compared]) <= LIDAR_AGREEMENT.agree_px


def _of_pictures(consistency: PairConsistency) -> float:
    row, column = np.nonzero(consistency.comparable)
    region = _region(row, column, consistency.ncc.shape)
    consistent = consistency.ncc[row, column] > PATCH_CORRELATION.consistent
    return _better_regions(region, consistent, GEOMETRY_FIT.fewest_pixels)


def _region(row: NDArray[np.integer], column: NDArray[np.integer], shape: tuple[int, int]) -> Indices:
    height, width = shape
    return np.asarray(row * _ROWS // height * _COLUMNS + column * _COLUMNS // width, dtype=np.intp)


def _better_regions(region: Indices, good: Mask, fewest: int) -> float:
    """The share that is good in the better regions; NaN where too few regions have enough to tell."""
    count = np.bincount(region, minlength=_ROWS * _COLUMNS)
    enough = count >= fewest
    shares: Floats = np.bincount(region, weights=good, minlength=_ROWS * _COLUMNS)[enough] / count[enough]
    return better_quarter(shares) if shares.size >= GEOMETRY_FIT.fewest_regions else nan


def _measured(shares: Iterable[float]) -> list[float]:
    return [share for share in shares if not np.isnan(share)]


def _best(shares: Iterable[float]) -> float:
    return max(_measured(shares), default=nan)
