"""The symptoms of one frame after another: the frame before is remembered, so that delays can be seen."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from auditor.elements import resolves_depth
from auditor.evidence.agreement import SureMap, agreement
from auditor.evidence.contrast import contrast, smoothed
from auditor.evidence.lidar import LidarView
from auditor.evidence.likeness import Likeness
from auditor.evidence.registration import corners, register
from auditor.evidence.stereo import StereoMap
from auditor.rig import Rig
from auditor.symptoms import Agreement, Pair, PairSymptoms, Rows

_HALF = 2

Image = NDArray[np.uint8]


class Watch:
    """Watches the frames of one recording in their order."""

    def __init__(self) -> None:
        self._halves: Mapping[int, Image] = {}
        self._sure: Mapping[Pair, SureMap] = {}

    def observe(
        self,
        halves: Mapping[int, Image],
        maps: Mapping[Pair, StereoMap],
        views: Mapping[int, LidarView],
        likenesses: Mapping[Pair, Likeness],
        rig: Rig,
    ) -> dict[Pair, PairSymptoms]:
        """The symptoms of the next frame by matched pair (i, k).

        `halves` are the half-resolution grey images of the cameras present, `maps` and `likenesses` by (witness,
        reference), `views` the LiDAR's by reference; all of them as `measure` and `testify` make them.
        """
        points = {k: corners(halves[k]) for k in dict.fromkeys(k for _, k in maps)}
        rows = register(points, halves, self._halves, {(i, k): _at(maps[i, k], points[k]) for i, k in maps})
        smooth = {camera: smoothed(half) for camera, half in halves.items()}
        contrasts = {(i, k): contrast(smooth[k], smooth[i], likenesses[i, k], maps[i, k]) for i, k in maps}
        sure = {
            (j, k): SureMap.of(stereo, likenesses[j, k])
            for (j, k), stereo in maps.items()
            if k in views and resolves_depth(rig, j, k)
        }
        agreements = {(j, k): agreement(views[k], sure[j, k], self._sure.get((j, k)), rig, j) for j, k in sure}
        self._halves, self._sure = halves, sure
        return {
            pair: PairSymptoms(rows.get(pair, Rows()), contrasts[pair], agreements.get(pair, Agreement()))
            for pair in maps
        }


def _at(stereo: StereoMap, points: NDArray[np.float32]) -> NDArray[np.float32]:
    """The disparities of half-resolution points, in half-resolution pixels."""
    step = _HALF // stereo.step
    column, row = points.astype(np.intp).T * step
    return np.asarray(stereo.disparity_px[row, column] / np.float32(_HALF))
