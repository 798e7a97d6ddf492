"""Values in ascending order, and what they are without some of them: nothing is sorted again."""

from collections.abc import Sequence

import numpy as np

from auditor.model.arrays import Floats


def ascending(columns: Sequence[Floats]) -> Floats:
    """What was measured in all columns, in ascending order; NaN was not."""
    values = np.concatenate(columns) if columns else np.zeros(0)
    return np.sort(values[~np.isnan(values)])


class Without:
    """The N values of `whole` without `some` of them, both in ascending order."""

    def __init__(self, whole: Floats, some: Floats) -> None:
        self._whole = whole
        self.size = whole.size - some.size
        self._before = np.searchsorted(whole, some)  # how many of those that stay lie before each that goes
        if some.size:
            again = np.arange(some.size) - np.searchsorted(some, some)
            self._before += again - np.arange(some.size)

    def at(self, rank: int) -> float:
        """The value of a rank, the first being rank 0."""
        return float(self._whole[rank + np.searchsorted(self._before, rank, side="right")])

    def quantile(self, share: float) -> float:
        """As `numpy.quantile` of them, between two values on the line through both."""
        place = share * (self.size - 1)
        below = int(place)
        above = min(below + 1, self.size - 1)
        return float(np.quantile([self.at(below), self.at(above)], place - below))
