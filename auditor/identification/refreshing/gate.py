"""Whether what drives teach may come into force: how far thresholds move, false alarms, and planted attacks."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from math import sqrt
from typing import NamedTuple

import numpy as np

from auditor.identification.cross_validation import wilson
from auditor.identification.drive_level import for_clean_drive
from auditor.identification.parameters import HIERARCHY
from auditor.identification.prior import log_odds
from auditor.identification.refresh_parameters import CONDITIONS, GATE, INFLUENCE
from auditor.identification.refreshing.drives import DriveScores
from auditor.identification.systems import System
from auditor.model.calibration import CleanFrames, ConditionRate, RobustThresholds
from auditor.model.checks import SensorCheck

_Z = 1.959963984540054  # the 97.5 % quantile of the normal distribution


class Share(NamedTuple):
    """A share of cases and both ends of its 95 % interval."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{100 * self.value:.1f} % ({100 * self.low:.1f} to {100 * self.high:.1f})"


def share_of(hits: Sequence[int], cases: Sequence[int]) -> Share:
    """sum(hits) / sum(cases), one entry a drive: Wilson's interval of as many cases as they are worth.

    Where all cases agree, or there is one drive, they are worth as many as there are drives: how much drives differ is
    not known then. Of no case it is 0, from 0 to 1.
    """
    k, n = sum(hits), sum(cases)
    if n == 0:
        return Share(0.0, 0.0, 1.0)
    p = k / n
    drives = sum(of > 0 for of in cases)
    if not 0 < p < 1 or drives < 2:
        worth = float(drives)
    else:
        worth = min(p * (1 - p) / max(_error(hits, cases, p) ** 2, p * (1 - p) / n), float(n))
    return Share(p, *wilson(p * worth, worth))


def difference_of(differences: Sequence[int], cases: Sequence[int]) -> Share:
    """sum(differences) / sum(cases), which may be negative, by the normal distribution over drives.

    Its error is never smaller than that of independent cases: a few drives may agree by chance.
    """
    n = sum(cases)
    if n == 0:
        return Share(0.0, 0.0, 0.0)
    p = sum(differences) / n
    error = _Z * max(_error(differences, cases, p), sqrt(abs(p) * (1 - abs(p)) / n))
    return Share(p, p - error, p + error)


def _error(hits: Sequence[int], cases: Sequence[int], p: float) -> float:
    """The standard error of a ratio of sums over drives."""
    drives = sum(of > 0 for of in cases)
    if drives < 2:
        return 0.0
    squares = sum((k - p * of) ** 2 for k, of in zip(hits, cases, strict=True))
    return sqrt(squares * drives / (drives - 1)) / sum(cases)


@dataclass(frozen=True)
class Step:
    """The threshold of a sensor check before and after, as log odds, and its rise in deviations of before."""

    check: SensorCheck
    before: float
    after: float
    rise: float


def steps(before: RobustThresholds, after: RobustThresholds, system: System) -> list[Step]:
    """How far the thresholds of the checks that count move, the largest rise first."""
    changes = []
    for column in system.counting(frozenset()).tolist():
        check = system.sensor_checks[column]
        old, new = before.expected[check], after.expected[check]
        theta, changed = old.mean + before.limit * old.deviation, new.mean + after.limit * new.deviation
        changes.append(Step(check, theta, changed, (changed - theta) / old.deviation))
    return sorted(changes, key=lambda step: -step.rise)


@dataclass(frozen=True)
class PlantedAttacks:
    """Planted attacks: how many of each drive are found, and of how many."""

    found: tuple[int, ...]
    planted: tuple[int, ...]

    @property
    def share(self) -> Share:
        """The share that is found."""
        return share_of(self.found, self.planted)

    def lost_since(self, before: "PlantedAttacks") -> Share:
        """The share of the same planted attacks that others found and these do not, less those found anew."""
        lost = [one - other for one, other in zip(before.found, self.found, strict=True)]
        return difference_of(lost, self.planted)


def planted_found(drives: Sequence[CleanFrames], system: System, thresholds: RobustThresholds) -> PlantedAttacks:
    """How many planted attacks are found in each drive when it is scanned by these thresholds.

    One is planted into each check that counts and each frame: its statistic is raised by so many log odds.
    """
    checks = [system.sensor_checks[column] for column in system.counting(frozenset()).tolist()]
    counts = []
    for drive in drives:
        expected = for_clean_drive(thresholds, checks, drive).expected
        theta = np.array([expected[check].mean + thresholds.limit * expected[check].deviation for check in checks])
        odds = log_odds(drive.statistics_of(checks)) + GATE.planted
        counts.append((int(np.count_nonzero(odds > theta)), int(np.count_nonzero(~np.isnan(odds)))))
    return PlantedAttacks(tuple(one for one, _ in counts), tuple(of for _, of in counts))


@dataclass(frozen=True)
class VersionComparison:
    """How the thresholds of a candidate compare with those of another version, which was made of so many `drives`.

    `found` is the share of planted attacks that the other one finds, `lost` what the candidate loses of them.
    """

    drives: int
    steps: tuple[Step, ...]
    lost: Share
    found: Share

    @property
    def rise(self) -> float:
        """The largest rise of a threshold."""
        return max((step.rise for step in self.steps), default=0.0)


def compared(
    drives: Sequence[CleanFrames],
    system: System,
    before: RobustThresholds,
    after: RobustThresholds,
    planted: PlantedAttacks,
) -> VersionComparison:
    """Compare thresholds, on drives that attacks are planted into; `planted` is what those of after find."""
    earlier = planted_found(drives, system, before)
    return VersionComparison(
        before.drives, tuple(steps(before, after, system)), planted.lost_since(earlier), earlier.share
    )


def doubts(step: VersionComparison, creep: VersionComparison) -> Iterator[str]:
    """Why a person should look before thresholds come into force; `creep` is against those that a person confirmed."""
    confirmed = "the version that a person confirmed last, or of the first"
    most = allowed(GATE.most_step, step.drives)
    if step.rise > most:
        yield f"a threshold rises by {step.rise:.2f} deviations, more than {most:.2f}, in one refresh"
    most = allowed(GATE.most_creep, creep.drives)
    if creep.rise > most:
        yield f"a threshold lies {creep.rise:.2f} deviations, more than {most:.2f}, above that of {confirmed}"
    if creep.lost.value > allowed(GATE.most_lost_in_all, creep.drives):
        yield f"{creep.lost} of planted attacks are lost since {confirmed}"


def worse(step: VersionComparison, before: Sequence[DriveScores], after: Sequence[DriveScores]) -> Iterator[str]:
    """Why thresholds are worse than those in force: attacks lost, or more false alarms.

    `before` and `after` are what the same new drives show by the version in force and by the others of the candidate.
    """
    if step.lost.value > allowed(GATE.most_lost, step.drives):
        yield f"{step.lost} of planted attacks that are found now would be lost"
    more = [new.raised_windows - old.raised_windows for old, new in zip(before, after, strict=True)]
    difference = difference_of(more, [one.windows for one in before])
    if difference.low > 0 and difference.value > GATE.most_more_alarms:
        yield f"{difference} more windows of new clean recordings would be raised"


def raised_often(shown: Sequence[DriveScores], r: Decimal) -> Iterator[str]:
    """Why a person should look: drives that others judge are raised far more often than r says."""
    alarms = false_alarms(shown)
    if alarms.low > GATE.most_false_alarms * float(r):
        yield (
            f"recordings judged by the others are raised in {alarms} of {sum(one.windows for one in shown)} windows, "
            f"more than {GATE.most_false_alarms:g} times r = {r}"
        )


def allowed(most: float, drives: int) -> float:
    """What may change after so many drives: after few the error of a threshold is larger, and so are honest changes."""
    prior = HIERARCHY.prior_drives
    return most * sqrt((INFLUENCE.most_drives + prior) / (min(drives, INFLUENCE.most_drives) + prior))


def false_alarms(shown: Sequence[DriveScores]) -> Share:
    """The share of windows with findings."""
    return share_of([one.raised_windows for one in shown], [one.windows for one in shown])


def rates_by_condition(
    conditions: Sequence[Mapping[str, str | None]], shown: Sequence[DriveScores]
) -> list[ConditionRate]:
    """The rates of all conditions, by name and value; `conditions` are those of each drive, None where not known."""
    windows, raised = sum(one.windows for one in shown), sum(one.raised_windows for one in shown)
    of_all = raised / windows if windows else 0.0
    groups: dict[tuple[str, str], list[DriveScores]] = defaultdict(list)
    for of_drive, scores in zip(conditions, shown, strict=True):
        for name, value in of_drive.items():
            if value is not None:
                groups[name, value].append(scores)
    return [_rate(*key, drives, of_all) for key, drives in sorted(groups.items())]


def doubtful(rates: Sequence[ConditionRate], r: Decimal) -> Iterator[str]:
    """The conditions under which clean drives are raised too often."""
    for rate in rates:
        if rate.enough and rate.low > GATE.most_false_alarms * float(r):
            yield (
                f"{rate.condition} {rate.value}: {rate.raised_windows} of {rate.windows} windows are raised, more than "
                f"{GATE.most_false_alarms:g} times r = {r}"
            )


def _rate(condition: str, value: str, drives: Sequence[DriveScores], of_all: float) -> ConditionRate:
    windows, raised = sum(one.windows for one in drives), sum(one.raised_windows for one in drives)
    weight = CONDITIONS.windows_of_all
    k, n = raised + weight * of_all, windows + weight
    enough = len(drives) >= CONDITIONS.fewest_drives and windows >= CONDITIONS.fewest_windows
    return ConditionRate(condition, value, len(drives), windows, raised, k / n, *wilson(k, n), enough)
