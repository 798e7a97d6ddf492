"""What clean frames of a drive that nobody has seen are expected to have: a hierarchy of drives, with a prior.

Frames of one drive are alike, and drives are not. A value of a frame (the log odds of a check's statistic, or a fault
score) is the mean of its drive and a deviation within the drive of standard deviation w; the means of drives deviate
from that of their rig kind by b, and those of rig kinds from the prior's by b / sqrt(rig_kind). A few drives therefore
tell little about the next one, however many frames they have: its standard deviation is
sqrt(w^2 + b^2 (1 + 1 / (rig_kind + D))) after D drives. Rare values lie farther out than a normal distribution's; the
prior says by which factor, and deviations are given times it.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import chain
from math import exp, inf, sqrt
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from auditor.identification.evidence_parameters import INCIDENTS
from auditor.identification.parameters import CAUSE_PRIORS, HIERARCHY, JOINT_TAIL, OTHERS, FittedOn
from auditor.model.arrays import Flags, Floats, Integers, median_of
from auditor.model.calibration import NullDistribution
from auditor.model.checks import SensorCheck
from auditor.model.rig import LIDAR
from auditor.model.verdict import Cause, CauseIn

SMALLEST_R = 1e-5
"""A smaller rate is taken for it: no clean frames reach further."""


OFFSET = HIERARCHY.offset
"""What is added to a statistic, and to what is left to 1, before their logarithms are taken: both may be 0."""


class Prior(NamedTuple):
    """What is known before any drive of a rig kind: mean, and standard deviations within and between drives.

    Rare values lie `tail` times as many deviations away as those of a normal distribution.
    """

    mean: float
    within: float
    between: float
    tail: float = 1.0


class DriveValues(NamedTuple):
    """The values of one drive: their mean, their sum of squares about it, and how many frames they are worth."""

    mean: float
    squares: float
    frames: int
    worth: float


@dataclass(frozen=True, eq=False)
class Drives:
    """The values of D drives summed up, each (D,), as those of one are in `DriveValues`."""

    mean: Floats
    squares: Floats
    frames: Integers
    worth: Floats

    @classmethod
    def of(cls, drives: Iterable[float]) -> "Drives":
        """Of the `DriveValues` of each of them, one after another; a drive without values has no frames."""
        mean, squares, frames, worth = np.fromiter(drives, dtype=np.float64).reshape(-1, len(DriveValues._fields)).T
        return cls(mean, squares, frames.astype(np.int64), worth)

    def chosen(self, places: Flags) -> "Drives":
        """The drives at some places (D,)."""
        return Drives(self.mean[places], self.squares[places], self.frames[places], self.worth[places])


@cache
def prior_of_check(check: SensorCheck, fitted_on: FittedOn = FittedOn.SGBM) -> Prior:
    """The prior of a sensor check: the same for all sensors, by how many cameras take part, and by the matcher."""
    priors = check.check.kind.priors
    declared = priors[min(len(check.others), len(priors)) - 1]
    return Prior(*OTHERS[fitted_on].get(declared.name, declared.values))


def prior_of_cause(cause: CauseIn) -> Prior:
    """The prior of a fault's score."""
    kind, sensor = cause
    if kind is Cause.EXPOSURE:
        return Prior(*CAUSE_PRIORS.exposure)
    if kind is Cause.WHITE_BALANCE:
        return Prior(*CAUSE_PRIORS.white_balance)
    if kind is Cause.LATE:
        return Prior(*(CAUSE_PRIORS.late_lidar if sensor == LIDAR else CAUSE_PRIORS.late_camera))
    if kind is Cause.DISPLACED:
        return Prior(*(CAUSE_PRIORS.displaced_lidar if sensor == LIDAR else CAUSE_PRIORS.displaced_camera))
    return Prior(*CAUSE_PRIORS.others)


def log_odds(statistics: Floats) -> Floats:
    """The values that are compared with what is expected, log((T + o) / (1 - T + o)), of any shape; NaN stays NaN."""
    return np.asarray(np.log((statistics + OFFSET) / (1 - statistics + OFFSET)))


def statistic_at(odds: float) -> float:
    """The statistic whose log odds these are, between 0 and 1."""
    share = 1 / (1 + exp(-odds))
    return min(max(share * (1 + 2 * OFFSET) - OFFSET, 0.0), 1.0)


def expected(prior: Prior, drives: Sequence[Floats], *, believed: bool = False) -> NullDistribution:
    """What is expected after these drives, the values (F,) of each in the order of time, NaN where not measured.

    One drive moves the mean no further than what the prior holds likely, more drives that agree further: what one
    drive alone shows may be an attack, what many show belongs to the rig. One drive alone lowers no mean: a road that
    shows less than others do says little about them. One narrows the deviation of any drive not
    at all, and many do not without end: usual frames say little about rare ones, and usual roads about rare roads.
    Where drives are `believed` there are no such bounds: nobody attacks by a fault.
    """
    seen = [drive_values(values, None if believed else prior) for values in drives]
    return expected_after(prior, Drives.of(chain.from_iterable(seen)), believed=believed)


def expected_after(prior: Prior, drives: Drives, *, believed: bool = False) -> NullDistribution:
    """What is expected after drives whose values are summed up, see `expected`."""
    seen = drives.chosen(drives.frames > 0)
    D = seen.mean.size
    within = (HIERARCHY.prior_frames * prior.within**2 + _sum(seen.worth * seen.squares / seen.frames)) / (
        HIERARCHY.prior_frames + _sum(seen.worth)
    )
    if not believed:
        within = max(within, (HIERARCHY.narrowest * prior.within) ** 2)
    far = inf if believed else HIERARCHY.farthest + HIERARCHY.farther * (D - 1)
    of_prior = prior.within**2 + prior.between**2 * (1 + 1 / HIERARCHY.rig_kind)
    reach = far * sqrt(of_prior)
    means = np.clip(seen.mean, prior.mean - reach, prior.mean + reach)
    weights = 1 / (prior.between**2 + within / seen.worth)
    weight = HIERARCHY.rig_kind / prior.between**2
    mean = (weight * prior.mean + float(weights @ means)) / (weight + float(weights.sum()))
    if D == 1 and not believed:
        mean = max(mean, prior.mean)
    beyond = _sum(np.maximum((means - mean) ** 2 - within / seen.worth, 0.0))
    between = (HIERARCHY.prior_drives * prior.between**2 + beyond) / (HIERARCHY.prior_drives + D)
    between *= 1 + 1 / (HIERARCHY.rig_kind + D)
    of_any_drive = within + between
    if not believed:
        of_any_drive = max(of_any_drive, _left_after(D) ** 2 * of_prior)
    deviation, within, between = (prior.tail * sqrt(one) for one in (of_any_drive, within, between))
    return NullDistribution(mean, deviation, within, D, int(seen.frames.sum()), between)


def _left_after(D: int) -> float:
    """Of the prior's deviation of any drive what is left after D drives at least: one drive narrows nothing."""
    of_prior = HIERARCHY.prior_drives / (HIERARCHY.prior_drives + max(D, 1) - 1)
    return HIERARCHY.narrowest + (1 - HIERARCHY.narrowest) * of_prior


def joint_limit(r: float, checks: int) -> float:
    """The standard deviations that the largest z of so many checks exceeds in a share r of clean frames.

    They depend on each other, and are worth fewer; and the tails are heavier than the normal distribution's. At r above
    the tail's rate the limit falls by less, since a drive's own level raises scores there.
    """
    if r >= 1:
        return -inf
    independent = max(checks, 1) ** JOINT_TAIL.independent
    rates = max(r, SMALLEST_R), INCIDENTS.tail_rate
    limit, of_tail = (JOINT_TAIL.stretch * NormalDist().inv_cdf((1 - rate) ** (1 / independent)) for rate in rates)
    return max(limit, of_tail + JOINT_TAIL.fall * (limit - of_tail))


def drive_values(values: Floats, prior: Prior | None) -> DriveValues:
    """The values (F,) of one drive summed up, NaN where not measured; those of a `prior` within its bounds."""
    measured = values[~np.isnan(values)]
    return _drive(measured if prior is None else _bounded(measured, prior))


def _bounded(values: Floats, prior: Prior) -> Floats:
    """The values, none further from their median than frames of one drive are: a few attacked ones count as those."""
    if not values.size:
        return values
    middle, reach = median_of(np.sort(values)), HIERARCHY.widest_values * prior.within
    return np.clip(values, middle - reach, middle + reach)


def _drive(values: Floats) -> DriveValues:
    if not values.size:
        return DriveValues(0.0, 0.0, 0, 0.0)
    mean = float(values.mean())
    return DriveValues(mean, float(np.square(values - mean).sum()), values.size, effective_size(values))


def _sum(values: Floats) -> float:
    """The sum in order: its last digits do not depend on how NumPy groups the values."""
    return float(np.cumsum(values)[-1]) if values.size else 0.0


def effective_size(values: Floats) -> float:
    """How many independent frames F successive ones are worth, 1 at least (docs/figures.md)."""
    F, deviations = values.size, values - values.mean()
    power = float(deviations @ deviations)
    if HIERARCHY.fewest_frames > F or power == 0 or values.max() == values.min():
        return 1.0
    total = 1.0
    for lag in range(1, F):
        correlation = float(deviations[lag:] @ deviations[:-lag]) / power
        if correlation <= 0:
            break
        total += 2 * (1 - lag / F) * correlation
    return F / total
