"""Intervals of rates whose cases come in clusters, and what dependent cases are worth: see docs/figures.md."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_DRAWS = 10_000
_LEVEL = 0.05


def clustered_interval(hits: Sequence[int], cases: Sequence[int], seed: int = 0) -> tuple[float, float]:
    """The 95 % interval of sum(hits) / sum(cases) by a bootstrap over clusters, one entry each.

    Without any hit, or with nothing but hits, the bound of Clopper and Pearson for as many cases as clusters.
    """
    k, n = np.array(hits), np.array(cases)
    if not 0 < k.sum() < n.sum():
        beyond = 1 - (_LEVEL / 2) ** (1 / len(n))
        return (0.0, beyond) if k.sum() == 0 else (1 - beyond, 1.0)
    drawn = np.random.default_rng(seed).integers(0, len(n), (_DRAWS, len(n)))
    rates = k[drawn].sum(axis=1) / n[drawn].sum(axis=1)
    low, high = np.quantile(rates, (_LEVEL / 2, 1 - _LEVEL / 2))
    return float(low), float(high)


def effective_size(series: NDArray[np.floating]) -> float:
    """How many independent values a series of (n,) is worth; n where it does not vary."""
    n, centred = len(series), series - series.mean()
    power = float(centred @ centred)
    total = 0.0
    for lag in range(1, n):
        correlation = float(centred[lag:] @ centred[:-lag]) / power if power else 0.0
        if correlation <= 0:
            break
        total += (1 - lag / n) * correlation
    return n / (1 + 2 * total)
