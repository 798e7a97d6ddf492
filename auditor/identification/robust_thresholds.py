"""Thresholds of the robust method: a yardstick for each element, and what the half seconds' score must exceed."""

from dataclasses import replace
from decimal import Decimal

import numpy as np

from auditor.errors import ThresholdsError
from auditor.identification.accusing import System
from auditor.identification.false_alarms import held_out_scores, hours_of, score_threshold
from auditor.identification.margins import thresholds_from
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
    ratios, known = calibration.ratios_of(system.elements), calibration.calibration_id
    found = thresholds_from(ratios, calibration.strengths, system.elements, r, known)
    if not found.yardsticks:
        raise ThresholdsError(
            "no clean local ratios of any element of this rig",
            where=f"calibration {known}",
            remedy="calibrate on clean recordings of this rig kind, or judge with --method paper",
        )
    score = 0.0
    if incidents_per_hour is not None:
        score = score_threshold(held_out_scores(calibration, system, r), clean_hours(calibration), incidents_per_hour)
    return replace(found, score=score, incidents_per_hour=incidents_per_hour, transferred=transferred)


def clean_hours(calibration: Calibration) -> float:
    """Time that the clean frames of a calibration stand for; fewer than one incident in it cannot be told from none."""
    return float(np.sum([hours_of(one.stamps_ns) for one in calibration.clean]))
