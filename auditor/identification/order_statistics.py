"""Values of many drives in ascending order, and what they are without those of some drives: nothing is sorted again."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from auditor.model.arrays import Floats, Indices


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
        known = values[~np.isnan(values)]
        self._measured[drive] = self._measured.get(drive, 0) + known.size
        self._take(known, np.full(known.size, drive, dtype=np.intp))

    def join(self, other: "Largest", first: int) -> None:
        """Take the values of other drives, which are numbered from `first` on."""
        self._measured.update((first + drive, count) for drive, count in other._measured.items())
        for values, drives in zip(other._values, other._drives, strict=True):
            self._take(values, drives + first)

    def ordered(self, drives: int) -> "Ordered":
        """The largest values in ascending order, of so many drives."""
        values, of = self._cut()
        order = np.argsort(values, kind="stable")
        measured = np.zeros(drives, dtype=np.intp)
        for drive, count in self._measured.items():
            measured[drive] = count
        return Ordered(values[order], of[order], measured)

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


class Ordered:
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
