"""Cameras that do not stand on one line: each pair is measured as a rig of two, and a frame is what all pairs say."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from auditor.measurement.checks.collect import Testimony, testify
from auditor.measurement.checks.disparity_error import Comparison, compare_cameras
from auditor.measurement.disparity.lidar import LidarView
from auditor.measurement.disparity.rectification import PairView
from auditor.measurement.shared_view import Evidence, Looked, OwnEvidence, lidar_views
from auditor.model.checks import Pair
from auditor.model.rig import LIDAR, Rig, Triple

Said = TypeVar("Said")

OF_TWO: Pair = (1, 2)
"""The cameras of a rig of two."""

WITH_LIDAR = Triple(LIDAR, *OF_TWO)
"""What a rig of two compares."""


def join(whole: Looked, parts: Mapping[Pair, Evidence], views: Mapping[Pair, PairView]) -> Evidence:
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
    testimony = joined({pair: part.testimony for pair, part in parts.items()}, whole.halves, lidar, rig)
    own = {pair: OwnEvidence(parts[pair], views[pair].back) for pair in whole.pairs}
    return Evidence(rig, whole.halves, comparisons, maps, lidar, testimony, own)


def joined(
    told: Mapping[Pair, Testimony],
    halves: Mapping[int, NDArray[np.uint8]],
    views: Mapping[int, LidarView],
    rig: Rig,
) -> Testimony:
    """What rigs of two told, by the numbers (i, k) of their cameras, and what takes no rows to be seen.

    Light, empty strips and scattered points are looked for in the common view, whose pictures and LiDAR's views the
    others are: its cells are larger than what cameras beside a line miss.
    """
    return replace(
        testify(halves, {}, views, rig),
        contradicted=_of_pairs({pair: one.contradicted for pair, one in told.items()}),
        unlike=_of_pairs({pair: one.unlike for pair, one in told.items()}),
        adjudications=_of_pairs({pair: one.adjudications for pair, one in told.items()}),
        likenesses=_of_pairs({pair: one.likenesses for pair, one in told.items()}),
    )


def _of_pairs(said: Mapping[Pair, Mapping[Pair, Said]]) -> dict[Pair, Said]:
    return {pair: one[OF_TWO] for pair, one in said.items() if OF_TWO in one}
