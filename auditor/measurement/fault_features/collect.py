"""The symptoms of one frame after another: the frame before is remembered, so that delays can be seen."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from auditor.measurement.disparity.stereo import StereoMap
from auditor.measurement.fault_features.contrast import contrast, smoothed
from auditor.measurement.fault_features.lidar_agreement import LidarComparison, agreement
from auditor.measurement.fault_features.row_alignment import Points, corners, register
from auditor.measurement.pairwise_views import OF_TWO
from auditor.measurement.parameters import HALF
from auditor.measurement.shared_view import Evidence
from auditor.model.checks import Agreement, Contrast, IsolatedShares, Pair, PairFaultFeatures, Rows, resolves_depth

Image = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Prepared:
    """What symptoms take of one frame: of it, and of it as the frame before.

    `halves` are its half-resolution grey images by camera. By reference: `points` (P, 2) to be followed and its
    `specks`. By matched pair: stereo's disparities at the points, in half-resolution pixels, contrasts and, where the
    pair may deny the LiDAR, moments.
    """

    half_res: Mapping[int, Image]
    points: Mapping[int, Points] = field(default_factory=dict)
    isolated_shares: Mapping[int, IsolatedShares] = field(default_factory=dict)
    disparities_px: Mapping[Pair, NDArray[np.float32]] = field(default_factory=dict)
    contrasts: Mapping[Pair, Contrast] = field(default_factory=dict)
    comparisons: Mapping[Pair, LidarComparison] = field(default_factory=dict)


def prepare(evidence: Evidence) -> Prepared:
    """What symptoms take of the pairs that were matched in one view."""
    half_res, maps, views = evidence.views, evidence.maps, evidence.lidar
    consistencies, rig = evidence.frame_checks.consistencies, evidence.rig
    points = {k: corners(half_res[k], evidence.valid_masks.get(k)) for k in dict.fromkeys(k for _, k in maps)}
    smooth = {camera: smoothed(half) for camera, half in half_res.items()}
    return Prepared(
        half_res,
        points,
        evidence.frame_checks.isolated_shares,
        {(i, k): _at(maps[i, k], points[k]) for i, k in maps},
        {(i, k): contrast(smooth[k], smooth[i], consistencies[i, k], maps[i, k]) for i, k in maps},
        {
            (j, k): LidarComparison.of(views[k], stereo, consistencies[j, k], j)
            for (j, k), stereo in maps.items()
            if k in views and resolves_depth(rig, j, k)
        },
    )


def symptoms_of(now: Prepared, before: Prepared | None) -> dict[Pair, PairFaultFeatures]:
    """The symptoms of a frame by matched pair (i, k), after the frame before it."""
    rows = register(now.points, now.half_res, before.half_res if before else {}, now.disparities_px)
    earlier = before.comparisons if before else {}
    agreements = {pair: agreement(comparison, earlier.get(pair)) for pair, comparison in now.comparisons.items()}
    return {
        pair: PairFaultFeatures(
            rows.get(pair, Rows()),
            now.contrasts[pair],
            agreements.get(pair, Agreement()),
            now.isolated_shares[pair[1]] if pair in now.comparisons else IsolatedShares(),
        )
        for pair in now.contrasts
    }


class FaultFeatures:
    """Watches the frames of one recording in their order, pairs with views of their own each for itself."""

    def __init__(self) -> None:
        self._pairs: Mapping[Pair, FaultFeatures] = {}
        self._before: Prepared | None = None

    def update(self, evidence: Evidence) -> dict[Pair, PairFaultFeatures]:
        """The symptoms of the next frame by matched pair (i, k)."""
        if evidence.pairs:
            # A pair that was not there a frame ago begins anew.
            self._pairs = {pair: self._pairs.get(pair, FaultFeatures()) for pair in evidence.pairs}
            return {pair: self._pairs[pair].update(part.own)[OF_TWO] for pair, part in evidence.pairs.items()}
        now = prepare(evidence)
        found = symptoms_of(now, self._before)
        self._before = now
        return found


def _at(stereo: StereoMap, points: NDArray[np.float32]) -> NDArray[np.float32]:
    """The disparities of half-resolution points, in half-resolution pixels."""
    step = HALF // stereo.step
    column, row = points.astype(np.intp).T * step
    return np.asarray(stereo.disparity_px[row, column] / np.float32(HALF))
