"""Shares whose cases come in drives, with 95 % intervals: cases of one drive depend on each other."""

from collections.abc import Sequence
from math import sqrt
from typing import NamedTuple

from auditor.identification.cross_validation import wilson

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
