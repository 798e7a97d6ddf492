"""The symptoms of one frame after another: the frame before is remembered, so that delays can be seen."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from auditor.measurement.disparity.stereo import StereoMap
from auditor.measurement.fault_features.contrast import contrast, smoothed
from auditor.measurement.fault_features.lidar_agreement import LidarComparison, agreement
from auditor.measurement.fault_features.row_alignment import corners, register
from auditor.measurement.pairwise_views import OF_TWO
from auditor.measurement.parameters import HALF
from auditor.measurement.shared_view import Evidence
from auditor.model.checks import Agreement, IsolatedShares, Pair, PairFaultFeatures, Rows, resolves_depth

Image = NDArray[np.uint8]


class FaultFeatures:
    """Watches the frames of one recording in their order, pairs with views of their own each for itself."""

    def __init__(self) -> None:
        self._pairs: Mapping[Pair, FaultFeatures] = {}
        self._half_res: Mapping[int, Image] = {}
        self._comparisons: Mapping[Pair, LidarComparison] = {}

    def update(self, evidence: Evidence) -> dict[Pair, PairFaultFeatures]:
        """The symptoms of the next frame by matched pair (i, k)."""
        if evidence.pairs:
            # A pair that was not there a frame ago begins anew.
            self._pairs = {pair: self._pairs.get(pair, FaultFeatures()) for pair in evidence.pairs}
            return {pair: self._pairs[pair].update(part.own)[OF_TWO] for pair, part in evidence.pairs.items()}
        half_res, maps, views = evidence.views, evidence.maps, evidence.lidar
        consistencies, rig, isolated_shares = (
            evidence.frame_checks.consistencies,
            evidence.rig,
            evidence.frame_checks.isolated_shares,
        )
        points = {k: corners(half_res[k], evidence.valid_masks.get(k)) for k in dict.fromkeys(k for _, k in maps)}
        rows = register(points, half_res, self._half_res, {(i, k): _at(maps[i, k], points[k]) for i, k in maps})
        smooth = {camera: smoothed(half) for camera, half in half_res.items()}
        contrasts = {(i, k): contrast(smooth[k], smooth[i], consistencies[i, k], maps[i, k]) for i, k in maps}
        comparisons = {
            (j, k): LidarComparison.of(views[k], stereo, consistencies[j, k], j)
            for (j, k), stereo in maps.items()
            if k in views and resolves_depth(rig, j, k)
        }
        agreements = {
            pair: agreement(comparison, self._comparisons.get(pair)) for pair, comparison in comparisons.items()
        }
        self._half_res, self._comparisons = half_res, comparisons
        return {
            pair: PairFaultFeatures(
                rows.get(pair, Rows()),
                contrasts[pair],
                agreements.get(pair, Agreement()),
                isolated_shares[pair[1]] if pair in comparisons else IsolatedShares(),
            )
            for pair in maps
        }


def _at(stereo: StereoMap, points: NDArray[np.float32]) -> NDArray[np.float32]:
    """The disparities of half-resolution points, in half-resolution pixels."""
    step = HALF // stereo.step
    column, row = points.astype(np.intp).T * step
    return np.asarray(stereo.disparity_px[row, column] / np.float32(HALF))
