"""Thresholds of the robust method: a yardstick for each element, and what the half seconds' score must exceed."""

from decimal import Decimal

import numpy as np

from auditor.errors import ThresholdsError
from auditor.identification.accusing import System
from auditor.identification.false_alarms import held_out_scores, hours_of, score_threshold
from auditor.identification.margins import strength_yardsticks, yardsticks
from auditor.identification.thresholds import resolvable
from auditor.thresholds import Calibration, RobustThresholds


def robust_thresholds(
    calibration: Calibration,
    system: System,
    r: Decimal,
    incidents_per_hour: float | None = None,
    *,
    transferred: bool = False,
) -> RobustThresholds:
    """Yardsticks at r; with `incidents_per_hour` also the score that clean recordings cross no more often than that.

    `transferred` is what `check_calibration` answered. Raises ThresholdsError where no element has clean frames, and
    SettingError where r is not in [0, 1].
    """
    scales = yardsticks(calibration.ratios_of(system.elements), system.elements, r)
    known = {element: scale for element, scale in zip(system.elements, scales, strict=True) if scale is not None}
    if not known:
        raise ThresholdsError(
            "no clean local ratios of any element of this rig",
            where=f"calibration {calibration.calibration_id}",
            remedy="calibrate on clean recordings of this rig kind, or judge with --method paper",
        )
    score = 0.0
    if incidents_per_hour is not None:
        score = score_threshold(held_out_scores(calibration, system, r), clean_hours(calibration), incidents_per_hour)
    return RobustThresholds(
        calibration_id=calibration.calibration_id,
        r=r,
        yardsticks=known,
        causes=strength_yardsticks(calibration.strengths, r),
        resolvable=all(resolvable(r, scale.samples) for scale in known.values()),
        score=score,
        incidents_per_hour=incidents_per_hour,
        transferred=transferred,
    )


def clean_hours(calibration: Calibration) -> float:
    """Time that the clean frames of a calibration stand for; fewer than one incident in it cannot be told from none."""
    return float(np.sum([hours_of(one.stamps_ns) for one in calibration.clean]))
