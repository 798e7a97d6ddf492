"""How alike two cameras' pictures are at given disparities."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

_REACH = 3  # a 7 x 7 patch
_SIDE = 2 * _REACH + 1
_PATCH_FLOOR = 9.0  # grey levels, added to each patch's norm: patches without texture are like nothing
_OVERSAMPLING = 2


class Likeness:
    """Zero-mean normalised cross-correlation of 7 x 7 patches between a reference and a witness.

    Both are half-resolution (h, w) grey images. The witness is oversampled once, so that shifts of half a pixel are
    indices.
    """

    def __init__(self, reference: NDArray[np.uint8], witness: NDArray[np.uint8]) -> None:
        self._width = reference.shape[1]
        self._reference = np.pad(reference, _REACH, mode="edge").astype(np.float32)
        self._margin = _OVERSAMPLING * (_REACH + 2)
        self._witness = np.pad(
            _oversampled(witness.astype(np.float32)),
            ((_REACH, _REACH), (self._margin, self._margin)),
            mode="edge",
        )

    def best(
        self,
        row: NDArray[np.integer],
        column: NDArray[np.integer],
        disparity: NDArray[np.float32],
        reach_half_px: int,
    ) -> NDArray[np.float32]:
        """(M,) the largest correlation, -1 to 1, over disparities within `reach_half_px` steps of half a pixel.

        `row`, `column` (M,) and `disparity` (M,) are in half-resolution pixels.
        """
        patch = self._patches(row, column)
        middle = np.rint((column - disparity) * _OVERSAMPLING).astype(np.intp)
        last = self._width * _OVERSAMPLING - 1
        start = np.clip(middle - reach_half_px, 0, last) + self._margin - _OVERSAMPLING * _REACH
        stride = self._witness.shape[1]
        offsets = _offsets(stride, 2 * reach_half_px + 1 + _OVERSAMPLING * (_SIDE - 1), 1)
        strips = self._witness.ravel()[(row * stride + start)[:, None] + offsets]
        strips = strips.reshape(row.size, _SIDE, -1)
        scores = [
            _correlation(patch, strips[:, :, s : s + _OVERSAMPLING * (_SIDE - 1) + 1 : _OVERSAMPLING])
            for s in range(2 * reach_half_px + 1)
        ]
        return np.asarray(np.max(scores, axis=0), dtype=np.float32)

    def _patches(self, row: NDArray[np.integer], column: NDArray[np.integer]) -> NDArray[np.float32]:
        """(M, 7, 7) patches of the reference without their means, divided by their norms."""
        stride = self._reference.shape[1]
        flat = self._reference.ravel()[(row * stride + column)[:, None] + _offsets(stride, _SIDE, 1)]
        flat = flat - flat.mean(axis=1, keepdims=True)
        norm = np.sqrt(np.einsum("mp,mp->m", flat, flat)) + np.float32(_PATCH_FLOOR)
        return np.asarray(flat / norm[:, None], dtype=np.float32).reshape(-1, _SIDE, _SIDE)


def _correlation(patch: NDArray[np.float32], other: NDArray[np.float32]) -> NDArray[np.float32]:
    total = np.einsum("mrc->m", other)
    power = np.einsum("mrc,mrc->m", other, other)
    norm = np.sqrt(np.maximum(power - total * total / np.float32(_SIDE * _SIDE), 0)) + np.float32(_PATCH_FLOOR)
    # The patch has no mean, so that of the other need not be taken away.
    return np.asarray(np.einsum("mrc,mrc->m", patch, other) / norm, dtype=np.float32)


def _oversampled(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """(h, 2 w): each pixel, then its mean with the next."""
    doubled = np.repeat(image, _OVERSAMPLING, axis=1)
    doubled[:, 1:-1:2] = (image[:, :-1] + image[:, 1:]) / 2
    return doubled


@cache
def _offsets(stride: int, width: int, step: int) -> NDArray[np.intp]:
    rows = np.arange(_SIDE, dtype=np.intp) * stride
    columns = np.arange(0, width, step, dtype=np.intp)
    return (rows[:, None] + columns).ravel()
