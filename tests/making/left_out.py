"""Each clean recording of a calibration judged by the others, from a calibration that was read."""

from collections import Counter
from decimal import Decimal

from auditor.identification.cross_validation import (
    CleanErrors,
    ErrorsOfOthers,
    LeftOut,
    ThresholdsOfOthers,
    errors_asked_for,
    groups_of,
    judge_by_others,
    judge_by_thetas,
)
from auditor.identification.scores import CleanDrives
from auditor.identification.systems import System
from auditor.model.calibration import Calibration
from auditor.model.measurement import Statistic
from auditor.model.rig import fallback_of


def leave_one_out_robust(calibration: Calibration, system: System, r: Decimal) -> list[LeftOut]:
    """Judge each clean recording by the others as a scan would; a single one by the prior.

    Of more than MOST_GROUPS recordings a few that follow one another are left out together.
    """
    groups = groups_of(one.recording_id for one in calibration.clean)
    drives = CleanDrives.of(calibration.clean, system.sensor_checks, groups=groups)
    others = ThresholdsOfOthers(drives, groups, system, r)
    return [judge_by_others(one, others.of(one.recording_id), system) for one in calibration.clean]


def leave_one_out_paper(calibration: Calibration, statistic: Statistic, r: Decimal) -> list[LeftOut]:
    """Judge each clean recording by the others as the paper does: a finding is a frame with some E above its theta."""
    if len(calibration.recordings) == 1:
        return []
    frames = Counter[str]()
    for one in calibration.clean:
        frames[one.recording_id] += one.frames
    errors = CleanErrors(statistic, errors_asked_for(r, frames))
    for one in calibration.clean:
        errors.add(one)
    others, kind = ErrorsOfOthers(errors, r), calibration.rig_kind
    fallback = fallback_of(len(kind.sizes_px), lidar=kind.lidar)
    return [judge_by_thetas(one, others.of(one.recording_id), statistic, fallback) for one in calibration.clean]
