"""The array types that all rooms share: what their numbers are, and the shapes that they usually have.

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
