"""Cameras that do not stand on one line: each pair is measured as a rig of two, and a frame joins all pairs."""

from collections.abc import Mapping

from auditor.measurement.checks.collect import collect_checks, with_pairs
from auditor.measurement.disparity.disparity_error import Comparison, compare_cameras
from auditor.measurement.disparity.rectification import PairView
from auditor.measurement.shared_view import FrameArrays, PairArrays, RectifiedFrame, lidar_views
from auditor.model.checks import Pair
from auditor.model.rig import LIDAR, Triple

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
    of_pairs = {pair: part.frame_checks for pair, part in parts.items()}
    frame_checks = with_pairs(collect_checks(whole.half_res, {}, {}, lidar, rig), of_pairs, OF_TWO)
    own = {pair: PairArrays(parts[pair], views[pair].to_shared) for pair in whole.pairs}
    return FrameArrays(rig, whole.half_res, comparisons, maps, lidar, frame_checks, own)
