"""Seeded noise that textures and shapes are made of."""

import numpy as np
from numpy.typing import NDArray

Plane = NDArray[np.float32]


def rough(rng: np.random.Generator, shape: tuple[int, int], slope: float, coarsest: float = 1.0) -> Plane:
    """Periodic (h, w) noise, mean 0, standard deviation 1, whose amplitude falls with frequency to the power `slope`.

    Waves longer than 1 / `coarsest` of the side are left out: slope 0 is white noise, slope 1 looks like clouds.
    """
    spectrum = np.fft.rfft2(rng.standard_normal(shape))
    rows = np.fft.fftfreq(shape[0]) * shape[0]
    columns = np.fft.rfftfreq(shape[1]) * shape[1]
    frequency = np.hypot(rows[:, None], columns[None, :])
    with np.errstate(divide="ignore"):
        weight = np.where(frequency >= coarsest, frequency**-slope, 0.0)
    plane = np.fft.irfft2(spectrum * weight, shape)
    return np.asarray((plane - plane.mean()) / plane.std(), dtype=np.float32)


def smoothed(plane: Plane, passes: int) -> Plane:
    """A periodic plane after so many passes of a 1-2-1 filter along both axes."""
    for _ in range(passes):
        for axis in (0, 1):
            plane = np.float32(0.25) * (np.roll(plane, 1, axis) + np.roll(plane, -1, axis)) + np.float32(0.5) * plane
    return plane
