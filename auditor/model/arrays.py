"""The array types that all rooms share: what their numbers are, and the shapes that they usually have; quantiles.

Two names of one dtype differ in meaning. Where a shape matters, the docstring that uses the type gives it.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
"""Statistics, thresholds and scores: (F,) by frame, or (F, M) by frame and sensor check. NaN is not measured."""

Matrix = NDArray[np.float64]
"""Vectors, rotations, motions and projections: (3,), (3, 3), (4, 4), (3, 4)."""

Floats32 = NDArray[np.float32]
"""Pixelwise or pointwise numbers, such as disparities in px: (H, W) or (M,)."""

Points = NDArray[np.float32]
"""Coordinates: (N, 3) in metres, or (N, 2) in pixels."""

Image = NDArray[np.uint8]
"""Grey levels: (H, W), or (H, W, 3) BGR."""

Mask = NDArray[np.bool_]
"""Chosen pixels or points: (H, W) or (M,)."""

Flags = NDArray[np.bool_]
"""What holds in each frame: (F,), or (F, S) by frame and sensor, or (F, M) by frame and sensor check."""

Integers = NDArray[np.int64]
"""Stamps in nanoseconds, numbers of runs, fingerprints: (F,) or (F, S)."""

Indices = NDArray[np.intp]
"""Places in another array: (M,)."""


def quantile_of(ordered: Floats | Floats32 | Integers | Image, share: float) -> float:
    """As `np.quantile` of values (M,) in ascending order, none of them NaN: it takes most of its time for arguments.

    Both interpolate between neighbours in the same way, so that the result is the same to the last bit.
    """
    place = (ordered.size - 1) * share
    below = int(place)
    lower, upper = ordered[below], ordered[min(below + 1, ordered.size - 1)]
    part, step = place - below, upper - lower
    return float(lower + step * part if 2 * part < 1 else upper - step * (1 - part))


def median_of(ordered: Floats | Floats32 | Integers) -> float:
    """As `np.median` of values (M,) in ascending order, none of them NaN."""
    return float((ordered[(ordered.size - 1) // 2] + ordered[ordered.size // 2]) / 2)
