"""Semi-global matching with OpenCV: dense, since pixels without a match are where an attack hides."""

from dataclasses import dataclass, replace
from math import ceil

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.measurement.disparity.half_resolution import halve
from auditor.measurement.parameters import EQUALISING, SGBM
from auditor.model.arrays import Image, Indices
from auditor.model.canonical import canonical_json

_LEVELS = 256
_WHITE = 255
_NO_CHECK = 1 << 20  # so large a difference of left and right leaves nothing out (docs/decisions.md, dense matching)
_SAMPLED_PX = 2  # between the pixels that quantiles are taken of: it bounds the work
_FEWEST_LEVELS = 2  # fewer are one level, and have no quantiles

_SHARES = np.linspace(EQUALISING.first_quantile, 1 - EQUALISING.first_quantile, EQUALISING.quantiles)


def equalised(image: Image, like: Image) -> Image:
    """An (H, W) image with its levels moved so that its quantiles are those of another.

    Between the outermost quantiles the map is piecewise linear; beyond them it goes on to black and white.
    """
    own, other = (_quantiles(one) for one in (image, like))
    levels, place = np.unique(own, return_inverse=True)
    if len(levels) < _FEWEST_LEVELS:
        return image
    wanted = np.bincount(place, weights=other) / np.bincount(place)
    curve = np.interp(np.arange(_LEVELS), [-1, *levels, _LEVELS], [-1, *wanted, _LEVELS])
    return np.asarray(cv2.LUT(image, np.clip(np.rint(curve), 0, _WHITE).astype(np.uint8)), dtype=np.uint8)


def _quantiles(image: Image) -> Indices:
    every = _SAMPLED_PX
    some = np.ascontiguousarray(image[::every, ::every])
    counts = cv2.calcHist([some], [0], None, [_LEVELS], [0, _LEVELS]).ravel().astype(np.intp).cumsum()
    return np.asarray(np.searchsorted(counts, _SHARES * counts[-1]), dtype=np.intp)


_BLOCK = SGBM.block_px
_SIXTEENTHS = 16  # OpenCV's disparities are whole numbers of them
_RANGE_STEP = 16  # and it searches multiples of so many


@dataclass(frozen=True)
class SgbmMatcher:
    """SGBM_3WAY without any filter that would leave pixels out (uniqueness, left-right check, speckles).

    At half resolution (step 2) a pair takes a tenth of the time of full-resolution SGBM and detects no worse.
    """

    step: int = 2
    range_px: int = SGBM.range_px
    colour: bool = False

    @property
    def name(self) -> str:
        """Name on the command line and in the store."""
        return "sgbm" if self.step == 2 else "sgbm-full"

    @property
    def settings(self) -> str:
        """Canonical JSON of everything that changes a disparity."""
        values = {
            "block": _BLOCK,
            "equalised": True,
            "mode": "3way",
            "nearest_m": SGBM.nearest_m,
            "range_px": self.range_px,
            "step": self.step,
        }
        return canonical_json(values)

    def reaching(self, disparity_1m_px: float) -> "SgbmMatcher":
        """The same that searches no nearer than `nearest_m`: a pair 7 cm apart takes half of the time."""
        multiple_px = _RANGE_STEP * self.step
        needed_px = ceil(disparity_1m_px / SGBM.nearest_m / multiple_px) * multiple_px
        return replace(self, range_px=min(max(needed_px, multiple_px), self.range_px))

    def match(self, left: NDArray[np.uint8], right: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Disparities (ceil(H / step), ceil(W / step)) of two (H, W) grey images, in full-resolution pixels."""
        if self.step == 2:
            left, right = halve(left), halve(right)
        right = equalised(right, left)  # the cost compares levels: half the gain sends bright walls to a wrong depth
        # Without the border SGBM gives no disparity in the leftmost `border_px` columns of the left image.
        border_px = self.range_px // self.step
        matcher = cv2.StereoSGBM.create(
            minDisparity=0,
            numDisparities=border_px,
            blockSize=_BLOCK,
            P1=SGBM.smoothness_1 * _BLOCK * _BLOCK,
            P2=SGBM.smoothness_2 * _BLOCK * _BLOCK,
            disp12MaxDiff=_NO_CHECK,
            mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
        )
        # Negative where there is no match.
        fixed = matcher.compute(_bordered(left, border_px), _bordered(right, border_px))[:, border_px:]
        disparity = fixed.astype(np.float32) * np.float32(self.step / _SIXTEENTHS)
        disparity[fixed < 0] = np.nan
        return disparity


def _bordered(image: NDArray[np.uint8], border_px: int) -> cv2.typing.MatLike:
    return cv2.copyMakeBorder(image, 0, 0, border_px, 0, cv2.BORDER_REPLICATE)
