"""Looking up pixels: some of an image, or all of a warped one."""

from functools import lru_cache
from typing import Any, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.model.arrays import Floats32, Image

Scalar = TypeVar("Scalar", bound=np.generic)


def picked(image: NDArray[Scalar], row: NDArray[np.integer[Any]], column: NDArray[np.integer[Any]]) -> NDArray[Scalar]:
    """(M,) values of an image (h, w) in rows and columns (M,): as an index of two arrays does, in a sixth of its time."""
    return image.ravel().take(row * image.shape[1] + column)


def warp(image: Image, column: Floats32, how: int = cv2.INTER_LINEAR) -> Image:
    """(h, w) levels of an (h, w) image at columns (h, w) of the same rows, its edges continued on both sides."""
    inside = cv2.max(column, 0.0)  # what lies left of the image would be looked up one by one
    warped = cv2.remap(image, inside, _row_grid(*column.shape), how, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(warped, dtype=np.uint8)


@lru_cache(maxsize=8)
def _row_grid(height: int, width: int) -> Floats32:
    """(height, width) the row of each pixel, as cv2.remap takes it; the same array each time, not to be written to."""
    return np.ascontiguousarray(np.broadcast_to(np.arange(height, dtype=np.float32)[:, None], (height, width)))
