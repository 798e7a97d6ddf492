"""Margins z: how far a statistic lies above its threshold, in units that all witnesses share."""

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal

import numpy as np
from numpy.typing import NDArray

from auditor.identification.elements import Witness
from auditor.identification.thresholds import threshold

LOWEST, HIGHEST = -2.0, 3.0

_RATIO_CAP = 0.95
_RATIO_MARGIN = 0.2
_RATIO_FLOORS = {Witness.CONTRADICTED: 0.5, Witness.UNLIKE: 0.3}
_LIGHT_FACTOR = 2.0
_LIGHT_FLOOR = 0.02
_SPREAD_QUANTILE = 0.95

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Yardstick:
    """theta of one element, and the scale of its margins: z = (x - theta) / scale, clipped to -2 .. 3."""

    theta: float
    scale: float
    samples: int


def yardstick(witness: Witness, samples: Sequence[float], r: Decimal) -> Yardstick:
    """Take theta at r from N clean statistics in ascending order, and add what carries it to other drives.

    Local ratios end at 1, and one clean window at 1 would silence an element for good: their quantile is capped at
    0.95 before a fifth of what is left is added. A few easy drives must not make the threshold of all others: theta
    never falls below a floor, half of a window's beams for contradictions. Raises ThresholdsError where N = 0.
    """
    quantile = threshold(samples, r)
    if witness is Witness.LIGHT:
        theta = max(_LIGHT_FACTOR * quantile, _LIGHT_FLOOR)
    else:
        capped = min(quantile, _RATIO_CAP)
        theta = max(capped + _RATIO_MARGIN * (1 - capped), _RATIO_FLOORS[witness])
    spread = float(np.quantile(samples, _SPREAD_QUANTILE) - np.median(samples))
    return Yardstick(theta, max(spread, theta / 4), len(samples))


def margins(statistics: Floats, yardsticks: Sequence[Yardstick | None]) -> Floats:
    """(F, M) margins z of (F, M) statistics, NaN where not measured or without a yardstick; raised where z > 0."""
    theta = np.array([np.nan if y is None else y.theta for y in yardsticks])
    scale = np.array([np.nan if y is None else y.scale for y in yardsticks])
    return np.asarray(np.clip((statistics - theta) / scale, LOWEST, HIGHEST))
