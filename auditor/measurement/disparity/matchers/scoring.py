"""How far a matcher's disparities are from known ones."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auditor.measurement.disparity.half_resolution import grey
from auditor.measurement.disparity.matchers.interface import Matcher

_FAR_PX = 3.0

Sample = tuple[NDArray[np.uint8], NDArray[np.uint8], NDArray[np.floating]]
"""Left and right image (H, W, 3) BGR, and the disparities (H, W) of the left one in pixels, NaN where unknown."""


@dataclass(frozen=True)
class Score:
    """Over `pixels` with known disparities: mean of |d - truth| in pixels, and the share over 3 px.

    A pixel without a disparity is over 3 px and has no part in the mean, which is None where none has one.
    """

    pixels: int
    mean_px: float | None
    over_3px_share: float | None


def score(matcher: Matcher, samples: Iterable[Sample], *, least_px: float = 0.0) -> Score:
    """Compare a matcher with known disparities on the pixels whose truth is above `least_px`.

    Give two matchers the same samples and they are compared on the same pixels, at full resolution.
    """
    pixels = found = far = 0
    total = 0.0
    for left, right, truth in samples:
        inputs = (left, right) if matcher.colour else (grey(left), grey(right))
        disparity = matcher.match(*inputs).repeat(matcher.step, axis=0).repeat(matcher.step, axis=1)
        known = truth > least_px  # False where it is NaN
        error = np.abs(disparity[: truth.shape[0], : truth.shape[1]][known] - truth[known])
        pixels += error.size
        found += int(np.count_nonzero(~np.isnan(error)))
        far += int(np.count_nonzero(~(error <= _FAR_PX)))
        total += float(np.nansum(error, dtype=np.float64))
    return Score(pixels, total / found if found else None, far / pixels if pixels else None)
