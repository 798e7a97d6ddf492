"""Gain and offset between two cameras."""

import numpy as np
from numpy.typing import NDArray

SATURATED = 250.0
"""Grey levels from which on a brightness says nothing."""

_ROUNDS = 6
_KEPT_SHARE = 0.6
_FEWEST = 100
_GAINS = (0.5, 2.0)

Grid = NDArray[np.float32]


def fit_gain(target: Grid, source: Grid) -> tuple[np.float32, np.float32]:
    """Gain and offset that take source to target: least squares over the six tenths that fit best, repeated.

    Both are grey levels of one shape. Saturated ones say nothing of either; where hardly any other is left the cameras
    are taken to be equal.
    """
    told = np.maximum(source, target) < SATURATED
    x, y = source[told], target[told]
    if x.size < _FEWEST:
        return np.float32(1), np.float32(0)
    gain, offset = np.float32(1), np.float32(np.median(y) - np.median(x))
    keep = int(_KEPT_SHARE * x.size)
    for _ in range(_ROUNDS):
        best = np.argpartition(np.abs(gain * x + offset - y), keep)[:keep]
        mean_x, mean_y = x[best].mean(), y[best].mean()
        spread = x[best] - mean_x
        gain = np.clip(np.dot(spread, y[best] - mean_y) / max(np.dot(spread, spread), np.float32(1)), *_GAINS)
        offset = mean_y - gain * mean_x
    return np.float32(gain), np.float32(offset)
