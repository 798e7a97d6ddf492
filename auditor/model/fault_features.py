"""Fault features: what separates faults from attacks; measured with every frame, so that judging needs no images."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import nan
from typing import NamedTuple, TypeVar

import numpy as np

from auditor.model.arrays import Floats
from auditor.model.checks import Pair
from auditor.model.parameters import POINT_EXCESS


class RowMatches(NamedTuple):
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
    those 8 to 40 m away, less a plume's. NaN where it could not be measured.
    """

    isolated_near: float = nan
    isolated_beyond: float = nan


class PairFaultFeatures(NamedTuple):
    """The fault features of a matched pair (i, k) in one frame; those of the LiDAR where the pair can check it."""

    rows: RowMatches = RowMatches()
    agreement: Agreement = Agreement()
    isolated_shares: IsolatedShares = IsolatedShares()

    @property
    def values(self) -> tuple[float, ...]:
        """The numbers that are kept, in the order of COLUMNS."""
        every = (*self.rows, *self.agreement, *self.isolated_shares)
        return tuple(value for name, value in zip(_MEASURED, every, strict=True) if name not in _NOT_JUDGED)


_MEASURED = (*RowMatches._fields, *Agreement._fields, *IsolatedShares._fields)
_NOT_JUDGED = frozenset({"tracked", "compared", "right_px", "down_px", "isolated_beyond"})

COLUMNS = tuple(name for name in _MEASURED if name not in _NOT_JUDGED)
"""The fault features that are kept, and that fault scores are made of."""

OF_LIDAR = frozenset((*Agreement._fields, *IsolatedShares._fields))
"""Those that are measured with the LiDAR."""


@dataclass(frozen=True, eq=False)
class ObservedFeatures:
    """The fault features of F measured frames: `columns` holds (F, P) values by the names of COLUMNS.

    `pairs` are the P matched pairs (i, k). `brightness` holds (F, C) values by the names of BRIGHTNESS for the
    `cameras`. NaN where not measured.
    """

    pairs: tuple[Pair, ...]
    columns: Mapping[str, Floats]
    cameras: tuple[int, ...]
    brightness: Mapping[str, Floats]

    @property
    def agreeing(self) -> Floats:
        """(F,) the share of the LiDAR's points that agree with the pair of cameras that most agree with."""
        return np.asarray(np.fmax.reduce(self.columns["agreeing"], axis=1, initial=nan))

    @property
    def by_camera(self) -> dict[tuple[str, int], Floats]:
        """(F,) values of the brightness by name and camera."""
        return {
            (name, camera): column
            for name, values in self.brightness.items()
            for camera, column in zip(self.cameras, values.T, strict=True)
        }
