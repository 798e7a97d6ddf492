"""Normalised scores z: how far a statistic lies above its threshold theta, in units that all checks share."""

from collections.abc import Mapping, Sequence
from decimal import Decimal

import numpy as np

from auditor.identification.parameters import CHECK_SCALE, FAULT_SCALE, THETA_CEILING, THETA_FLOOR
from auditor.identification.thresholds import resolvable, threshold
from auditor.model.arrays import Floats
from auditor.model.calibration import HIGHEST_SCORE, LOWEST_SCORE, RobustThresholds, Scale
from auditor.model.checks import Check, PairCheck
from auditor.model.verdict import CauseIn

CEILINGS: Mapping[Check, float] = {
    Check.LIDAR_CONFLICT: THETA_CEILING.lidar_conflict,
    Check.PHOTOMETRIC_INCONSISTENCY: THETA_CEILING.photometric,
    Check.BRIGHTNESS_DIFFERENCE: THETA_CEILING.brightness,
    Check.POINT_DROPOUT: THETA_CEILING.point_dropout,
    Check.ISOLATED_POINTS: THETA_CEILING.isolated_points,
}
"""theta is never larger: attacked frames among the clean ones must not switch a check off.

The LiDAR's own checks have no ceiling: some LiDARs never fill the view, and of some all points lie far apart.
"""


FLOORS: Mapping[Check, float] = {
    Check.LIDAR_CONFLICT: THETA_FLOOR.lidar_conflict,
    Check.PHOTOMETRIC_INCONSISTENCY: THETA_FLOOR.photometric,
    Check.BRIGHTNESS_DIFFERENCE: THETA_FLOOR.brightness,
    Check.POINT_DROPOUT: THETA_FLOOR.point_dropout,
    Check.ISOLATED_POINTS: THETA_FLOOR.isolated_points,
}
"""theta is never smaller: a few easy drives must not make the thresholds of all others."""


def scale_of(check: Check, samples: Sequence[float], r: Decimal) -> Scale:
    """Theta and scale of a check at r, from N clean statistics in ascending order.

    A tenth of what is left to 1 is added to the quantile, so that theta holds for other drives too; then it is kept
    between the check's floor and its ceiling. Raises ThresholdsError where N = 0, SettingError for an r outside 0 to 1.
    """
    quantile = threshold(samples, r)
    theta = min(max(quantile + CHECK_SCALE.added_share * (1 - quantile), FLOORS[check]), CEILINGS[check])
    spread = float(np.quantile(samples, CHECK_SCALE.spread_quantile) - np.median(samples))
    return Scale(theta, max(spread, CHECK_SCALE.smallest_scale * theta), len(samples))


def fault_scale(samples: Sequence[float], r: Decimal) -> Scale:
    """Theta and scale of a fault at r, from N clean fault scores in ascending order; theta is at least 1, just enough.

    A quarter of the quantile is added to it. An r above 1 % counts as 1 %: a fault is a finding by itself, and no other
    check has to agree. The scale is a quarter of theta: a fault score of 1.75 theta has the largest z. There is no
    ceiling: a tilt or a row bias that a rig has always had is no fault. Raises ThresholdsError where N = 0,
    SettingError for an r outside 0 to 1.
    """
    quantile = threshold(samples, min(r, FAULT_SCALE.largest_r))
    theta = max((1 + FAULT_SCALE.added_share) * quantile, FAULT_SCALE.least_theta)
    return Scale(theta, FAULT_SCALE.scale * theta, len(samples))


def fault_scales(samples: Mapping[CauseIn, Sequence[float]], r: Decimal) -> dict[CauseIn, Scale]:
    """The scale of each fault that was measured in clean frames."""
    return {key: fault_scale(values, r) for key, values in samples.items() if values}


def scales_of(ratios: Floats, pair_checks: Sequence[PairCheck], r: Decimal) -> tuple[Scale | None, ...]:
    """The scale of each pair check from (F, M) clean statistics, NaN where not measured; None where none was."""
    columns = [np.sort(column[~np.isnan(column)]) for column in ratios.T]
    return tuple(
        scale_of(pair_check.check, column.tolist(), r) if column.size else None
        for pair_check, column in zip(pair_checks, columns, strict=True)
    )


def thresholds_from(
    ratios: Floats,
    clean_fault_scores: Mapping[CauseIn, Sequence[float]],
    pair_checks: Sequence[PairCheck],
    r: Decimal,
    calibration_id: str = "",
) -> RobustThresholds:
    """Thresholds at r from (F, M) clean statistics, NaN where not measured, and ascending fault scores by fault.

    Pair checks and faults without samples have none. The threshold of the window's score is 0.
    """
    scales = zip(pair_checks, scales_of(ratios, pair_checks, r), strict=True)
    known = {pair_check: scale for pair_check, scale in scales if scale is not None}
    return RobustThresholds(
        calibration_id=calibration_id,
        r=r,
        scales_of=known,
        causes=fault_scales(clean_fault_scores, r),
        resolvable=all(resolvable(r, scale.samples) for scale in known.values()),
    )


def normalised_scores(statistics: Floats, scales: Sequence[Scale | None]) -> Floats:
    """(F, M) normalised scores z = (x - theta) / scale, clipped to -2 .. 3; above zero a check fires.

    `statistics` x are (F, M), NaN where not measured; z is NaN there, and where there is no scale.
    """
    theta = np.array([np.nan if one is None else one.theta for one in scales], dtype=np.float64)
    scale = np.array([np.nan if one is None else one.scale for one in scales], dtype=np.float64)
    return np.asarray(np.clip((statistics - theta) / scale, LOWEST_SCORE, HIGHEST_SCORE))


def candidates(pair_checks: Sequence[PairCheck], ratios: Sequence[float | None]) -> list[PairCheck]:
    """The pair checks that may exceed theta: their statistic lies above its floor. None is not measured."""
    pairs = zip(pair_checks, ratios, strict=True)
    return [pair_check for pair_check, ratio in pairs if ratio is not None and ratio > FLOORS[pair_check.check]]
