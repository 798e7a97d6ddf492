"""Cameras that do not stand on one line: each pair is measured as a rig of two, and a frame is what all pairs say."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from auditor.measurement.checks.collect import FrameChecks, collect_checks
from auditor.measurement.checks.disparity_error import Comparison, compare_cameras
from auditor.measurement.disparity.lidar import LidarView
from auditor.measurement.disparity.rectification import PairView
from auditor.measurement.shared_view import Evidence, OwnEvidence, RectifiedFrame, lidar_views
from auditor.model.checks import Pair
from auditor.model.rig import LIDAR, Rig, Triple

Value = TypeVar("Value")

OF_TWO: Pair = (1, 2)
"""The cameras of a rig of two."""

WITH_LIDAR = Triple(LIDAR, *OF_TWO)
"""What a rig of two compares."""


def join(whole: RectifiedFrame, parts: Mapping[Pair, Evidence], views: Mapping[Pair, PairView]) -> Evidence:
    """The evidence of a frame from that of its pairs (i, k).

    E_{0,j,k} is the pair's own. E_{i,j,k} compares the maps of two pairs, brought back to the common view of k: there
    alone they have pixels in common.
    """
    rig = whole.rig
    maps = {pair: views[pair].back.stereo(parts[pair].maps[OF_TWO]) for pair in whole.pairs}
    lidar = lidar_views(whole.frame, rig, whole.triples)
    comparisons: dict[Triple, Comparison] = {}
    for triple in whole.triples:
        i, j, k = triple
        comparisons[triple] = (
            views[j, k].back.comparison(parts[j, k].comparisons[WITH_LIDAR])
            if i == LIDAR
            else compare_cameras(maps[i, k], maps[j, k], rig.baseline_m(i, k), rig.baseline_m(j, k))
        )
    frame_checks = joined({pair: part.frame_checks for pair, part in parts.items()}, whole.half_res, lidar, rig)
    own = {pair: OwnEvidence(parts[pair], views[pair].back) for pair in whole.pairs}
    return Evidence(rig, whole.half_res, comparisons, maps, lidar, frame_checks, own)


def joined(
    of_pairs: Mapping[Pair, FrameChecks],
    half_res: Mapping[int, NDArray[np.uint8]],
    views: Mapping[int, LidarView],
    rig: Rig,
) -> FrameChecks:
    """What rigs of two told, by the numbers (i, k) of their cameras, and what takes no rows to be seen.

    Light, empty strips and scattered points are looked for in the common view, whose pictures and LiDAR's views the
    others are: its cells are larger than what cameras beside a line miss.
    """
    return replace(
        collect_checks(half_res, {}, views, rig),
        lidar_conflicts=_of_pairs({pair: one.lidar_conflicts for pair, one in of_pairs.items()}),
        unlike=_of_pairs({pair: one.unlike for pair, one in of_pairs.items()}),
        verified_conflicts=_of_pairs({pair: one.verified_conflicts for pair, one in of_pairs.items()}),
        consistencies=_of_pairs({pair: one.consistencies for pair, one in of_pairs.items()}),
    )


def _of_pairs(of_pairs: Mapping[Pair, Mapping[Pair, Value]]) -> dict[Pair, Value]:
    return {pair: one[OF_TWO] for pair, one in of_pairs.items() if OF_TWO in one}
