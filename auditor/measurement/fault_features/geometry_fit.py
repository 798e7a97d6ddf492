"""How well images and points fit a rig where they fit best: what no attack on a portion of the view can take away.

A view is cut into regions. In each the LiDAR's points are compared with stereo wherever the two images are consistent,
and the share that agrees within 1 px is taken. The fit of a pair is that of its better regions. A rig that is wrong
altogether fits by chance, in all regions of all pairs alike.
"""

from collections.abc import Iterator
from math import nan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auditor.measurement.checks.photometric_consistency import PairConsistency
from auditor.measurement.disparity.lidar import LidarView
from auditor.measurement.disparity.stereo import StereoMap
from auditor.measurement.fault_features.lidar_agreement import LidarComparison, differences
from auditor.measurement.pairwise_views import OF_TWO
from auditor.measurement.parameters import HALF, LIDAR_AGREEMENT, PATCH_CORRELATION
from auditor.measurement.shared_view import FrameArrays
from auditor.measurement.warning_parameters import GEOMETRY_FIT
from auditor.model.arrays import Floats, Indices, Mask
from auditor.model.checks import resolves_depth

_ROWS, _COLUMNS = GEOMETRY_FIT.regions


class GeometryFit(NamedTuple):
    """The fit of one frame: shares of the better regions, NaN where too few regions could be compared.

    `points`: the LiDAR's points agree with stereo, by the best pair. `pictures`: the two images of a pair are
    consistent, the mean of the pairs. `in_view`: how many points lie in the view of a camera; -1 without a LiDAR.
    """

    points: float
    pictures: float
    in_view: int


def geometry_fit(arrays: FrameArrays) -> GeometryFit:
    """The fit of a measured frame, by the pairs that resolve depth: others hardly depend on where cameras stand."""
    parts = [(own, i, k) for own, i, k in _parts(arrays) if resolves_depth(own.rig, i, k)]
    views = [own.lidar[k] for own, _, k in parts if k in own.lidar]
    points = [
        _of_points(own.lidar[k], own.maps[i, k], own.frame_checks.consistencies[i, k], i)
        for own, i, k in parts
        if k in own.lidar
    ]
    pictures = [_of_pictures(own.frame_checks.consistencies[i, k]) for own, i, k in parts]
    return GeometryFit(
        max(_measured(points), default=nan),
        float(np.mean(_measured(pictures))) if _measured(pictures) else nan,
        max((view.returns for view in views), default=-1),
    )


def _parts(arrays: FrameArrays) -> Iterator[tuple[FrameArrays, int, int]]:
    """The matched pairs (i, k), each with the arrays of its view."""
    for pair in arrays.maps:
        own, (i, k) = (arrays.pairs[pair].own, OF_TWO) if pair in arrays.pairs else (arrays, pair)
        yield own, i, k


def _of_points(view: LidarView, stereo: StereoMap, consistency: PairConsistency, source: int) -> float:
    points = LidarComparison.of(view, stereo, consistency, source)
    apart_px = differences(points, points.sure_px)
    compared = ~np.isnan(apart_px)
    region = _region(points.row[compared] // HALF, points.column[compared] // HALF, points.sure_px.shape)
    agree = np.abs(apart_px[compared]) <= LIDAR_AGREEMENT.agree_px
    return _better_regions(region, agree, GEOMETRY_FIT.fewest_points)


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
    known = count >= fewest
    shares: Floats = np.bincount(region, weights=good, minlength=_ROWS * _COLUMNS)[known] / count[known]
    if shares.size < GEOMETRY_FIT.fewest_regions:
        return nan
    return float(np.quantile(shares, GEOMETRY_FIT.regions_quantile))


def _measured(shares: list[float]) -> list[float]:
    return [share for share in shares if not np.isnan(share)]
