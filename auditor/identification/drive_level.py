"""The level of the drive that is judged: how far its own frames may say what is usual of it.

The level of a check in a drive is a random effect: the drive's own, which all cameras of one group share, and the
sensor's own beside it. Frames of the drive show their sum. They are believed where clean drives have such a sum.
Where they have not, an attack may have lasted: then the other cameras of the group say what the drive is like, or
the prior does where there are none. So a lasting attack on some sensors never becomes usual.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from math import inf, pi, sqrt
from statistics import NormalDist
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from auditor.identification.evidence_parameters import DRIVE_LEVEL
from auditor.identification.parameters import HIERARCHY
from auditor.identification.prior import effective_size, log_odds, prior_of_check
from auditor.identification.scores import normalised_scores
from auditor.identification.statistics import stretch_medians
from auditor.model.arrays import Floats, Integers, quantile_of
from auditor.model.calibration import CleanFrames, NullDistribution, RobustThresholds
from auditor.model.checks import Check, SensorCheck
from auditor.model.checks.kind import Of
from auditor.model.rig import LIDAR

_OF_MEDIAN = pi / 2
"""Times the variance of a mean, that of a median of what is normally distributed."""

_QUARTILE = NormalDist().inv_cdf(1 - DRIVE_LEVEL.quiet_share)
"""Deviations that the quietest quarter of what is normally distributed lies below the mean."""


class OwnLevel(NamedTuple):
    """The level of a check in the drive that is judged, and how many independent frames its values are worth.

    `quarter` is what its quietest quarter of frames does not exceed.
    """

    level: float
    worth: float
    quarter: float = -inf


def for_drive(
    thresholds: RobustThresholds, sensor_checks: Sequence[SensorCheck], statistics: Floats, stamps_ns: Integers
) -> RobustThresholds:
    """The thresholds for the drive that is judged: what is expected of its own frames, and of attacked copies of them.

    Its `statistics` are (F, M), those of frames at `stamps_ns` (F,).
    """
    told = _without_thinned(thresholds, sensor_checks, statistics)
    return _with_own(thresholds, _own_levels(sensor_checks, told, stamps_ns))


def _without_thinned(thresholds: RobustThresholds, sensor_checks: Sequence[SensorCheck], statistics: Floats) -> Floats:
    """The statistics (F, M), NaN in frames in which the LiDAR lacks points for all that is said of those it has.

    It does in no clean frame, by what is expected without the drive's level. Little is compared there, and conflicts.
    """
    dropout = np.array([check.check is Check.POINT_DROPOUT for check in sensor_checks])
    others = np.array([check.sensor == LIDAR for check in sensor_checks]) & ~dropout
    z = normalised_scores(statistics, [thresholds.expected.get(check) for check in sensor_checks])
    thinned = np.asarray(z[:, dropout] > thresholds.limit).any(axis=1, keepdims=True)
    return np.asarray(np.where(thinned & others, np.nan, statistics))


_OWN_LEVELS: WeakKeyDictionary[CleanFrames, dict[SensorCheck, OwnLevel | None]] = WeakKeyDictionary()
"""By drive: its own level of each check, so that it is judged by many thresholds without being looked at again."""


def for_clean_drive(
    thresholds: RobustThresholds, sensor_checks: Sequence[SensorCheck], drive: CleanFrames
) -> RobustThresholds:
    """As `for_drive`, for a recording that is judged by many thresholds."""
    levels = _OWN_LEVELS.setdefault(drive, {})
    if missing := [check for check in sensor_checks if check not in levels]:
        levels.update(_own_levels(missing, drive.statistics_of(missing), drive.stamps_ns))
    return _with_own(thresholds, {check: levels[check] for check in sensor_checks})


def _own_levels(
    sensor_checks: Sequence[SensorCheck], statistics: Floats, stamps_ns: Integers
) -> dict[SensorCheck, OwnLevel | None]:
    columns = log_odds(statistics).T
    return dict(zip(sensor_checks, map(own_level, columns, stretch_medians(columns, stamps_ns)), strict=True))


def _with_own(thresholds: RobustThresholds, levels: Mapping[SensorCheck, OwnLevel | None]) -> RobustThresholds:
    """Thresholds that know a drive's own levels."""
    offsets = {
        check: own.level - thresholds.expected[check].mean
        for check, own in levels.items()
        if own is not None and check in thresholds.expected
    }
    expected = {
        check: of_drive(
            usual, levels.get(check), thresholds.limit, prior_of_check(check).tail, group_of(check, offsets)
        )
        for check, usual in thresholds.expected.items()
    }
    return replace(thresholds, expected=expected)


def own_level(values: Floats, of_stretches: Floats) -> OwnLevel | None:
    """The level of the drive that is judged, whose values are (F,), NaN where not measured; None without any.

    `of_stretches` (P,) are the medians of those of its stretches of road in which some were measured. Beside leaves or
    water a check shows more for seconds than most of the road, so the level is that of the busier stretches.
    """
    measured = values[~np.isnan(values)]
    if not measured.size:
        return None
    quarter = quantile_of(np.sort(measured), DRIVE_LEVEL.quiet_share)
    return OwnLevel(quantile_of(np.sort(of_stretches), HIERARCHY.of_stretches), effective_size(measured), quarter)


def group_of(check: SensorCheck, offsets: Mapping[SensorCheck, float]) -> float | None:
    """What the other cameras that a check compares show by the same check, less what was expected of them.

    None of the LiDAR, and where none does. It is the lower median of their `offsets`, each by all others of the group:
    attacks only raise levels, and the attacked cameras are fewer. A group that lies below what was expected says
    nothing: what is added to one camera is missing to the others.
    """
    others = sorted(offsets[other] for other in _others_of(check) if other in offsets)
    return max(others[(len(others) - 1) // 2], 0.0) if others else None


@cache
def _others_of(check: SensorCheck) -> tuple[SensorCheck, ...]:
    """The same check of each other camera of its group."""
    if check.check.kind.of is not Of.CAMERAS:
        return ()
    group = {check.sensor, *check.others}
    return tuple(SensorCheck(check.check, other, tuple(sorted(group - {other}))) for other in check.others)


def of_drive(
    usual: NullDistribution, own: OwnLevel | None, limit: float, tail: float = 1.0, group: float | None = None
) -> NullDistribution:
    """What is expected of the frames of the drive that is judged.

    Its level shows the drive's own mean, and the deviation between drives goes as far as that is known; not wholly,
    since its later scenes may differ as drives do. A level that lies farther above the group than clean drives do, or
    without a group above the mean, says nothing. Then the quietest quarter of the frames says it, if theirs does not:
    most of the drive may be attacked. Else the deviation is that of the group, or that between drives. What lies
    `limit` deviations above the mean, a finding, is never farther away than without the drive's frames.
    """
    if own is None or limit <= 0:
        return usual
    offset, spread = (0.0, usual.between / tail) if group is None else (group, DRIVE_LEVEL.beside)
    farthest = usual.mean + offset + DRIVE_LEVEL.farthest * spread
    if own.level > farthest:
        quiet = own.quarter + _QUARTILE * usual.within / tail
        own = OwnLevel(quiet, max(DRIVE_LEVEL.quiet_share * own.worth, 1.0))
    if not -inf < own.level <= farthest:
        if group is None:
            return usual
        of_group = sqrt(usual.within**2 + (tail * spread) ** 2)
        return _no_farther(usual, usual.mean + offset, min(of_group, usual.deviation), limit)
    between = usual.between**2
    of_median = _OF_MEDIAN * usual.within**2 / own.worth
    learnt = between / (between + of_median)
    deviation = sqrt(usual.within**2 + (1 - HIERARCHY.most_learnt * learnt) * between)
    return _no_farther(usual, usual.mean + learnt * (own.level - usual.mean), deviation, limit)


def _no_farther(usual: NullDistribution, mean: float, deviation: float, limit: float) -> NullDistribution:
    """Another mean and deviation, by which no more is needed for a finding than is usual."""
    return replace(usual, mean=min(mean, usual.mean + limit * (usual.deviation - deviation)), deviation=deviation)
