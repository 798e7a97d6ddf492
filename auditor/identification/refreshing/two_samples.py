"""Whether a drive's statistics are those of the other drives: two-sample tests by drive, check by check.

Two tests of each check that counts. Of the level: the mean of the drive against the means of the others, whose median
and scatter are robust against a few bad ones. Of the shape: the frames of the drive about their own median against
those of the others about theirs, by Kolmogorov and Smirnov. Frames of a drive depend on each other, so they count as
many as they are worth (`effective_size`); drives differ in shape too, so the shape's statistic is divided by what is
usual between the others (genomic control; Devlin and Roeder 1999). All tests of a night are corrected together by Holm.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import exp, log, sqrt
from statistics import NormalDist

import numpy as np

from auditor.identification.parameters import HIERARCHY
from auditor.identification.prior import effective_size, log_odds, prior_of_check
from auditor.identification.refresh_parameters import TWO_SAMPLES
from auditor.identification.refreshing.drives import Drive, Folds
from auditor.identification.systems import System
from auditor.model.arrays import Floats
from auditor.model.checks import SensorCheck

_KOLMOGOROV_MEDIAN = 0.8276
"""Of the distribution of the scaled statistic where both samples are of one population."""

_MAD = 1.4826
"""Standard deviations of a normal distribution in a median absolute deviation."""


@dataclass(frozen=True)
class Difference:
    """How the frames of a drive differ in one check: by `deviations` of drives in level, or else in shape.

    `p` is the chance of as much in a drive like the others, before the correction for many.
    """

    check: SensorCheck
    deviations: float | None
    p: float

    def __str__(self) -> str:
        others = " ".join(f"S_{one}" for one in self.check.others)
        what = f"{self.check.check.value.replace('_', ' ')} of S_{self.check.sensor}{others and f' by {others}'}"
        if self.deviations is None:
            return f"its frames scatter otherwise than those of others in {what} (p = {self.p:.1g})"
        where = "above" if self.deviations > 0 else "below"
        return f"its {what} lies {abs(self.deviations):.1f} deviations {where} that of others (p = {self.p:.1g})"


@dataclass(frozen=True, eq=False)
class _Sample:
    """The log odds of one check in one drive: mean, deviations from the median, and how many frames they are worth."""

    mean: float
    centred: Floats
    worth: float


def differing(drives: Sequence[Drive], tested: Sequence[int], system: System) -> dict[int, Difference]:
    """The drives of `tested`, places in `drives`, that are not like those of other vehicles and days, and how.

    The others are those that may judge it; where they are too few nothing can be said, and nobody differs.
    """
    folds = Folds([drive.source for drive in drives])
    found: list[tuple[float, int, Difference]] = []
    for column in system.counting(frozenset()).tolist():
        check = system.sensor_checks[column]
        samples = {place: one for place, drive in enumerate(drives) if (one := _sample(drive, check)) is not None}
        usual = _usual_shape(list(samples.values()))
        for place in tested:
            others = [samples[one] for one in folds.others(place, samples.keys())]
            if place in samples and len(others) >= TWO_SAMPLES.fewest_drives:
                found += [(one.p, place, one) for one in _differences(check, samples[place], others, usual)]
    return dict(_rejected(sorted(found, key=lambda one: one[:2])))


def _rejected(tests: Sequence[tuple[float, int, Difference]]) -> Iterator[tuple[int, Difference]]:
    """Of tests in the order of their p those that Holm's correction rejects; the clearest of a drive is last."""
    clear = []
    for number, (p, place, one) in enumerate(tests):
        if p > TWO_SAMPLES.chance / (len(tests) - number):
            break
        clear.append((place, one))
    return reversed(clear)


def _differences(check: SensorCheck, one: _Sample, others: Sequence[_Sample], usual: float) -> Iterator[Difference]:
    deviations, freedom = _of_level(check, one, others)
    yield Difference(check, deviations, _two_sided(deviations, freedom))
    yield Difference(check, None, _kolmogorov_tail(_kolmogorov(one, _pooled(others)) / usual))


def _sample(drive: Drive, check: SensorCheck) -> _Sample | None:
    values = drive.clean.statistics.get(check)
    odds = log_odds(values[~np.isnan(values)]) if values is not None else np.zeros(0)
    if odds.size < TWO_SAMPLES.fewest_frames:
        return None
    return _Sample(float(odds.mean()), np.sort(odds - np.median(odds)), effective_size(odds))


def _of_level(check: SensorCheck, one: _Sample, others: Sequence[_Sample]) -> tuple[float, float]:
    """How many deviations a drive's mean lies above the median of the others', and their degrees of freedom.

    The deviation between drives is that of the others, weighed with the prior's as in a calibration.
    """
    prior, D = prior_of_check(check), len(others)
    means = np.array([other.mean for other in others])
    middle = float(np.median(means))
    scatter = (_MAD * float(np.median(np.abs(means - middle)))) ** 2
    freedom = HIERARCHY.prior_drives + D - 1
    between = (HIERARCHY.prior_drives * prior.between**2 + (D - 1) * scatter) / freedom
    variance = between * (1 + 1 / D) + prior.within**2 / one.worth
    return (one.mean - middle) / (prior.tail * sqrt(variance)), freedom


def _usual_shape(samples: Sequence[_Sample]) -> float:
    """By how much drives differ in shape more than samples of one population would, 1 at least."""
    if not samples:
        return 1.0
    pool = _pooled(samples)
    return max(float(np.median([_kolmogorov(one, pool) for one in samples])) / _KOLMOGOROV_MEDIAN, 1.0)


def _pooled(samples: Sequence[_Sample]) -> tuple[Floats, float]:
    """The frames of several drives about their medians, ascending, and how many they are worth."""
    return np.sort(np.concatenate([one.centred for one in samples])), sum(one.worth for one in samples)


def _kolmogorov(one: _Sample, pool: tuple[Floats, float]) -> float:
    """The scaled statistic of Kolmogorov and Smirnov, by the frames that both samples are worth."""
    every, of_pool = pool
    at = np.concatenate([one.centred, every])
    shares = [np.searchsorted(values, at, side="right") / values.size for values in (one.centred, every)]
    worth = sqrt(one.worth * of_pool / (one.worth + of_pool))
    # The correction for small samples of Stephens (1970).
    return (worth + 0.12 + 0.11 / worth) * float(np.max(np.abs(shares[0] - shares[1])))


def _kolmogorov_tail(statistic: float) -> float:
    """The chance that the scaled statistic exceeds this value."""
    if statistic < 0.3:  # the series converges slowly there, and the chance is 1
        return 1.0
    terms = [(-1.0) ** (k - 1) * exp(-2 * (k * statistic) ** 2) for k in range(1, 20)]
    return min(max(2 * sum(terms), 0.0), 1.0)


def _two_sided(t: float, freedom: float) -> float:
    """The chance of a t as far from 0, by the normal approximation of Wallace (1959)."""
    z = (8 * freedom + 1) / (8 * freedom + 3) * sqrt(freedom * log(1 + t * t / freedom))
    return float(2 * NormalDist().cdf(-z))
