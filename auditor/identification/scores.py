"""Normalised scores z: how far a windowed ratio lies above its threshold, in units that all checks share."""

from collections.abc import Mapping, Sequence
from decimal import Decimal

import numpy as np
from numpy.typing import NDArray

from auditor.identification.parameters import CHECK_SCALE, FAULT_SCALE, THETA_CEILING, THETA_FLOOR
from auditor.identification.thresholds import resolvable, threshold
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
"""theta is never larger: attacked frames among the clean ones must not silence a witness.

Only a LiDAR that never fills the view, or whose points always lie far apart, may silence its own.
"""


FLOORS: Mapping[Check, float] = {
    Check.LIDAR_CONFLICT: THETA_FLOOR.lidar_conflict,
    Check.PHOTOMETRIC_INCONSISTENCY: THETA_FLOOR.photometric,
    Check.BRIGHTNESS_DIFFERENCE: THETA_FLOOR.brightness,
    Check.POINT_DROPOUT: THETA_FLOOR.point_dropout,
    Check.ISOLATED_POINTS: THETA_FLOOR.isolated_points,
}
"""theta is never smaller: a few easy drives must not make the thresholds of all others."""


Floats = NDArray[np.float64]


def scale_of(check: Check, samples: Sequence[float], r: Decimal) -> Scale:
    """Take theta at r from N clean local ratios in ascending order, and add what carries it to other drives.

    A tenth of what is left to 1 is added; then theta is kept between the witness's floor and its ceiling. Raises
    ThresholdsError where N = 0, SettingError for an r outside 0 to 1.
    """
    quantile = threshold(samples, r)
    theta = min(max(quantile + CHECK_SCALE.margin * (1 - quantile), FLOORS[check]), CEILINGS[check])
    spread = float(np.quantile(samples, CHECK_SCALE.spread_quantile) - np.median(samples))
    return Scale(theta, max(spread, CHECK_SCALE.smallest_scale * theta), len(samples))


def fault_scale(samples: Sequence[float], r: Decimal) -> Scale:
    """Take theta of a cause at r from N clean strengths in ascending order, and a quarter more; at least just enough.

    No r above 1 % is taken: a fault is a finding by itself, and no other witness has to agree. The scale is a quarter
    of theta: a strength of 1.75 theta has the largest margin. There is no ceiling: a tilt or a row bias that a rig has
    always had is its own. Raises ThresholdsError where N = 0, SettingError for an r outside 0 to 1.
    """
    theta = max((1 + FAULT_SCALE.margin) * threshold(samples, min(r, FAULT_SCALE.largest_r)), FAULT_SCALE.least_theta)
    return Scale(theta, FAULT_SCALE.scale * theta, len(samples))


def fault_scales(samples: Mapping[CauseIn, Sequence[float]], r: Decimal) -> dict[CauseIn, Scale]:
    """One yardstick a cause that was measured in clean frames."""
    return {key: fault_scale(values, r) for key, values in samples.items() if values}


def scales_of(ratios: Floats, pair_checks: Sequence[PairCheck], r: Decimal) -> tuple[Scale | None, ...]:
    """One yardstick an element from (F, M) clean local ratios, NaN where not measured; None where none was."""
    columns = [np.sort(column[~np.isnan(column)]) for column in ratios.T]
    return tuple(
        scale_of(pair_check.check, column.tolist(), r) if column.size else None
        for pair_check, column in zip(pair_checks, columns, strict=True)
    )


def thresholds_from(
    ratios: Floats,
    strengths: Mapping[CauseIn, Sequence[float]],
    pair_checks: Sequence[PairCheck],
    r: Decimal,
    calibration_id: str = "",
) -> RobustThresholds:
    """Thresholds at r from (F, M) clean local ratios, NaN where not measured, and ascending strengths by cause.

    Elements and causes without samples have none. The threshold of the half seconds' score is 0.
    """
    scales = zip(pair_checks, scales_of(ratios, pair_checks, r), strict=True)
    known = {pair_check: scale for pair_check, scale in scales if scale is not None}
    return RobustThresholds(
        calibration_id=calibration_id,
        r=r,
        scales_of=known,
        causes=fault_scales(strengths, r),
        resolvable=all(resolvable(r, scale.samples) for scale in known.values()),
    )


def scores(ratios: Floats, scales: Sequence[Scale | None]) -> Floats:
    """(F, M) margins z = (x - theta) / scale, clipped to -2 .. 3: above zero an element is raised.

    `ratios` are (F, M) local ratios; NaN where not measured or without a yardstick.
    """
    theta = np.array([np.nan if y is None else y.theta for y in scales], dtype=np.float64)
    scale = np.array([np.nan if y is None else y.scale for y in scales], dtype=np.float64)
    return np.asarray(np.clip((ratios - theta) / scale, LOWEST_SCORE, HIGHEST_SCORE))


def candidates(pair_checks: Sequence[PairCheck], ratios: Sequence[float | None]) -> list[PairCheck]:
    """The elements whose local ratio lies above the floor of their witness's thresholds; None is not measured."""
    pairs = zip(pair_checks, ratios, strict=True)
    return [pair_check for pair_check, ratio in pairs if ratio is not None and ratio > FLOORS[pair_check.check]]
