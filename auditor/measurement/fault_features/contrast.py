"""Which of two pictures is the darker where they differ: dirt takes light away, a laser brings it."""

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.measurement.checks.photometric_consistency import PairConsistency
from auditor.measurement.disparity.stereo import StereoMap
from auditor.measurement.parameters import CONTRAST, HALF, PATCH_CORRELATION
from auditor.model.checks import Contrast

Image = NDArray[np.uint8]


def contrast(reference: Image, source: Image, alike: PairConsistency, stereo: StereoMap) -> Contrast:
    """Compare two `smoothed` pictures where they are unlike, at stereo's disparities.

    What the cameras' gains and offsets make different is learnt where they are alike.
    """
    unlike = int(np.count_nonzero(alike.unlike))
    if unlike < CONTRAST.fewest:
        return Contrast(unlike)
    usual = alike.comparable & (alike.alike > PATCH_CORRELATION.consistent)
    # Of a blinded camera a few places look alike by chance.
    fewest = max(CONTRAST.fewest, CONTRAST.least_share * np.count_nonzero(alike.comparable))
    expected = _apart(reference, source, stereo, usual) if np.count_nonzero(usual) >= fewest else 0.0
    return Contrast(unlike, _apart(reference, source, stereo, alike.unlike) - expected)


def smoothed(half: Image) -> Image:
    """The means over 7 x 7 pixels of a half-resolution (h, w) grey image."""
    return np.asarray(cv2.boxFilter(half, cv2.CV_8U, CONTRAST.window_px), dtype=np.uint8)


def _apart(reference: Image, source: Image, stereo: StereoMap, where: NDArray[np.bool_]) -> float:
    """The median of reference less witness over about 2,000 of the pixels set."""
    place = np.flatnonzero(where)
    place = place[:: max(place.size // CONTRAST.most, 1)]
    row, column = place // where.shape[1], place % where.shape[1]
    step = HALF // stereo.step
    disparity = stereo.disparity_px[row * step, column * step] / np.float32(HALF)
    there = np.clip(np.rint(column - disparity).astype(np.intp), 0, source.shape[1] - 1)
    return float(np.median(reference[row, column].astype(np.float32) - source[row, there]))
