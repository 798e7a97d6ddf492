"""The largest upright rectangle inside a mask."""

import numpy as np
from numpy.typing import NDArray


def largest_rectangle(mask: NDArray[np.bool_]) -> tuple[int, int, int, int]:
    """Top, left, rows and columns of the largest rectangle that is True all over; all 0 where nothing is."""
    best = (0, 0, 0, 0)
    heights = np.zeros(mask.shape[1], dtype=np.intp)
    for row, line in enumerate(mask):
        heights = np.where(line, heights + 1, 0)
        left, height, width = _under(heights.tolist())
        if height * width > best[2] * best[3]:
            best = (row - height + 1, left, height, width)
    return best


def _under(heights: list[int]) -> tuple[int, int, int]:
    """Left, height and width of the largest rectangle under a skyline; each height is put aside and taken up once."""
    best, rising = (0, 0, 0), [(0, 0)]
    for place, height in enumerate([*heights, 0]):
        start = place
        while rising[-1][1] > height:
            start, taller = rising.pop()
            if taller * (place - start) > best[1] * best[2]:
                best = (start, taller, place - start)
        if height > rising[-1][1]:
            rising.append((start, height))
    return best
