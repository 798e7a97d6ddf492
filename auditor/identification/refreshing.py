"""Learning from drives that nobody looked at: which of them seem clean, and whether what they teach may be trusted.

Whoever can put recordings among those that are learnt from can raise thresholds: little by little, by one vehicle, or
by many recordings of a day. So each drive is judged by drives of other vehicles and days; none, no day and no vehicle
counts for much; and thresholds may neither rise far at once nor, in sum, far from what a person confirmed.
"""

from collections import Counter
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from math import exp, lgamma, log
from typing import NamedTuple

import numpy as np

from auditor.identification.cross_validation import count_incidents, thresholds_of, wilson
from auditor.identification.prior import joint_limit, log_odds
from auditor.identification.refresh_parameters import CLEAN_DRIVE, GATE, INFLUENCE
from auditor.identification.robust import FrameSeries, judge_frames
from auditor.identification.statistics import NANOSECONDS
from auditor.identification.systems import System
from auditor.model.arrays import Integers
from auditor.model.calibration import CleanFrames, RobustThresholds
from auditor.model.checks import SensorCheck
from auditor.model.verdict import FINDINGS


class Source(NamedTuple):
    """Where a drive comes from; a vehicle or day that is not known is None."""

    recording_id: str
    vehicle: Hashable = None
    day: Hashable = None


@dataclass(frozen=True, eq=False)
class Drive:
    """The frames of a recording, and where they come from."""

    source: Source
    clean: CleanFrames


@dataclass(frozen=True)
class Shown:
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


@dataclass(frozen=True)
class Step:
    """The threshold of a sensor check before and after, as log odds, and its rise in deviations of before."""

    check: SensorCheck
    before: float
    after: float
    rise: float


def shown_by(drive: CleanFrames, system: System, thresholds: RobustThresholds) -> Shown:
    """Judge a drive by thresholds at their r, and once more at the rate of strong incidents."""
    series = FrameSeries.of_clean(drive, system)
    verdicts = judge_frames(series, system, thresholds)
    finding = np.array([verdict.kind in FINDINGS for verdict in verdicts], dtype=np.bool_)
    strict = replace(thresholds, limit=joint_limit(CLEAN_DRIVE.raised_r, system.judged_together))
    strong = judge_frames(series, system, strict, without_causes=True) if finding.any() else []
    return Shown(
        drive.frames,
        int(np.count_nonzero(finding)),
        count_incidents([verdict.finding for verdict in verdicts], drive.stamps_ns),
        _windows(drive.stamps_ns),
        _windows(drive.stamps_ns[finding]),
        count_incidents([verdict.finding for verdict in strong], drive.stamps_ns[: len(strong)]),
    )


def shown_by_others(drives: Sequence[Drive], system: System, r: Decimal) -> list[Shown]:
    """Each drive judged by drives of other vehicles and days, as far as there are some; by the prior where none are.

    Vehicles and days are sorted into a few groups each, so that the work grows with the number of drives.
    """
    vehicles, days = (_groups(drives, name) for name in ("vehicle", "day"))
    known: dict[tuple[int, ...], RobustThresholds] = {}
    found = []
    for place, drive in enumerate(drives):
        key = vehicles[place], days[place]
        if key not in known:
            others = _others(drives, vehicles, days, place)
            known[key] = thresholds_of([drives[one].clean for one in others], system, r)
        found.append(shown_by(drive.clean, system, known[key]))
    return found


def limited(sources: Sequence[Source]) -> Iterator[tuple[int, str]]:
    """The places of the drives that are too many, each with the reason; later days go first.

    A calibration has so many drives at most, so many of a vehicle's day, and no vehicle more than its share of them,
    where there are three.
    """
    order = sorted(range(len(sources)), key=lambda place: (str(sources[place].day or ""), -place), reverse=True)
    of_day: Counter[Hashable] = Counter()
    left = []
    for place in order:
        recording_id, vehicle, day = sources[place]
        key = vehicle, recording_id if day is None else day
        of_day[key] += 1
        if of_day[key] > INFLUENCE.most_of_a_day:
            yield place, f"its vehicle has {INFLUENCE.most_of_a_day} others of that day"
        else:
            left.append(place)
    of_vehicle = Counter(sources[place].vehicle for place in left)
    taken: Counter[Hashable] = Counter()
    for place in left:
        vehicle = sources[place].vehicle
        # The share is reckoned from the drives of the others: a vehicle cannot raise it by more drives of its own.
        of_others = len(left) - of_vehicle[vehicle]
        most = max(1, int(of_others * INFLUENCE.share_of_vehicle / (1 - INFLUENCE.share_of_vehicle)))
        taken[vehicle] += 1
        if len(of_vehicle) > 2 and vehicle is not None and taken[vehicle] > most:
            yield place, f"its vehicle has {most} others, and no vehicle has more than its share"
        elif sum(taken.values()) > INFLUENCE.most_drives:
            yield place, f"{INFLUENCE.most_drives} recordings of later days are enough"


def steps(before: RobustThresholds, after: RobustThresholds, system: System) -> list[Step]:
    """How far the thresholds of the checks that count move, the largest rise first."""
    found = []
    for column in system.counting(frozenset()).tolist():
        check = system.sensor_checks[column]
        old, new = before.expected[check], after.expected[check]
        theta, changed = old.mean + before.limit * old.deviation, new.mean + after.limit * new.deviation
        found.append(Step(check, theta, changed, (changed - theta) / old.deviation))
    return sorted(found, key=lambda step: -step.rise)


def planted_found(drives: Sequence[CleanFrames], system: System, thresholds: RobustThresholds) -> tuple[int, int]:
    """How many planted attacks the thresholds find, and of how many.

    One is planted into each check that counts and each frame: its statistic is raised by so many log odds.
    """
    found = planted = 0
    for column in system.counting(frozenset()).tolist():
        check = system.sensor_checks[column]
        known = thresholds.expected[check]
        theta = known.mean + thresholds.limit * known.deviation
        for one in drives:
            if check in one.statistics:
                odds = log_odds(one.statistics[check]) + GATE.planted
                found += int(np.count_nonzero(odds > theta))
                planted += int(np.count_nonzero(~np.isnan(odds)))
    return found, planted


def doubts(rises: Sequence[Step], creep: Sequence[Step]) -> Iterator[str]:
    """Why a person should look before thresholds come into force; `creep` is against those that one confirmed."""
    largest = max((step.rise for step in rises), default=0.0)
    if largest > GATE.most_step:
        yield f"a threshold rises by {largest:.2f} deviations, more than {GATE.most_step:g}, in one refresh"
    largest = max((step.rise for step in creep), default=0.0)
    if largest > GATE.most_creep:
        yield (
            f"a threshold lies {largest:.2f} deviations, more than {GATE.most_creep:g}, above that of the version that "
            "a person confirmed last, or of the first"
        )


def worse(shown: Sequence[Shown], r: Decimal, before: tuple[int, int], after: tuple[int, int]) -> Iterator[str]:
    """Why thresholds are worse than those in force: false alarms of drives that others judge, or attacks lost."""
    windows, raised = sum(one.windows for one in shown), sum(one.raised_windows for one in shown)
    low, high = wilson(raised, windows)
    if low > GATE.most_false_alarms * float(r):
        yield (
            f"drives judged by the others are raised in {raised} of {windows} windows ({low:.2%} to {high:.2%}), more "
            f"than {GATE.most_false_alarms:g} times r = {r}"
        )
    shares = [found / planted if planted else 0.0 for found, planted in (before, after)]
    if shares[0] - shares[1] > GATE.most_lost:
        yield f"of planted attacks {shares[1]:.1%} would be found, {shares[0]:.1%} are now"


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
    return len(np.unique(stamps_ns // int(CLEAN_DRIVE.window_s * NANOSECONDS)))


def _groups(drives: Sequence[Drive], name: str) -> list[int]:
    """The number of the group that each drive is in, by vehicle or by day; what is not known is one of its own."""
    known = [getattr(drive.source, name) for drive in drives]
    keys = [drive.source.recording_id if key is None else key for key, drive in zip(known, drives, strict=True)]
    number = {key: place for place, key in enumerate(sorted(set(keys), key=str))}
    return [number[key] % INFLUENCE.folds for key in keys]


def _others(drives: Sequence[Drive], vehicles: Sequence[int], days: Sequence[int], place: int) -> list[int]:
    """The drives that may judge one: of other vehicles and days; where there are none, of other days."""
    every = range(len(drives))
    apart = [one for one in every if vehicles[one] != vehicles[place] and days[one] != days[place]]
    return apart or [one for one in every if days[one] != days[place]]
