"""Where an image has enough texture to be matched."""

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.evidence.parameters import TEXTURE

_SOBEL_PX, _SOBEL_GAIN = 3, 8
"""The smallest Sobel kernel, and the sum of its weights' sizes."""


def textured(half: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """(h, w) mask of the pixels of a half-resolution (h, w) grey image whose surroundings have texture.

    Texture is the root mean square of the horizontal Sobel gradient, in grey levels a pixel.
    """
    gradient = cv2.Sobel(half, cv2.CV_32F, 1, 0, ksize=_SOBEL_PX, scale=1 / _SOBEL_GAIN)
    power = cv2.boxFilter(gradient * gradient, cv2.CV_32F, TEXTURE.window_px)
    return np.asarray(power > TEXTURE.fewest_levels * TEXTURE.fewest_levels)
