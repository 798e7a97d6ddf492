"""The checks of the robust method: which of them exist for a rig; and the fault features of a frame.

Fault features separate faults from attacks; they are measured with every frame, so that judging needs no images.
"""

from collections.abc import Collection, Iterable
from enum import StrEnum
from itertools import combinations
from math import nan
from typing import NamedTuple, TypeVar

from auditor.model.arrays import Floats
from auditor.model.parameters import PAIR_DEPTH, POINT_EXCESS
from auditor.model.rig import LIDAR, Rig


class Check(StrEnum):
    """One kind of statistic; there are five.

    LIDAR_CONFLICT: two cameras agree with each other and not with the LiDAR. PHOTOMETRIC_INCONSISTENCY: two cameras do
    not see the same. BRIGHTNESS_DIFFERENCE: one of two cameras alone sees light or darkness. POINT_DROPOUT: a strip of
    the LiDAR's view lacks points. ISOLATED_POINTS: LiDAR points have next to no neighbours.
    """

    LIDAR_CONFLICT = "lidar_conflict"
    PHOTOMETRIC_INCONSISTENCY = "photometric_inconsistency"
    BRIGHTNESS_DIFFERENCE = "brightness_difference"
    POINT_DROPOUT = "point_dropout"
    ISOLATED_POINTS = "isolated_points"


LIDAR_CHECKS = frozenset({Check.POINT_DROPOUT, Check.ISOLATED_POINTS})
"""The checks of the LiDAR alone, in the view of a camera."""


class PairCheck(NamedTuple):
    """One check of the camera pair i < k; one of LIDAR_CHECKS has i = 0, the LiDAR, and is of the view of k."""

    check: Check
    i: int
    k: int

    @property
    def needed(self) -> tuple[int, ...]:
        """The sensors without which it cannot be measured."""
        return (LIDAR, self.i, self.k) if self.check is Check.LIDAR_CONFLICT else (self.i, self.k)

    @property
    def nameable(self) -> tuple[int, ...]:
        """The sensors one of which must be attacked where the check fires."""
        return (LIDAR,) if self.check in LIDAR_CHECKS else self.needed


def pair_checks_of(
    cameras: int,
    matched: Iterable[tuple[int, int]],
    lidar_conflict_pairs: Iterable[tuple[int, int]],
    views: Collection[int],
) -> tuple[PairCheck, ...]:
    """All pair checks in their fixed order.

    They are LiDAR conflicts of `lidar_conflict_pairs`, photometric inconsistencies of the pairs `matched`, brightness
    differences of all pairs, and the LiDAR's own checks in `views`: the reference cameras that it is projected into.
    """
    return (
        *(PairCheck(Check.LIDAR_CONFLICT, i, k) for i, k in lidar_conflict_pairs),
        *(PairCheck(Check.PHOTOMETRIC_INCONSISTENCY, i, k) for i, k in matched),
        *(PairCheck(Check.BRIGHTNESS_DIFFERENCE, i, k) for i, k in combinations(range(1, cameras + 1), 2)),
        *(PairCheck(Check.POINT_DROPOUT, LIDAR, k) for k in views),
        *(PairCheck(Check.ISOLATED_POINTS, LIDAR, k) for k in views),
    )


def rig_pair_checks(rig: Rig) -> tuple[PairCheck, ...]:
    """The pair checks that frames of a rig are judged by; those that only the fallback brings are the last.

    So stored lists of before there was a fallback are the beginning of today's.
    """
    if rig.fallback is None:
        return usual_pair_checks(rig)
    _, j, k = rig.fallback
    return (*usual_pair_checks(rig), *pair_checks_of(0, [(j, k)], _checking_lidar(rig, [(j, k)]), [k]))


def usual_pair_checks(rig: Rig) -> tuple[PairCheck, ...]:
    """The pair checks of a rig without those that only the fallback brings."""
    pairs = rig.required_pairs
    return pair_checks_of(rig.n, pairs, _checking_lidar(rig, pairs), rig.references if rig.lidar else ())


def _checking_lidar(rig: Rig, pairs: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
    return [pair for pair in pairs if rig.lidar and resolves_depth(rig, *pair)]


def resolves_depth(rig: Rig, j: int, k: int) -> bool:
    """Whether the pair's disparities resolve depth well enough to check the LiDAR.

    A pair that resolves less cannot tell a surface from one half as far again.
    """
    # Cameras of different focal lengths are compared at the shortest of those that share a view.
    cameras = rig.cameras if rig.shares_view else (rig.camera(j), rig.camera(k))
    focal_px = min(camera.focal_px for camera in cameras)
    return focal_px * rig.baseline_m(j, k) / PAIR_DEPTH.distance_m >= PAIR_DEPTH.fewest_px


Pair = tuple[int, int]


class Rows(NamedTuple):
    """Points of reference k that are found in source camera i, and their rows: shares of `tracked` points.

    `row_aligned`: on the same row within 1 px. `offset_px` is the median of rows in i minus rows in k, `offset_share`
    the share within 1 px of it: a camera that is tilted moves all rows by one offset. `lagged_i`, `lagged_k`: the share
    on the same row if that camera's image belongs to the frame before. NaN where it could not be measured.
    """

    tracked: float = nan
    row_aligned: float = nan
    offset_px: float = nan
    offset_share: float = nan
    lagged_i: float = nan
    lagged_k: float = nan


class Contrast(NamedTuple):
    """How much brighter k is than i at inconsistent pixels: the median in grey levels, less that at consistent ones.

    `inconsistent_px` counts half-resolution pixels; `difference` is NaN where there are too few.
    """

    inconsistent_px: float = nan
    difference: float = nan


class Agreement(NamedTuple):
    """LiDAR points and stereo's disparities: shares of `compared` points that agree within 1 px.

    `agreeing`: as they are. `biased`: with one constant of `bias_px` added to them all. `rotated`: with all points
    moved by `right_px` or `down_px` in the reference's image, the move by which most agree. The rest are numbers of
    points that agree in one of two cases and are off by more than 2 px in the other: `rotated_only` moved,
    `unrotated_only` as they are; `before_only` with stereo of the frame before, `now_only` with that of their own.
    NaN where it could not be measured.
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


Number = TypeVar("Number", float, Floats)


def relative_excess(these: Number, others: Number) -> Number:
    """By what share of both these points exceed the others, from -1 to 1; it is small where both are few."""
    return (these - others) / (these + others + POINT_EXCESS.pseudo_count)


class IsolatedShares(NamedTuple):
    """Isolated LiDAR points in the view of k: shares of all its points, 0 to 1.

    `isolated_near`: of those nearer than 8 m, the lower quartile over the parts of the view. `isolated_beyond`: of
    those 8 to 40 m away. NaN where it could not be measured.
    """

    isolated_near: float = nan
    isolated_beyond: float = nan


class PairFaultFeatures(NamedTuple):
    """The fault features of a matched pair (i, k) in one frame; those of the LiDAR where the pair can check it."""

    rows: Rows = Rows()
    contrast: Contrast = Contrast()
    agreement: Agreement = Agreement()
    isolated_shares: IsolatedShares = IsolatedShares()

    @property
    def values(self) -> tuple[float, ...]:
        """All numbers in the order of COLUMNS."""
        return (*self.rows, *self.contrast, *self.agreement, *self.isolated_shares)


COLUMNS = (*Rows._fields, *Contrast._fields, *Agreement._fields, *IsolatedShares._fields)
OF_LIDAR = frozenset((*Agreement._fields, *IsolatedShares._fields))
"""The columns that are measured with the LiDAR."""
