"""Thresholds theta at a designated false-alarm rate r (Eq. 3 and 9), and what they may be used for.

Values of many drives are kept in ascending order: what they are without those of some drives needs no sort.
"""

import json
from collections.abc import Iterator, Sequence
from decimal import ROUND_FLOOR, Decimal, InvalidOperation, localcontext
from functools import cached_property

import numpy as np

from auditor.errors import SettingError, ThresholdsError
from auditor.model.arrays import Floats, Indices
from auditor.model.calibration import Calibration, Thresholds
from auditor.model.measurement import Procedure, Statistic
from auditor.model.rig_kind import RigKind, Similarity

BELOW_EVERY_ERROR = -1.0
"""theta at r = 1, where every sample has to lie above it; disparity errors are never negative."""

DIGITS_OF_A_COUNT = 20


def parse_r(text: str) -> Decimal:
    """The designated false-alarm rate r, written as '0.01' or as '1%'. Raises SettingError."""
    number = text.strip()
    try:
        r = Decimal(number.removesuffix("%").strip())
    except InvalidOperation:
        raise SettingError(f"{text!r} is not a number", where="r", remedy="write it as 0.01 or 1%") from None
    if number.endswith("%"):
        with localcontext(prec=len(r.as_tuple().digits) + DIGITS_OF_A_COUNT):
            r = r.scaleb(-2) if r.is_finite() else r
    checked(r)
    return r


def threshold(samples: Sequence[float], r: Decimal) -> float:
    """Theta_r: the sample of rank N - floor(r N), the first being rank 1; -1 at r = 1 (Eq. 3).

    `samples` are N clean disparity errors in ascending order. Without ties exactly floor(r N) of them lie above theta,
    with ties at most. Raises ThresholdsError where N = 0 and SettingError where r is not in [0, 1].
    """
    rank = threshold_rank(len(samples), r)
    return float(samples[rank - 1]) if rank > 0 else BELOW_EVERY_ERROR


def threshold_rank(N: int, r: Decimal) -> int:
    """The rank of Theta_r among N samples, the first being rank 1; 0 where it lies below all of them.

    Raises ThresholdsError where N = 0 and SettingError where r is not in [0, 1].
    """
    checked(r)
    if N == 0:
        raise ThresholdsError("no clean samples to take theta from", remedy="calibrate on clean recordings")
    return N - _outliers(r, N)


def resolvable(r: Decimal, N: int) -> bool:
    """False where 0 < r < 1/N: with N samples such a rate cannot be told from r = 0."""
    checked(r)
    return r == 0 or _outliers(r, N) > 0


def thresholds_at(
    calibration: Calibration, statistic: Statistic, r: Decimal, *, transferred: bool = False
) -> Thresholds:
    """Thresholds at r, for every triple that the calibration has samples of.

    `transferred` says that the calibration is of another rig kind. Raises ThresholdsError where no triple has samples,
    and SettingError where r is not in [0, 1].
    """
    samples = {
        triple: values
        for (measured, triple), values in calibration.samples.items()
        if measured is statistic and len(values) > 0
    }
    if not samples:
        raise ThresholdsError(
            f"no clean samples of the {statistic} disparity error",
            where=f"calibration {calibration.calibration_id}",
            remedy="calibrate on clean recordings in which at least three sensors overlap",
        )
    return Thresholds(
        calibration_id=calibration.calibration_id,
        statistic=statistic,
        r=r,
        theta={triple: threshold(values, r) for triple, values in samples.items()},
        samples={triple: len(values) for triple, values in samples.items()},
        resolvable=all(resolvable(r, len(values)) for values in samples.values()),
        transferred=transferred,
    )


def check_calibration(
    calibration: Calibration, *, rig_kind: RigKind, procedure: Procedure, transfer: bool = False
) -> Similarity:
    """Refuse thresholds of measurements that were made otherwise; say how alike the rig kinds are.

    A similar kind is accepted, another one only with `transfer`; another matcher, other settings or another counting
    version never are. Raises ThresholdsError that says what differs and what to do.
    """
    where = f"calibration {calibration.calibration_id}"
    differences = list(_differences(calibration.procedure, procedure))
    if differences:
        raise ThresholdsError(
            "its thresholds are for measurements made otherwise: " + ", ".join(differences),
            where=where,
            remedy="calibrate again with the same matcher and settings, or measure again with the calibration's",
        )
    similarity = calibration.part.similarity if calibration.part else calibration.rig_kind.similarity(rig_kind)
    if similarity is Similarity.OTHER and not transfer:
        raise ThresholdsError(
            f"its thresholds are for another rig kind: {calibration.rig_kind}, where this one is {rig_kind}",
            where=where,
            remedy="calibrate on clean recordings of this rig kind, or ask for a transfer, which the verdicts will say",
        )
    return similarity


def _differences(calibrated: Procedure, measured: Procedure) -> Iterator[str]:
    if calibrated.matcher != measured.matcher:
        yield f"matcher {calibrated.matcher}, not {measured.matcher}"
    if calibrated.settings != measured.settings:
        yield f"settings {_differing(calibrated.settings, measured.settings)}"
    if calibrated.counting_version != measured.counting_version:
        yield f"counting version {calibrated.counting_version}, not {measured.counting_version}"


def _differing(calibrated: str, measured: str) -> str:
    """The entries of two settings texts that differ; the texts themselves where they are not JSON objects."""
    try:
        ours, theirs = json.loads(calibrated), json.loads(measured)
    except json.JSONDecodeError:
        return f"{calibrated}, not {measured}"
    if not (isinstance(ours, dict) and isinstance(theirs, dict)):
        return f"{calibrated}, not {measured}"
    names = sorted(name for name in ours.keys() | theirs.keys() if ours.get(name) != theirs.get(name))
    return ", ".join(f"{name} {ours.get(name)}, not {theirs.get(name)}" for name in names)


def checked(r: Decimal) -> Decimal:
    """The rate itself. Raises SettingError where it is not in [0, 1]."""
    if not (r.is_finite() and 0 <= r <= 1):
        raise SettingError(f"{r} is not between 0 and 1", where="r", remedy="write it as 0.01 or 1%")
    return r


def _outliers(r: Decimal, N: int) -> int:
    """floor(r N), in arithmetic precise enough to be exact."""
    with localcontext(prec=len(r.as_tuple().digits) + DIGITS_OF_A_COUNT):
        return int((r * N).to_integral_value(ROUND_FLOOR))


class Largest:
    """The largest values of drives 0, 1, ..., so `many` of all at least where there are as many.

    The others are only counted, by drive.
    """

    def __init__(self, many: int) -> None:
        self._many = many
        self._values: list[Floats] = []
        self._drives: list[Indices] = []
        self._kept = 0
        self._measured: dict[int, int] = {}

    def add(self, values: Floats, drive: int) -> None:
        """Take what was measured in a drive; NaN was not."""
        measured = values[~np.isnan(values)]
        self._measured[drive] = self._measured.get(drive, 0) + measured.size
        self._take(measured, np.full(measured.size, drive, dtype=np.intp))

    def join(self, other: "Largest", first: int) -> None:
        """Take the values of other drives, which are numbered from `first` on."""
        self._measured.update((first + drive, count) for drive, count in other._measured.items())
        for values, drives in zip(other._values, other._drives, strict=True):
            self._take(values, drives + first)

    def ordered(self, drives: int) -> "LargestValues":
        """The largest values in ascending order, of so many drives."""
        values, of = self._cut()
        order = np.argsort(values, kind="stable")
        measured = np.zeros(drives, dtype=np.intp)
        for drive, count in self._measured.items():
            measured[drive] = count
        return LargestValues(values[order], of[order], measured)

    def _take(self, values: Floats, drives: Indices) -> None:
        self._values.append(values)
        self._drives.append(drives)
        self._kept += values.size
        if self._kept > self._many + max(self._many, values.size):
            values, drives = self._cut()
            self._values, self._drives, self._kept = [values], [drives], values.size

    def _cut(self) -> tuple[Floats, Indices]:
        """The largest values and their drives, so many as are wanted where some have gone already or there are more."""
        if not self._values:
            return np.zeros(0), np.zeros(0, dtype=np.intp)
        values, drives = np.concatenate(self._values), np.concatenate(self._drives)
        if values.size <= self._many:
            return values, drives
        kept = np.argpartition(values, values.size - self._many)[values.size - self._many :]
        return values[kept], drives[kept]


class LargestValues:
    """The largest values (K,) in ascending order, the drive (K,) of each, and how many each drive has in all (D,)."""

    def __init__(self, values: Floats, drives: Indices, measured: Indices) -> None:
        self.values = values
        self.measured = measured
        self._drives = drives

    def without(self, gone: Sequence[int]) -> "Others":
        """What is left without the values of some drives."""
        places = np.sort(np.concatenate([self._places_of(drive) for drive in gone])) if gone else self._order[:0]
        size = int(self.measured.sum() - self.measured[list(gone)].sum())
        return Others(self.values, places, size)

    def _places_of(self, drive: int) -> Indices:
        return self._order[self._bounds[drive] : self._bounds[drive + 1]]

    @cached_property
    def _order(self) -> Indices:
        """The places of the values by drive, ascending in each."""
        return np.argsort(self._drives, kind="stable")

    @cached_property
    def _bounds(self) -> Indices:
        return np.searchsorted(self._drives[self._order], np.arange(self.measured.size + 1))


class Others:
    """What is left of values in ascending order, the largest of `size` in all, without those at some places."""

    def __init__(self, values: Floats, gone: Indices, size: int) -> None:
        self.size = size
        self._values = values
        self._below = size - (values.size - gone.size)
        self._before = gone - np.arange(gone.size)  # how many of those that stay lie before each that goes

    def at(self, rank: int) -> float:
        """The value of a rank, the first being rank 0; it must not be one of those that were only counted."""
        rank -= self._below
        return float(self._values[rank + np.searchsorted(self._before, rank, side="right")])

    def quantile(self, share: float) -> float:
        """As `numpy.quantile` of them, between two values on the line through both."""
        place = share * (self.size - 1)
        below = int(place)
        above = min(below + 1, self.size - 1)
        return float(np.quantile([self.at(below), self.at(above)], place - below))
