"""Gain and offset between two cameras."""

import numpy as np
from numpy.typing import NDArray

from auditor.evidence.parameters import GAIN_FIT

Grid = NDArray[np.float32]


def fit_gain(target: Grid, source: Grid) -> tuple[np.float32, np.float32]:
    """Gain and offset that take source to target: least squares over the six tenths that fit best, repeated.

    Both are grey levels of one shape. Saturated ones say nothing of either; where hardly any other is left the cameras
    are taken to be equal.
    """
    told = np.maximum(source, target) < GAIN_FIT.saturated
    x, y = source[told], target[told]
    if x.size < GAIN_FIT.fewest:
        return np.float32(1), np.float32(0)
    gain, offset = np.float32(1), np.float32(np.median(y) - np.median(x))
    keep = int(GAIN_FIT.kept_share * x.size)
    for _ in range(GAIN_FIT.rounds):
        best = np.argpartition(np.abs(gain * x + offset - y), keep)[:keep]
        mean_x, mean_y = x[best].mean(), y[best].mean()
        spread = x[best] - mean_x
        gain = np.clip(np.dot(spread, y[best] - mean_y) / max(np.dot(spread, spread), np.float32(1)), *GAIN_FIT.gains)
        offset = mean_y - gain * mean_x
    return np.float32(gain), np.float32(offset)
