"""Whether what drives teach may come into force: how far thresholds move, false alarms, and planted attacks."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal

import numpy as np

from auditor.identification.cross_validation import as_scanned
from auditor.identification.prior import log_odds
from auditor.identification.refresh_parameters import GATE
from auditor.identification.refreshing.clustered import Share, difference_of, share_of
from auditor.identification.refreshing.drives import Shown
from auditor.identification.systems import System
from auditor.model.calibration import CleanFrames, RobustThresholds
from auditor.model.checks import SensorCheck


@dataclass(frozen=True)
class Step:
    """The threshold of a sensor check before and after, as log odds, and its rise in deviations of before."""

    check: SensorCheck
    before: float
    after: float
    rise: float


def steps(before: RobustThresholds, after: RobustThresholds, system: System) -> list[Step]:
    """How far the thresholds of the checks that count move, the largest rise first."""
    found = []
    for column in system.counting(frozenset()).tolist():
        check = system.sensor_checks[column]
        old, new = before.expected[check], after.expected[check]
        theta, changed = old.mean + before.limit * old.deviation, new.mean + after.limit * new.deviation
        found.append(Step(check, theta, changed, (changed - theta) / old.deviation))
    return sorted(found, key=lambda step: -step.rise)


@dataclass(frozen=True)
class Planted:
    """Planted attacks: how many of each drive are found, and of how many."""

    found: tuple[int, ...]
    planted: tuple[int, ...]

    @property
    def share(self) -> Share:
        """The share that is found."""
        return share_of(self.found, self.planted)

    def lost_since(self, before: "Planted") -> Share:
        """The share of the same planted attacks that others found and these do not, less those found anew."""
        lost = [one - other for one, other in zip(before.found, self.found, strict=True)]
        return difference_of(lost, self.planted)


def planted_found(drives: Sequence[CleanFrames], system: System, thresholds: RobustThresholds) -> Planted:
    """How many planted attacks are found in each drive when it is scanned by these thresholds.

    One is planted into each check that counts and each frame: its statistic is raised by so many log odds.
    """
    columns = system.counting(frozenset())
    found = []
    for one in drives:
        series, known = as_scanned(one, thresholds, system)
        expected = [known.expected[system.sensor_checks[column]] for column in columns.tolist()]
        theta = np.array([one.mean + known.limit * one.deviation for one in expected])
        odds = log_odds(series.statistics[:, columns]) + GATE.planted
        found.append((int(np.count_nonzero(odds > theta)), int(np.count_nonzero(~np.isnan(odds)))))
    return Planted(tuple(one for one, _ in found), tuple(of for _, of in found))


def doubts(rises: Sequence[Step], creep: Sequence[Step], lost_since_confirmed: Share) -> Iterator[str]:
    """Why a person should look before thresholds come into force.

    `creep` is against those that a person confirmed; so is what is lost of planted attacks.
    """
    largest = max((step.rise for step in rises), default=0.0)
    if largest > GATE.most_step:
        yield f"a threshold rises by {largest:.2f} deviations, more than {GATE.most_step:g}, in one refresh"
    confirmed = "the version that a person confirmed last, or of the first"
    largest = max((step.rise for step in creep), default=0.0)
    if largest > GATE.most_creep:
        yield f"a threshold lies {largest:.2f} deviations, more than {GATE.most_creep:g}, above that of {confirmed}"
    if lost_since_confirmed.value > GATE.most_lost_in_all:
        yield f"{lost_since_confirmed} of planted attacks are lost since {confirmed}"


def worse(shown: Sequence[Shown], r: Decimal, lost: Share) -> Iterator[str]:
    """Why thresholds are worse than those in force: false alarms of drives that others judge, or attacks lost."""
    alarms = false_alarms(shown)
    if alarms.low > GATE.most_false_alarms * float(r):
        yield (
            f"drives judged by the others are raised in {alarms} of {sum(one.windows for one in shown)} windows, more "
            f"than {GATE.most_false_alarms:g} times r = {r}"
        )
    if lost.value > GATE.most_lost:
        yield f"{lost} of planted attacks that are found now would be lost"


def false_alarms(shown: Sequence[Shown]) -> Share:
    """The share of windows with findings."""
    return share_of([one.raised_windows for one in shown], [one.windows for one in shown])
