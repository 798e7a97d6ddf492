"""Equalising two images before they are matched: a matcher's cost compares levels, and cameras differ in gain."""

import cv2
import numpy as np

from auditor.measurement.parameters import EQUALISING
from auditor.model.arrays import Image, Indices

_LEVELS = 256
_WHITE = 255
_SHARES = np.linspace(EQUALISING.first_quantile, 1 - EQUALISING.first_quantile, EQUALISING.quantiles)


def equalised(image: Image, like: Image) -> Image:
    """An (H, W) image with its levels moved so that its quantiles are those of another.

    Between the outermost quantiles the map is piecewise linear; beyond them it goes on to black and white.
    """
    own, other = (_quantiles(one) for one in (image, like))
    levels, place = np.unique(own, return_inverse=True)
    if len(levels) < EQUALISING.fewest_levels:
        return image
    wanted = np.bincount(place, weights=other) / np.bincount(place)
    curve = np.interp(np.arange(_LEVELS), [-1, *levels, _LEVELS], [-1, *wanted, _LEVELS])
    return np.asarray(cv2.LUT(image, np.clip(np.rint(curve), 0, _WHITE).astype(np.uint8)), dtype=np.uint8)


def _quantiles(image: Image) -> Indices:
    every = EQUALISING.step_px
    some = np.ascontiguousarray(image[::every, ::every])
    counts = cv2.calcHist([some], [0], None, [_LEVELS], [0, _LEVELS]).ravel().astype(np.intp).cumsum()
    return np.asarray(np.searchsorted(counts, _SHARES * counts[-1]), dtype=np.intp)
