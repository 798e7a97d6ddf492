"""What the robust method hears of a rig and of a frame: which checks exist for a rig, and fault features.

Fault features tell a fault from an attack; they are measured with every frame so that judging needs no images.
"""

from collections.abc import Iterable
from enum import StrEnum
from itertools import combinations
from math import nan
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from auditor.model.parameters import PAIR_DEPTH, POINT_LEAD
from auditor.model.rig import LIDAR, Rig


class Check(StrEnum):
    """One kind of statistic; its values are the names that the store keeps.

    LIDAR_CONFLICT: both cameras of a pair disagree with the LiDAR. PHOTOMETRIC_INCONSISTENCY, BRIGHTNESS_DIFFERENCE:
    the two cameras do not see the same. POINT_DROPOUT: a strip of the LiDAR's view has no points. ISOLATED_POINTS:
    points have next to no neighbours.
    """

    LIDAR_CONFLICT = "lidar_conflict"
    PHOTOMETRIC_INCONSISTENCY = "photometric_inconsistency"
    BRIGHTNESS_DIFFERENCE = "brightness_difference"
    POINT_DROPOUT = "point_dropout"
    ISOLATED_POINTS = "isolated_points"


LIDAR_CHECKS = frozenset({Check.POINT_DROPOUT, Check.ISOLATED_POINTS})
"""Of the LiDAR's view in a camera, whatever the cameras see."""


class PairCheck(NamedTuple):
    """One witness's statistic of the camera pair i < k; of OF_THE_LIDAR, whose i is the LiDAR, of the view of k."""

    check: Check
    i: int
    k: int

    @property
    def needed(self) -> tuple[int, ...]:
        """The sensors without which it cannot be measured."""
        return (LIDAR, self.i, self.k) if self.check is Check.LIDAR_CONFLICT else (self.i, self.k)

    @property
    def nameable(self) -> tuple[int, ...]:
        """The sensors one of which must be attacked where the element is raised."""
        return (LIDAR,) if self.check in LIDAR_CHECKS else self.needed


def pair_checks_of(
    cameras: int,
    matched: Iterable[tuple[int, int]],
    lidar_conflict_pairs: Iterable[tuple[int, int]],
    views: Iterable[int],
) -> tuple[PairCheck, ...]:
    """All elements in fixed order: pairs that may deny the LiDAR, pairs matched, every pair's light, the LiDAR's views.

    `views` are the reference cameras that the LiDAR is projected into; none without one.
    """
    return (
        *(PairCheck(Check.LIDAR_CONFLICT, i, k) for i, k in lidar_conflict_pairs),
        *(PairCheck(Check.PHOTOMETRIC_INCONSISTENCY, i, k) for i, k in matched),
        *(PairCheck(Check.BRIGHTNESS_DIFFERENCE, i, k) for i, k in combinations(range(1, cameras + 1), 2)),
        *(PairCheck(Check.POINT_DROPOUT, LIDAR, k) for k in views),
        *(PairCheck(Check.ISOLATED_POINTS, LIDAR, k) for k in views),
    )


def rig_pair_checks(rig: Rig) -> tuple[PairCheck, ...]:
    """The elements that frames of a rig are judged by."""
    lidar_conflict_pairs = [pair for pair in rig.pairs if rig.lidar and resolves_depth(rig, *pair)]
    return pair_checks_of(rig.n, rig.pairs, lidar_conflict_pairs, rig.references if rig.lidar else ())


def resolves_depth(rig: Rig, j: int, k: int) -> bool:
    """Whether the pair's disparities say enough about depth to deny what the LiDAR says.

    A pair that resolves less cannot tell a surface from one half as far again.
    """
    # Cameras of different focal lengths are compared at the shortest of those that share a view.
    cameras = rig.cameras if rig.shares_view else (rig.camera(j), rig.camera(k))
    focal_px = min(camera.focal_px for camera in cameras)
    return focal_px * rig.baseline_m(j, k) / PAIR_DEPTH.distance_m >= PAIR_DEPTH.fewest_px


Pair = tuple[int, int]


class Rows(NamedTuple):
    """Points of reference k found again in camera i, and what becomes of their rows: shares of `tracked` points.

    `row_aligned`: on the same row within 1 px. `offset_px` is the median of rows in i minus rows in k, `offset_share`
    the share within 1 px of it: a camera that has tilted moves all rows alike. `lagged_i`, `lagged_k`: the share on the
    same row once that camera's picture is taken for one of the frame before. NaN where it could not be measured.
    """

    tracked: float = nan
    row_aligned: float = nan
    offset_px: float = nan
    offset_share: float = nan
    lagged_i: float = nan
    lagged_k: float = nan


class Contrast(NamedTuple):
    """How much brighter k is than i where they are unlike: the median in grey levels, less that where they are alike.

    `inconsistent_px` counts half-resolution pixels; `difference` is NaN where they are hardly any.
    """

    inconsistent_px: float = nan
    difference: float = nan


class Agreement(NamedTuple):
    """LiDAR points against stereo's disparities: shares of `compared` points that agree within 1 px.

    `agreeing`: as they are. `biased`: with one constant of `bias_px` added to them all. `rotated`: with all points
    moved by `right_px` or `down_px` in the reference's image, as far as speaks most for that. The rest are numbers of
    points that agree in one of two cases and are off by more than 2 px in the other: `rotated_only` moved,
    `unrotated_only` as they are; `before_only` with stereo of the frame before, `now_only` with that of their own. NaN
    where it could not be measured.
    """

    compared: float = nan
    agreeing: float = nan
    bias_px: float = nan
    biased: float = nan
    right_px: float = nan
    down_px: float = nan
    rotated: float = nan
    rotated_only: float = nan
    unrotated_only: float = nan
    before_only: float = nan
    now_only: float = nan


Number = TypeVar("Number", float, NDArray[np.float64])


def lead(these: Number, others: Number) -> Number:
    """By what share of both these points are more, from -1 to 1; few prove little."""
    return (these - others) / (these + others + POINT_LEAD.pseudo_count)


class IsolatedShares(NamedTuple):
    """LiDAR points that stand alone in the view of k: shares of all its points, 0 to 1.

    `isolated_near`: of those nearer than 8 m, in all but the barest quarter of the view's parts. `isolated_beyond`: of
    those 8 to 40 m away. NaN where it could not be measured.
    """

    isolated_near: float = nan
    isolated_beyond: float = nan


class PairFaultFeatures(NamedTuple):
    """The symptoms of a matched pair (i, k) in one frame; of the LiDAR only where the pair may deny it."""

    rows: Rows = Rows()
    contrast: Contrast = Contrast()
    agreement: Agreement = Agreement()
    isolated_shares: IsolatedShares = IsolatedShares()

    @property
    def values(self) -> tuple[float, ...]:
        """All numbers in the order of COLUMNS."""
        return (*self.rows, *self.contrast, *self.agreement, *self.isolated_shares)


COLUMNS = (*Rows._fields, *Contrast._fields, *Agreement._fields, *IsolatedShares._fields)
