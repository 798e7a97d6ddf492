"""Normalised scores z: how many standard deviations a statistic lies above what clean drives are expected to have."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from decimal import Decimal

import numpy as np

from auditor.identification.faults import TONES, faults_of
from auditor.identification.parameters import FAULT_SCALE, LOCALISED_FROM, SCORE_LIMITS
from auditor.identification.prior import expected, joint_limit, log_odds, of_drive, prior_of_cause, prior_of_check
from auditor.identification.thresholds import checked
from auditor.model.arrays import Floats
from auditor.model.calibration import CleanFrames, Expected, RobustThresholds, Scale
from auditor.model.checks import Check, SensorCheck
from auditor.model.verdict import Cause, CauseIn

_LOCALISED_FROM: Mapping[Check, float] = {
    Check.LIDAR_CONFLICT: LOCALISED_FROM.lidar_conflict,
    Check.ADDED_LIGHT: LOCALISED_FROM.light,
    Check.REMOVED_LIGHT: LOCALISED_FROM.light,
    Check.PHOTOMETRIC_INCONSISTENCY: LOCALISED_FROM.inconsistency,
    Check.COLOURED_LIGHT: LOCALISED_FROM.coloured,
}


def thresholds_from(
    clean: Sequence[CleanFrames],
    sensor_checks: Sequence[SensorCheck],
    judged_together: int,
    r: Decimal,
    calibration_id: str = "",
) -> RobustThresholds:
    """Thresholds at r from the clean frames of recordings, each taken for a drive; from none of them the prior.

    `judged_together` is how many checks a frame is judged by at once. The threshold of the window's score is 0. Raises
    SettingError for an r outside 0 to 1.
    """
    limit = joint_limit(float(checked(r)), judged_together)
    of_checks = {
        check: expected(
            prior_of_check(check), [log_odds(one.statistics[check]) for one in clean if check in one.statistics]
        )
        for check in sensor_checks
    }
    causes = faults_of({sensor for check in sensor_checks for sensor in check.needed})
    of_causes = {
        cause: _expected_of(cause, [one.strengths[cause] for one in clean if cause in one.strengths])
        for cause in causes
    }
    drives = len({one.recording_id for one in clean})
    known = {cause: found for cause, found in of_causes.items() if found.drives or cause[0] not in TONES}
    scales = {cause: fault_scale(cause[0], found, limit, _shown(cause, clean)) for cause, found in known.items()}
    return RobustThresholds(calibration_id, r, limit, of_checks, scales, drives)


def for_drive(
    thresholds: RobustThresholds, sensor_checks: Sequence[SensorCheck], statistics: Floats
) -> RobustThresholds:
    """The thresholds for the drive that is judged, whose statistics are (F, M): what is expected of its own frames.

    They hold for any of its frames, and for attacked copies of them.
    """
    columns = dict(zip(sensor_checks, log_odds(statistics).T, strict=True))
    of_checks = {
        check: of_drive(one, columns[check], thresholds.limit) if check in columns else one
        for check, one in thresholds.expected.items()
    }
    return replace(thresholds, expected=of_checks)


def _expected_of(cause: CauseIn, drives: Sequence[Floats]) -> Expected:
    """What is expected of a fault's score; what is usual of a rig only its own drives say."""
    prior = prior_of_cause(cause)
    means = [float(np.nanmean(scores)) for scores in drives if not np.isnan(scores).all()]
    if cause[0] in TONES and means:
        prior = prior._replace(mean=float(np.median(means)))
    return expected(prior, drives, believed=True)


def _shown(cause: CauseIn, clean: Sequence[CleanFrames]) -> float:
    """What nearly all clean frames stay below; 0 where nothing is known, and of faults that are unusual either way."""
    scores = [one.strengths[cause] for one in clean if cause in one.strengths]
    measured = np.concatenate(scores) if scores else np.zeros(0)
    measured = measured[~np.isnan(measured)]
    if not measured.size or cause[0] in TONES:
        return 0.0
    return max(float(np.quantile(measured, FAULT_SCALE.shown_quantile)), 0.0)


def fault_scale(cause: Cause, found: Expected, limit: float, shown: float = 0.0) -> Scale:
    """Theta of a fault and the scale of its z: theta is at least 1, just enough, and the scale is a quarter of it.

    It lies above what clean drives have `shown`: a flaw that a rig has always had is no fault.
    """
    usual = found.mean if cause in TONES else None
    beyond = max(limit, 0.0) * found.deviation + (found.mean if usual is None else 0.0)
    theta = max(beyond, (1 + FAULT_SCALE.added_share) * shown, FAULT_SCALE.least_theta)
    return Scale(theta, FAULT_SCALE.scale * theta, found.drives, usual)


def normalised_scores(statistics: Floats, of_columns: Sequence[Expected | None]) -> Floats:
    """(F, M) normalised scores z of statistics (F, M), NaN where not measured or nothing is expected.

    They are kept between two limits, so that one frame cannot outweigh all others of a temporal window.
    """
    mean = np.array([np.nan if one is None else one.mean for one in of_columns], dtype=np.float64)
    deviation = np.array([np.nan if one is None else one.deviation for one in of_columns], dtype=np.float64)
    z = (log_odds(statistics) - mean) / deviation
    return np.asarray(np.clip(z, SCORE_LIMITS.lowest, SCORE_LIMITS.highest))


def worth_localising(sensor_checks: Sequence[SensorCheck], statistics: Sequence[float | None]) -> Collection[int]:
    """The sensors whose damaged portions may be asked for: a statistic of theirs is unusually large."""
    found = zip(sensor_checks, statistics, strict=True)
    return {
        one.sensor
        for one, value in found
        if value is not None and one.check in _LOCALISED_FROM and value > _LOCALISED_FROM[one.check]
    }
