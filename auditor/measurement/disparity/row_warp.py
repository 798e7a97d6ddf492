"""Warping the image of one camera into the view of another that shares its rows."""

from functools import lru_cache

import cv2
import numpy as np

from auditor.model.arrays import Floats32, Image


def warp(image: Image, column: Floats32, how: int = cv2.INTER_LINEAR) -> Image:
    """(h, w) levels of an (h, w) image at columns (h, w) of the same rows, its edges continued on both sides."""
    inside = np.clip(column, 0, image.shape[1] - 1)  # what lies outside would be looked up one by one
    warped = cv2.remap(image, inside, _row_grid(*column.shape), how, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(warped, dtype=np.uint8)


@lru_cache(maxsize=8)
def _row_grid(height: int, width: int) -> Floats32:
    """(height, width) the row of each pixel, as cv2.remap takes it; the same array each time, not to be written to."""
    return np.ascontiguousarray(np.broadcast_to(np.arange(height, dtype=np.float32)[:, None], (height, width)))
