"""Cameras that do not stand on one line: each pair is measured as a rig of two, and a frame joins all pairs."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from auditor.measurement.checks.collect import FrameChecks, collect_checks
from auditor.measurement.checks.disparity_error import Comparison, compare_cameras
from auditor.measurement.disparity.lidar import LidarView
from auditor.measurement.disparity.rectification import PairView
from auditor.measurement.shared_view import FrameArrays, PairArrays, RectifiedFrame, lidar_views
from auditor.model.checks import Pair
from auditor.model.rig import LIDAR, Rig, Triple

Value = TypeVar("Value")

OF_TWO: Pair = (1, 2)
"""The cameras of a rig of two."""

WITH_LIDAR = Triple(LIDAR, *OF_TWO)
"""What a rig of two compares."""


def join(whole: RectifiedFrame, parts: Mapping[Pair, FrameArrays], views: Mapping[Pair, PairView]) -> FrameArrays:
    """The arrays of a frame from those of its pairs (i, k).

    E_{0,j,k} is the pair's own. E_{i,j,k} compares the maps of two pairs, warped to the common view of k: only there
    they have pixels in common.
    """
    rig = whole.rig
    maps = {pair: views[pair].to_shared.stereo(parts[pair].maps[OF_TWO]) for pair in whole.pairs}
    lidar = lidar_views(whole.frame, rig, whole.triples)
    comparisons: dict[Triple, Comparison] = {}
    for triple in whole.triples:
        i, j, k = triple
        comparisons[triple] = (
            views[j, k].to_shared.comparison(parts[j, k].comparisons[WITH_LIDAR])
            if i == LIDAR
            else compare_cameras(maps[i, k], maps[j, k], rig.baseline_m(i, k), rig.baseline_m(j, k))
        )
    frame_checks = joined({pair: part.frame_checks for pair, part in parts.items()}, whole.half_res, lidar, rig)
    own = {pair: PairArrays(parts[pair], views[pair].to_shared) for pair in whole.pairs}
    return FrameArrays(rig, whole.half_res, comparisons, maps, lidar, frame_checks, own)


def joined(
    of_pairs: Mapping[Pair, FrameChecks],
    half_res: Mapping[int, NDArray[np.uint8]],
    views: Mapping[int, LidarView],
    rig: Rig,
) -> FrameChecks:
    """The checks of rigs of two, by the numbers (i, k) of their cameras, and those that need no common rows.

    Brightness differences, point dropout and isolated points are measured in the common view, of which `half_res` and
    `views` are: its cells are larger than the offset of cameras that stand beside a line.
    """
    in_common = collect_checks(half_res, {}, views, rig)
    return replace(
        in_common,
        lidar_conflicts=_of_pairs({pair: one.lidar_conflicts for pair, one in of_pairs.items()}),
        photometric_inconsistencies=_of_pairs(
            {pair: one.photometric_inconsistencies for pair, one in of_pairs.items()}
        ),
        unmasked=replace(
            in_common.unmasked,
            photometric_inconsistencies=_of_pairs(
                {pair: one.unmasked.photometric_inconsistencies for pair, one in of_pairs.items()}
            ),
        ),
        verified_conflicts=_of_pairs({pair: one.verified_conflicts for pair, one in of_pairs.items()}),
        consistencies=_of_pairs({pair: one.consistencies for pair, one in of_pairs.items()}),
    )


def _of_pairs(of_pairs: Mapping[Pair, Mapping[Pair, Value]]) -> dict[Pair, Value]:
    return {pair: one[OF_TWO] for pair, one in of_pairs.items() if OF_TWO in one}
