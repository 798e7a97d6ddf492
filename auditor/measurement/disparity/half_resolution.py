"""Images at half resolution."""

import cv2
import numpy as np
from numpy.typing import NDArray


def grey(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(H, W) grey of an (H, W) grey or (H, W, 3) BGR image."""
    if pixels.ndim == 2:
        return pixels
    return np.asarray(cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY), dtype=np.uint8)


def halve(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(ceil(H / 2), ceil(W / 2)) means of 2 x 2 pixels; an odd last row or column is repeated first."""
    height, width = pixels.shape[:2]
    if height % 2 or width % 2:
        pixels = np.asarray(cv2.copyMakeBorder(pixels, 0, height % 2, 0, width % 2, cv2.BORDER_REPLICATE), np.uint8)
    size = ((width + 1) // 2, (height + 1) // 2)
    return np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
