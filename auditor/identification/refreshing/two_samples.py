"""Whether a drive's statistics are those of the other drives: two-sample tests by drive, check by check.

Two tests of each check that counts. Of the level: the mean of the drive against the means of the others, whose median
and scatter are robust against a few bad ones. Of the shape: the frames of the drive about their median against those
of all drives about theirs: the largest distance of the two (Kolmogorov and Smirnov) against the distances of the
others, since clean drives differ in shape far more than frames of one population would. Frames of a drive depend on
each other: a drive's mean counts as that of the frames that it is worth (`effective_size`), and its distance as one
value. All tests of a night are corrected together by Holm.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import log, sqrt
from statistics import NormalDist
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from auditor.identification.parameters import HIERARCHY
from auditor.identification.prior import effective_size, log_odds, prior_of_check
from auditor.identification.refresh_parameters import TWO_SAMPLES
from auditor.identification.refreshing.drives import Drive, Folds
from auditor.identification.systems import System
from auditor.model.arrays import Floats
from auditor.model.calibration import CleanFrames
from auditor.model.checks import SensorCheck

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
        subject = f"{self.check.check.value.replace('_', ' ')} of S_{self.check.sensor}{others and f' by {others}'}"
        if self.deviations is None:
            return f"its frames scatter otherwise than those of others in {subject} (p = {self.p:.1g})"
        where = "above" if self.deviations > 0 else "below"
        return f"its {subject} lies {abs(self.deviations):.1f} deviations {where} that of others (p = {self.p:.1g})"


class _Frames(NamedTuple):
    """The log odds of one check in one drive: their mean, how many frames they are worth, and they about their median.

    `centred` are in ascending order.
    """

    mean: float
    worth: float
    centred: Floats


_OF_DRIVES: WeakKeyDictionary[CleanFrames, dict[SensorCheck, _Frames | None]] = WeakKeyDictionary()
"""By drive: its frames of each check, which are looked at once however often drives are compared."""


@dataclass(frozen=True, eq=False)
class _Sample:
    """The log odds of one check in one drive: their mean, how many frames they are worth, and the distance in shape.

    `distance` is the logarithm of Kolmogorov's and Smirnov's against all drives, each about its own median.
    """

    mean: float
    worth: float
    distance: float


def differing(drives: Sequence[Drive], tested: Sequence[int], system: System) -> dict[int, Difference]:
    """The drives of `tested`, places in `drives`, that are not like those of other vehicles and days, and how.

    The others are those that may judge it; where they are too few nothing can be said, and nobody differs.
    """
    folds = Folds([drive.source for drive in drives])
    differences: list[tuple[float, int, Difference]] = []
    for column in system.counting(frozenset()).tolist():
        check = system.sensor_checks[column]
        samples = _samples(drives, check)
        for place in tested:
            others = [samples[one] for one in folds.others(place, samples.keys())]
            if place in samples and len(others) >= TWO_SAMPLES.fewest_drives:
                differences += [(one.p, place, one) for one in _differences(check, samples[place], others)]
    return dict(_rejected(sorted(differences, key=lambda one: one[:2])))


def _rejected(tests: Sequence[tuple[float, int, Difference]]) -> Iterator[tuple[int, Difference]]:
    """Of tests in the order of their p those that Holm's correction rejects; the clearest of a drive is last."""
    clear = []
    for number, (p, place, difference) in enumerate(tests):
        if p > TWO_SAMPLES.chance / (len(tests) - number):
            break
        clear.append((place, difference))
    return reversed(clear)


def _differences(check: SensorCheck, sample: _Sample, others: Sequence[_Sample]) -> Iterator[Difference]:
    freedom = HIERARCHY.prior_drives + len(others) - 1
    deviations = _of_level(check, sample, others)
    yield Difference(check, deviations, 2 * _beyond(abs(deviations), freedom))
    usual, scatter = _middle([other.distance for other in others])
    yield Difference(
        check, None, _beyond((sample.distance - usual) / _weighed(TWO_SAMPLES.shape, scatter, others), freedom)
    )


def _samples(drives: Sequence[Drive], check: SensorCheck) -> dict[int, _Sample]:
    """The samples of a check by the places of their drives; drives with too few measured frames have none."""
    measured = {place: _frames_of(drive.clean, check) for place, drive in enumerate(drives)}
    frames_of = {place: frames for place, frames in measured.items() if frames is not None}
    if not frames_of:
        return {}
    pool = np.sort(np.concatenate([frames.centred for frames in frames_of.values()]))
    return {place: _sample(frames, pool) for place, frames in frames_of.items()}


def _frames_of(clean: CleanFrames, check: SensorCheck) -> _Frames | None:
    """The frames of a check in a drive; None where too few are measured."""
    cache = _OF_DRIVES.setdefault(clean, {})
    if check not in cache:
        values = clean.statistics.get(check, np.zeros(0))
        odds = log_odds(values[~np.isnan(values)])
        enough = odds.size >= TWO_SAMPLES.fewest_frames
        cache[check] = (
            _Frames(float(odds.mean()), effective_size(odds), np.sort(odds - np.median(odds))) if enough else None
        )
    return cache[check]


def _sample(frames: _Frames, pool: Floats) -> _Sample:
    at = frames.centred
    of_pool = np.searchsorted(pool, at, side="right") / pool.size
    own = np.arange(1, at.size + 1) / at.size
    distance = max(float(np.max(np.abs(own - of_pool))), float(np.max(np.abs(own - 1 / at.size - of_pool))))
    return _Sample(frames.mean, frames.worth, log(distance))


def _of_level(check: SensorCheck, sample: _Sample, others: Sequence[_Sample]) -> float:
    """How many deviations a drive's mean lies above the median of the others'."""
    prior = prior_of_check(check)
    usual, scatter = _middle([other.mean for other in others])
    between = _weighed(prior.between, scatter, others) ** 2
    variance = between * (1 + 1 / len(others)) + prior.within**2 / sample.worth
    return (sample.mean - usual) / (prior.tail * sqrt(variance))


def _middle(values: Sequence[float]) -> tuple[float, float]:
    """The median of values, and their standard deviation as the median distance from it says."""
    middle = float(np.median(values))
    return middle, _MAD * float(np.median(np.abs(np.array(values) - middle)))


def _weighed(prior: float, scatter: float, others: Sequence[_Sample]) -> float:
    """The deviation between drives: that of the others, weighed with the prior's as in a calibration."""
    freedom = HIERARCHY.prior_drives + len(others) - 1
    return sqrt((HIERARCHY.prior_drives * prior**2 + (len(others) - 1) * scatter**2) / freedom)


def _beyond(t: float, freedom: float) -> float:
    """The chance of a larger t, by the normal approximation of Wallace (1959)."""
    z = (8 * freedom + 1) / (8 * freedom + 3) * sqrt(freedom * log(1 + t * t / freedom))
    return float(NormalDist().cdf(-z if t > 0 else z))
