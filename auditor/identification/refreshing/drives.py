"""Drives that may be learnt from, and what each shows when others judge it."""

from collections.abc import Collection, Hashable, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from math import exp, lgamma, log
from typing import NamedTuple

import numpy as np

from auditor.identification.cross_validation import as_scanned, count_incidents
from auditor.identification.parameters import TEMPORAL_WINDOW
from auditor.identification.prior import joint_limit
from auditor.identification.refresh_parameters import CLEAN_DRIVE
from auditor.identification.robust import findings_alone, judge_frames
from auditor.identification.scores import CleanDrives
from auditor.identification.systems import System
from auditor.model.arrays import Integers
from auditor.model.calibration import CleanFrames, RobustThresholds
from auditor.model.stamps import NANOSECONDS
from auditor.model.verdict import FINDINGS

_FOLDS = 5  # groups of vehicles, and groups of days, that judge each other


class DriveSource(NamedTuple):
    """Where a drive comes from; a vehicle or day that is not known is None."""

    recording_id: str
    vehicle: Hashable = None
    day: Hashable = None


@dataclass(frozen=True, eq=False)
class Drive:
    """The frames of a recording, and where they come from."""

    source: DriveSource
    clean: CleanFrames


@dataclass(frozen=True)
class DriveScores:
    """What a drive shows by thresholds that it did not teach.

    `findings` of its `frames` are not clean, `raised_windows` of its `windows` hold one. `strong` are its incidents at
    the rate at which a clean drive has none.
    """

    frames: int
    findings: int
    incidents: int
    windows: int
    raised_windows: int
    strong: int

    def raised(self, r: Decimal) -> str:
        """Why it does not seem clean; empty where it does."""
        if self.strong:
            return f"{self.strong} incident{'s' * (self.strong > 1)} at r = {CLEAN_DRIVE.raised_r:g}"
        chance = CLEAN_DRIVE.findings_of_a_window * float(r)
        if binomial_tail(self.raised_windows, self.windows, min(chance, 1.0)) < CLEAN_DRIVE.chance:
            return f"{self.findings} of {self.frames} frames are findings at r = {r}: too many for a clean drive"
        return ""


def shown_by(drive: CleanFrames, system: System, learnt: RobustThresholds) -> DriveScores:
    """Judge a drive as a scan would, by thresholds at their r, and once more at the rate of strong incidents."""
    series, thresholds = as_scanned(drive, learnt, system)
    if not findings_alone(series, system, thresholds).any():
        return DriveScores(drive.frames, 0, 0, _windows(drive.stamps_ns), 0, 0)
    verdicts = judge_frames(series, system, thresholds)
    finding = np.array([verdict.kind in FINDINGS for verdict in verdicts], dtype=np.bool_)
    strict = replace(learnt, limit=joint_limit(CLEAN_DRIVE.raised_r, system.judged_together))
    strong = judge_frames(series, system, as_scanned(drive, strict, system)[1], without_causes=True)
    return DriveScores(
        drive.frames,
        int(np.count_nonzero(finding)),
        count_incidents([verdict.finding for verdict in verdicts], drive.stamps_ns),
        _windows(drive.stamps_ns),
        _windows(drive.stamps_ns[finding]),
        count_incidents([verdict.finding for verdict in strong], drive.stamps_ns),
    )


def shown_by_others(drives: Sequence[Drive], system: System, r: Decimal) -> list[DriveScores]:
    """Each drive judged by drives of other vehicles and days (`Folds`); by the prior where there are none."""
    folds = Folds([drive.source for drive in drives])
    every = CleanDrives.of([drive.clean for drive in drives], system.sensor_checks, fitted_on=system.fitted_on)
    thresholds_of: dict[tuple[int, int], RobustThresholds] = {}
    scores = []
    for place, drive in enumerate(drives):
        key = folds.of(place)
        if key not in thresholds_of:
            used = np.isin(np.arange(len(drives)), folds.others(place))
            thresholds_of[key] = every.thresholds(system.judged_together, r, used=used)
        scores.append(shown_by(drive.clean, system, thresholds_of[key]))
    return scores


class Folds:
    """Drives by groups of vehicles and of days, so that the work of judging each by others grows with their number."""

    def __init__(self, sources: Sequence[DriveSource]) -> None:
        self._vehicles = _groups([one.vehicle for one in sources], sources)
        self._days = _groups([one.day for one in sources], sources)

    def of(self, place: int) -> tuple[int, int]:
        """The groups of vehicle and day that a drive is in."""
        return self._vehicles[place], self._days[place]

    def others(self, place: int, among: Collection[int] | None = None) -> list[int]:
        """The drives that may judge one: of other vehicles and days.

        Where there are none, those of other vehicles: an attacker who owns one vehicle must not vouch for it. Where
        all are of one vehicle, those of other days.
        """
        vehicle, day = self.of(place)
        every = range(len(self._days)) if among is None else sorted(among)
        of_others = [one for one in every if self._vehicles[one] != vehicle]
        apart = [one for one in of_others if self._days[one] != day]
        return apart or of_others or [one for one in every if self._days[one] != day]


def binomial_tail(k: int, n: int, p: float) -> float:
    """The chance of k or more of n trials that succeed with chance p each."""
    if k <= 0 or p >= 1:
        return 1.0
    if p <= 0:
        return 0.0
    below = [
        lgamma(n + 1) - lgamma(i + 1) - lgamma(n - i + 1) + i * log(p) + (n - i) * log(1 - p)
        for i in range(min(k, n + 1))
    ]
    return max(1.0 - sum(map(exp, below)), 0.0)


def _windows(stamps_ns: Integers) -> int:
    """How many windows of time hold some of these stamps."""
    return len(np.unique(stamps_ns // int(TEMPORAL_WINDOW.seconds * NANOSECONDS)))


def _groups(owners: Sequence[Hashable], sources: Sequence[DriveSource]) -> list[int]:
    """The number of the group that each drive is in; what is not known is one of its own."""
    keys = [one.recording_id if key is None else key for key, one in zip(owners, sources, strict=True)]
    number = {key: place for place, key in enumerate(sorted(set(keys), key=str))}
    return [number[key] % _FOLDS for key in keys]
