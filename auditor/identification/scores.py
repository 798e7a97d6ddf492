"""Normalised scores z: how many standard deviations a statistic lies above what clean drives are expected to have."""

from array import array
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from functools import cache
from math import ceil, inf
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from auditor.identification.faults import FAULTS, TONES, faults_of
from auditor.identification.incidents.sequential import incident_limit
from auditor.identification.parameters import FAULT_SCALE, SCORE_LIMITS, STANDS_OUT, FittedOn
from auditor.identification.prior import (
    Drives,
    DriveValues,
    drive_values,
    expected,
    expected_after,
    joint_limit,
    log_odds,
    prior_of_cause,
    prior_of_check,
)
from auditor.identification.thresholds import Largest, LargestValues, checked
from auditor.model.arrays import Flags, Floats
from auditor.model.calibration import CleanFrames, NullDistribution, RobustThresholds, ThetaScale
from auditor.model.checks import SensorCheck
from auditor.model.verdict import Cause, CauseIn

_NONE = np.zeros(0)

_Key = tuple[SensorCheck, FittedOn] | CauseIn
_SUMMED_UP: WeakKeyDictionary[CleanFrames, dict[_Key, DriveValues]] = WeakKeyDictionary()
"""By drive: what of it thresholds need, so that many thresholds of many drives take no longer than their frames."""


def thresholds_from(
    clean: Sequence[CleanFrames],
    sensor_checks: Sequence[SensorCheck],
    judged_together: int,
    r: Decimal,
    calibration_id: str = "",
    fitted_on: FittedOn = FittedOn.SGBM,
) -> RobustThresholds:
    """Thresholds at r from the clean frames of recordings, each taken for a drive; from none of them the prior.

    `judged_together` is how many checks a frame is judged by at once, `fitted_on` says which prior. The limit of
    incidents is the usual one. Raises SettingError for an r outside 0 to 1.
    """
    drives = CleanDrives.of(clean, sensor_checks, groups={}, fitted_on=fitted_on)
    return drives.thresholds(judged_together, r, calibration_id)


class DriveSums:
    """What thresholds need of drives 0, 1, ..., each looked at once: values summed up, and the largest fault scores.

    So `many` of the scores are kept of each fault, over all drives. `fitted_on` says which prior their checks have.
    """

    def __init__(self, sensor_checks: Sequence[SensorCheck], many: int, fitted_on: FittedOn = FittedOn.SGBM) -> None:
        self.fitted_on = fitted_on
        causes = faults_of({sensor for check in sensor_checks for sensor in check.needed})
        self.recordings: list[str] = []
        self._of_checks = {check: array("d") for check in sensor_checks}
        self._of_causes = {cause: array("d") for cause in causes}
        self._largest = {cause: Largest(many) for cause in causes if cause[0] not in TONES}

    def add(self, drive: CleanFrames) -> None:
        """Take the next drive."""
        for check, sums in self._of_checks.items():
            sums.extend(_statistics_of(drive, check, self.fitted_on))
        for cause, sums in self._of_causes.items():
            sums.extend(_strengths_of(drive, cause))
        for cause, largest in self._largest.items():
            largest.add(drive.strengths.get(cause, _NONE), len(self.recordings))
        self.recordings.append(drive.recording_id)

    def join(self, later: "DriveSums") -> None:
        """Take drives that follow."""
        for check, sums in later._of_checks.items():
            self._of_checks[check].extend(sums)
        for cause, sums in later._of_causes.items():
            self._of_causes[cause].extend(sums)
        for cause, largest in later._largest.items():
            self._largest[cause].join(largest, len(self.recordings))
        self.recordings += later.recordings

    def of_checks(self) -> dict[SensorCheck, Drives]:
        """The values of each sensor check summed up."""
        return {check: Drives.of(sums) for check, sums in self._of_checks.items()}

    def of_causes(self) -> dict[CauseIn, Drives]:
        """The scores of each fault summed up."""
        return {cause: Drives.of(sums) for cause, sums in self._of_causes.items()}

    def largest(self) -> dict[CauseIn, LargestValues]:
        """The largest scores of each fault that can be too large only."""
        return {cause: largest.ordered(len(self.recordings)) for cause, largest in self._largest.items()}


def largest_asked_for(together: Counter[str | int]) -> int:
    """How many of the largest scores a quantile of them depends on, whatever is left out.

    `together` counts the frames of the recordings that are left out together.
    """
    return ceil((1 - FAULT_SCALE.shown_quantile) * together.total()) + max(together.values(), default=0) + 2


class CleanDrives:
    """What thresholds are learnt from, the clean frames of D recordings: looked at once, whichever are left out."""

    def __init__(self, sums: DriveSums) -> None:
        self._recordings, self._fitted_on = sums.recordings, sums.fitted_on
        self._places: dict[str, list[int]] = {}
        for place, recording in enumerate(self._recordings):
            self._places.setdefault(recording, []).append(place)
        self._of_checks, self._of_causes, self._largest = sums.of_checks(), sums.of_causes(), sums.largest()

    @classmethod
    def of(
        cls,
        clean: Sequence[CleanFrames],
        sensor_checks: Sequence[SensorCheck],
        *,
        groups: Mapping[str, int] | None = None,
        fitted_on: FittedOn = FittedOn.SGBM,
    ) -> "CleanDrives":
        """The clean frames of some recordings.

        Where it is known what is ever left out at once, far fewer of their fault scores are kept: `groups` are those of
        recordings that are left out together, by id; any other is left out by itself.
        """
        together = Counter[str | int]()
        for drive in clean:
            together["" if groups is None else groups.get(drive.recording_id, drive.recording_id)] += drive.frames
        sums = DriveSums(sensor_checks, largest_asked_for(together), fitted_on)
        for drive in clean:
            sums.add(drive)
        return cls(sums)

    def thresholds(
        self, judged_together: int, r: Decimal, calibration_id: str = "", *, used: Flags | None = None
    ) -> RobustThresholds:
        """As `thresholds_from`; they are learnt from the recordings that are `used` (D,). Raises SettingError."""
        limit = joint_limit(float(checked(r)), judged_together)
        used = np.ones(len(self._recordings), dtype=np.bool_) if used is None else used
        of_causes = {cause: _expected_of(cause, drives.chosen(used)) for cause, drives in self._of_causes.items()}
        causes = {cause: found for cause, found in of_causes.items() if found.drives or cause[0] not in TONES}
        gone = np.flatnonzero(~used).tolist()
        scales = {
            cause: fault_scale(cause[0], found, limit, self._shown(cause, gone)) for cause, found in causes.items()
        }
        missing = {self._recordings[place] for place in gone}
        drives = len(self._places) - sum(not used[self._places[name]].any() for name in missing)
        return RobustThresholds(calibration_id, r, limit, self.expected(used), scales, drives, incident_limit())

    def expected(self, used: Flags) -> dict[SensorCheck, NullDistribution]:
        """What is expected of the checks, learnt from the recordings that are `used` (D,)."""
        return {
            check: expected_after(prior_of_check(check, self._fitted_on), drives.chosen(used))
            for check, drives in self._of_checks.items()
        }

    def others(self, *recording_ids: str) -> Flags:
        """(D,) which of them are of other recordings than these."""
        used = np.ones(len(self._recordings), dtype=np.bool_)
        used[[place for known in recording_ids for place in self._places.get(known, [])]] = False
        return used

    def _shown(self, cause: CauseIn, gone: Sequence[int]) -> float:
        """What nearly all clean frames stay below; -inf where nothing is known, and of faults unusual either way."""
        if cause[0] in TONES:
            return -inf
        measured = self._largest[cause].without(gone)
        return measured.quantile(FAULT_SCALE.shown_quantile) if measured.size else -inf


def _expected_of(cause: CauseIn, drives: Drives) -> NullDistribution:
    """What is expected of a fault's score; what tones are usual of a rig only its own drives say.

    Of faults that are findings by themselves drives narrow nothing: most vehicles are well adjusted, and say little
    about the few that are less.
    """
    prior, means = prior_of_cause(cause), drives.mean[drives.frames > 0]
    if cause[0] in TONES and means.size:
        prior = prior._replace(mean=float(np.median(means)))
    null = expected_after(prior, drives, believed=True)
    least = expected(prior, ()).deviation if cause[0] in FAULTS else 0.0
    return replace(null, deviation=max(null.deviation, least))


def _statistics_of(drive: CleanFrames, check: SensorCheck, fitted_on: FittedOn) -> DriveValues:
    summaries, key = _SUMMED_UP.setdefault(drive, {}), (check, fitted_on)
    if key not in summaries:
        summaries[key] = drive_values(log_odds(drive.statistics.get(check, _NONE)), prior_of_check(check, fitted_on))
    return summaries[key]


def _strengths_of(drive: CleanFrames, cause: CauseIn) -> DriveValues:
    summaries = _SUMMED_UP.setdefault(drive, {})
    if cause not in summaries:
        summaries[cause] = drive_values(drive.strengths.get(cause, _NONE), None)
    return summaries[cause]


def fault_scale(cause: Cause, null: NullDistribution, limit: float, shown: float = -inf) -> ThetaScale:
    """Theta of a fault and the scale of its z: theta is at least 1, just enough, and the scale is a quarter of it.

    It lies above what clean drives have `shown`: a flaw that a rig has always had is no fault.
    """
    usual = null.mean if cause in TONES else None
    beyond = max(limit, 0.0) * null.deviation + (null.mean if usual is None else 0.0)
    theta = max(beyond, shown, 1.0)
    return ThetaScale(theta, FAULT_SCALE.scale * theta, null.drives, usual)


def normalised_scores(statistics: Floats, of_columns: Sequence[NullDistribution | None]) -> Floats:
    """(F, M) normalised scores z of statistics (F, M), NaN where not measured or nothing is expected.

    They are kept between two limits, so that one frame cannot outweigh all others of a temporal window.
    """
    mean = np.array([np.nan if one is None else one.mean for one in of_columns], dtype=np.float64)
    deviation = np.array([np.nan if one is None else one.deviation for one in of_columns], dtype=np.float64)
    z = (log_odds(statistics) - mean) / deviation
    return np.asarray(np.clip(z, SCORE_LIMITS.lowest, SCORE_LIMITS.highest))


class StandingOut(NamedTuple):
    """What a frame's statistics are worth beside themselves, before anything is judged.

    The damaged portions of `sensors` are looked for; its `cells` may be kept.
    """

    sensors: frozenset[int]
    cells: bool


def standing_out(sensor_checks: Sequence[SensorCheck], statistics: Sequence[float | None]) -> StandingOut:
    """Which sensors of a frame stand out, by the prior: what a drive usually shows is not known while it is measured.

    `statistics` (M,) are those of the sensor checks, None where not measured.
    """
    z = normalised_scores(np.array([statistics], dtype=np.float64), _by_prior(tuple(sensor_checks)))[0]
    sensors = (one.sensor for one, unusual in zip(sensor_checks, z > STANDS_OUT.localised, strict=True) if unusual)
    return StandingOut(frozenset(sensors), bool((z > STANDS_OUT.cells).any()))


@cache
def _by_prior(sensor_checks: tuple[SensorCheck, ...]) -> tuple[NullDistribution, ...]:
    return tuple(expected(prior_of_check(one), ()) for one in sensor_checks)
