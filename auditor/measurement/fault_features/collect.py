"""The symptoms of one frame after another: the frame before is remembered, so that delays can be seen."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from auditor.measurement.disparity.stereo import StereoMap
from auditor.measurement.fault_features.contrast import contrast, smoothed
from auditor.measurement.fault_features.lidar_agreement import Moment, agreement
from auditor.measurement.fault_features.row_alignment import corners, register
from auditor.measurement.pairwise_views import OF_TWO
from auditor.measurement.parameters import HALF
from auditor.measurement.shared_view import Evidence
from auditor.model.checks import Agreement, Pair, PairSymptoms, Rows, Specks, resolves_depth

Image = NDArray[np.uint8]


class Watch:
    """Watches the frames of one recording in their order, pairs with views of their own each for itself."""

    def __init__(self) -> None:
        self._pairs: Mapping[Pair, Watch] = {}
        self._halves: Mapping[int, Image] = {}
        self._moments: Mapping[Pair, Moment] = {}

    def observe(self, evidence: Evidence) -> dict[Pair, PairSymptoms]:
        """The symptoms of the next frame by matched pair (i, k)."""
        if evidence.pairs:
            # A pair that was not there a frame ago begins anew.
            self._pairs = {pair: self._pairs.get(pair, Watch()) for pair in evidence.pairs}
            return {pair: self._pairs[pair].observe(part.own)[OF_TWO] for pair, part in evidence.pairs.items()}
        halves, maps, views = evidence.views, evidence.maps, evidence.lidar
        likenesses, rig, specks = evidence.testimony.likenesses, evidence.rig, evidence.testimony.specks
        points = {k: corners(halves[k], evidence.sights.get(k)) for k in dict.fromkeys(k for _, k in maps)}
        rows = register(points, halves, self._halves, {(i, k): _at(maps[i, k], points[k]) for i, k in maps})
        smooth = {camera: smoothed(half) for camera, half in halves.items()}
        contrasts = {(i, k): contrast(smooth[k], smooth[i], likenesses[i, k], maps[i, k]) for i, k in maps}
        moments = {
            (j, k): Moment.of(views[k], stereo, likenesses[j, k], j)
            for (j, k), stereo in maps.items()
            if k in views and resolves_depth(rig, j, k)
        }
        agreements = {pair: agreement(moment, self._moments.get(pair)) for pair, moment in moments.items()}
        self._halves, self._moments = halves, moments
        return {
            pair: PairSymptoms(
                rows.get(pair, Rows()),
                contrasts[pair],
                agreements.get(pair, Agreement()),
                specks[pair[1]] if pair in moments else Specks(),
            )
            for pair in maps
        }


def _at(stereo: StereoMap, points: NDArray[np.float32]) -> NDArray[np.float32]:
    """The disparities of half-resolution points, in half-resolution pixels."""
    step = HALF // stereo.step
    column, row = points.astype(np.intp).T * step
    return np.asarray(stereo.disparity_px[row, column] / np.float32(HALF))
