"""Images at half resolution, and warped into the view of another camera that shares their rows."""

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.model.arrays import Floats32, Image


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


def warp(image: Image, column: Floats32, how: int = cv2.INTER_LINEAR) -> Image:
    """(h, w) levels of an (h, w) image at columns (h, w) of the same rows, its edges continued on both sides."""
    inside = np.clip(column, 0, image.shape[1] - 1)  # what lies outside would be looked up one by one
    warped = cv2.remap(image, inside, _row_grid(*column.shape), how, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(warped, dtype=np.uint8)


@lru_cache(maxsize=8)
def _row_grid(height: int, width: int) -> Floats32:
    """(height, width) the row of each pixel, as cv2.remap takes it; the same array each time, not to be written to."""
    return np.ascontiguousarray(np.broadcast_to(np.arange(height, dtype=np.float32)[:, None], (height, width)))
