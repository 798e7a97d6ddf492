"""Which of two images is darker where they are inconsistent: dirt takes light away, a laser adds it."""

import cv2
import numpy as np

from auditor.measurement.checks.photometric_consistency import PairConsistency
from auditor.measurement.disparity.stereo import StereoMap
from auditor.measurement.parameters import CONTRAST, HALF, PATCH_CORRELATION
from auditor.model.arrays import Image, Mask
from auditor.model.checks import Contrast


def contrast(reference: Image, source: Image, consistency: PairConsistency, stereo: StereoMap) -> Contrast:
    """Compare two `smoothed` images at their inconsistent pixels, at stereo's disparities.

    The difference of the cameras' gains and offsets is estimated at consistent pixels, and taken off.
    """
    inconsistent = int(np.count_nonzero(consistency.inconsistent))
    if inconsistent < CONTRAST.fewest:
        return Contrast(inconsistent)
    usual = consistency.comparable & (consistency.ncc > PATCH_CORRELATION.consistent)
    # Of a blinded camera a few patches are consistent by chance.
    fewest = max(CONTRAST.fewest, CONTRAST.least_share * np.count_nonzero(consistency.comparable))
    expected = _difference(reference, source, stereo, usual) if np.count_nonzero(usual) >= fewest else 0.0
    return Contrast(inconsistent, _difference(reference, source, stereo, consistency.inconsistent) - expected)


def smoothed(half: Image) -> Image:
    """The means over 7 x 7 pixels of a half-resolution (h, w) grey image."""
    return np.asarray(cv2.boxFilter(half, cv2.CV_8U, CONTRAST.window_px), dtype=np.uint8)


def _difference(reference: Image, source: Image, stereo: StereoMap, where: Mask) -> float:
    """The median of reference less source over about 2,000 of the pixels set."""
    place = np.flatnonzero(where)
    place = place[:: max(place.size // CONTRAST.most, 1)]
    row, column = place // where.shape[1], place % where.shape[1]
    step = HALF // stereo.step
    disparity = stereo.disparity_px[row * step, column * step] / np.float32(HALF)
    there = np.clip(np.rint(column - disparity).astype(np.intp), 0, source.shape[1] - 1)
    return float(np.median(reference[row, column].astype(np.float32) - source[row, there]))
