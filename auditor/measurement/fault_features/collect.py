"""The fault features of one frame after another: the frame before is kept, so that lags can be measured.

Fingerprints of each sensor's data tell a frozen one: they are equal frame after frame.
"""

import zlib
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from auditor.measurement.disparity.stereo import StereoMap
from auditor.measurement.fault_features.lidar_agreement import LidarComparison, agreement
from auditor.measurement.fault_features.row_alignment import corners, register
from auditor.measurement.pairwise_views import OF_TWO
from auditor.measurement.parameters import HALF
from auditor.measurement.shared_view import FrameArrays
from auditor.model.arrays import Floats32, Image, Points
from auditor.model.checks import Pair, resolves_depth
from auditor.model.fault_features import Agreement, IsolatedShares, PairFaultFeatures, RowMatches
from auditor.model.frames import Frame
from auditor.model.measurement import NO_FINGERPRINT

_WHITE = 255


def fingerprints(frame: Frame) -> dict[int, int]:
    """The fingerprint of each sensor present that has one."""
    prints = {number: fingerprint_of_image(image.pixels) for number, image in frame.images.items()}
    prints |= {number: fingerprint_of_points(cloud.xyz_m) for number, cloud in frame.clouds.items()}
    return {sensor: known for sensor, known in prints.items() if known != NO_FINGERPRINT}


class RepeatedData:
    """How often a sensor's data were those of its frame before, by sensor, over the frames of a recording."""

    def __init__(self) -> None:
        self.counts: Counter[int] = Counter()
        self._last: dict[int, int] = {}

    def add(self, prints: Mapping[int, int]) -> None:
        """Take the fingerprints of the next frame."""
        self.counts.update(sensor for sensor, known in prints.items() if self._last.get(sensor) == known)
        self._last.update(prints)


def fingerprint_of_image(pixels: NDArray[np.uint8]) -> int:
    """CRC-32 of an image's pixels: equal for equal data, and hardly ever otherwise.

    A picture that is white all over has none: it is dazzled, and that it does not change tells nothing.
    """
    return zlib.crc32(np.ascontiguousarray(pixels).data) if pixels.min() < _WHITE else NO_FINGERPRINT


def fingerprint_of_points(xyz_m: NDArray[np.float32]) -> int:
    """CRC-32 of a cloud's points (M, 3)."""
    return zlib.crc32(np.ascontiguousarray(xyz_m).data)


@dataclass(frozen=True, eq=False)
class FeatureInputs:
    """What fault features are made of, of this frame or of the one before.

    `half_res` are its half-resolution grey images by camera. By reference: `points` (P, 2) to be followed and
    `isolated_shares`. By matched pair: stereo's disparities at the points, in half-resolution pixels, and, where the
    pair can check the LiDAR, `comparisons` with it.
    """

    half_res: Mapping[int, Image]
    points: Mapping[int, Points] = field(default_factory=dict)
    isolated_shares: Mapping[int, IsolatedShares] = field(default_factory=dict)
    disparities_px: Mapping[Pair, Floats32] = field(default_factory=dict)
    comparisons: Mapping[Pair, LidarComparison] = field(default_factory=dict)


def feature_inputs(arrays: FrameArrays) -> FeatureInputs:
    """The inputs of the pairs that were matched in one view."""
    half_res, maps, views = arrays.views, arrays.maps, arrays.lidar
    consistencies, rig = arrays.frame_checks.consistencies, arrays.rig
    points = {k: corners(half_res[k], arrays.valid_masks.get(k)) for k in dict.fromkeys(k for _, k in maps)}
    return FeatureInputs(
        half_res,
        points,
        arrays.frame_checks.isolated_shares,
        {(i, k): _at(maps[i, k], points[k]) for i, k in maps},
        {
            (j, k): LidarComparison.of(views[k], stereo, consistencies[j, k], j)
            for (j, k), stereo in maps.items()
            if k in views and resolves_depth(rig, j, k)
        },
    )


def fault_features_of(now: FeatureInputs, before: FeatureInputs | None) -> dict[Pair, PairFaultFeatures]:
    """The fault features of a frame by matched pair (i, k), given the frame before it."""
    rows = register(now.points, now.half_res, before.half_res if before else {}, now.disparities_px)
    earlier = before.comparisons if before else {}
    agreements = {pair: agreement(comparison, earlier.get(pair)) for pair, comparison in now.comparisons.items()}
    return {
        pair: PairFaultFeatures(
            rows.get(pair, RowMatches()),
            agreements.get(pair, Agreement()),
            now.isolated_shares[pair[1]] if pair in now.comparisons else IsolatedShares(),
        )
        for pair in now.disparities_px
    }


class FaultFeatures:
    """The fault features of the frames of one recording, in their order; each pair with its own view by itself."""

    def __init__(self) -> None:
        self._pairs: Mapping[Pair, FaultFeatures] = {}
        self._before: FeatureInputs | None = None

    def update(self, arrays: FrameArrays) -> dict[Pair, PairFaultFeatures]:
        """The fault features of the next frame by matched pair (i, k)."""
        if arrays.pairs:
            # A pair that the frame before lacks begins anew.
            self._pairs = {pair: self._pairs.get(pair, FaultFeatures()) for pair in arrays.pairs}
            return {pair: self._pairs[pair].update(part.own)[OF_TWO] for pair, part in arrays.pairs.items()}
        now = feature_inputs(arrays)
        features = fault_features_of(now, self._before)
        self._before = now
        return features


def _at(stereo: StereoMap, points: Floats32) -> Floats32:
    """The disparities of half-resolution points, in half-resolution pixels."""
    step = HALF // stereo.step
    column, row = points.astype(np.intp).T * step
    return np.asarray(stereo.disparity_px[row, column] / np.float32(HALF))
