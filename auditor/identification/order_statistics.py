"""Values in ascending order, and what they are without some of them: nothing is sorted again."""

from collections.abc import Sequence

import numpy as np

from auditor.model.arrays import Floats


def ascending(columns: Sequence[Floats]) -> Floats:
    """What was measured in all columns, in ascending order; NaN was not."""
    values = np.concatenate(columns) if columns else np.zeros(0)
    return np.sort(values[~np.isnan(values)])


class Largest:
    """The largest of many values, so `many` of them at least where there are as many; the others are only counted."""

    def __init__(self, many: int) -> None:
        self._many = many
        self._values: list[Floats] = []
        self._below = 0

    def add(self, values: Floats) -> None:
        """Take what was measured; NaN was not."""
        self._values.append(values[~np.isnan(values)])
        if sum(one.size for one in self._values) > self._many + max(self._many, values.size):
            self._cut()

    @property
    def ascending(self) -> tuple[Floats, int]:
        """The largest values in ascending order, and how many others there were, none of which is larger."""
        if self._below:
            self._cut()
        return ascending(self._values), self._below

    def _cut(self) -> None:
        values = np.concatenate(self._values)
        cut = max(values.size - self._many, 0)
        self._values, self._below = [np.partition(values, cut)[cut:] if cut else values], self._below + cut


class Without:
    """The N values of `whole`, and as many as are `below` them, without `some` of all these; all in ascending order."""

    def __init__(self, whole: Floats, some: Floats, below: int = 0) -> None:
        self.size = below + whole.size - some.size
        if below:  # of values that equal the smallest known one, those that are known go first
            first, end = (int(np.searchsorted(some, whole[0], side=side)) for side in ("left", "right"))
            unknown = max(end - first - int(np.searchsorted(whole, whole[0], side="right")), 0)
            below, some = below - first - unknown, some[first + unknown :]
        self._whole, self._below = whole, below
        self._before = np.searchsorted(whole, some)  # how many of those that stay lie before each that goes
        if some.size:
            again = np.arange(some.size) - np.searchsorted(some, some)
            self._before += again - np.arange(some.size)

    def at(self, rank: int) -> float:
        """The value of a rank, the first being rank 0; it must not be one of those that are below what is known."""
        rank -= self._below
        return float(self._whole[rank + np.searchsorted(self._before, rank, side="right")])

    def quantile(self, share: float) -> float:
        """As `numpy.quantile` of them, between two values on the line through both."""
        place = share * (self.size - 1)
        below = int(place)
        above = min(below + 1, self.size - 1)
        return float(np.quantile([self.at(below), self.at(above)], place - below))
