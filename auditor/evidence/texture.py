"""Where an image has enough texture to be matched."""

import cv2
import numpy as np
from numpy.typing import NDArray

MIN_TEXTURE = 2.0
"""Grey levels a (half-resolution) pixel: root mean square of the horizontal Sobel gradient over 5 x 5 pixels."""

_SOBEL_GAIN = 8


def textured(half: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """(h, w) mask of the pixels of a half-resolution (h, w) grey image whose surroundings have texture."""
    gradient = cv2.Sobel(half, cv2.CV_32F, 1, 0, ksize=3, scale=1 / _SOBEL_GAIN)
    power = cv2.boxFilter(gradient * gradient, cv2.CV_32F, (5, 5))
    return np.asarray(power > MIN_TEXTURE * MIN_TEXTURE)
