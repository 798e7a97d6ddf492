"""Still texture: what stays at its place in a lone camera's picture, though by the LiDAR's ranges it should have moved.

A pattern that is thrown into a lens, or lies on it, moves with the camera: its surroundings are found where they are
now, a moment ago and many metres of way before. It says nothing of the LiDAR, whose range has it elsewhere. What is far
away, or drives ahead as fast, stays as well, but seldom for so long a way.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from auditor.measurement.checks.photometric_consistency import ncc_at
from auditor.measurement.count_grid import largest_share
from auditor.measurement.moment import Moment
from auditor.measurement.parameters import HALF
from auditor.model.arrays import Image, Indices, Mask
from auditor.model.parameters import BY_HAND, parameter

_PATTERNS = "drives 0009, 0001 and 04: clean, with walls, and with patterns on one camera (docs/decisions.md)"


@dataclass(frozen=True)
class StillTexture:
    """How much of a window stays."""

    way_m: float = parameter(7.0, unit="m that the camera moved since the earliest picture", source=_PATTERNS)
    alike: float = parameter(0.8, unit="NCC above which two pictures show the same at one place", source=_PATTERNS)
    outnumber: float = parameter(
        2.0, unit="times as many points nearby that stay, beyond which a conflict is theirs", source=_PATTERNS
    )
    least_px: float = parameter(4.0, unit="px that a point should have moved", source=_PATTERNS)
    shown_px: int = parameter(11, unit="half px, width of surroundings that are sought long ago", source=_PATTERNS)
    nearby_px: int = parameter(12, unit="half px to each side in which they are", source=_PATTERNS)
    cell_px: int = parameter(8, unit="half px, width and height of a cell", source=BY_HAND)
    window: tuple[int, int] = parameter((6, 8), unit="cells, rows and columns", source=_PATTERNS)
    pseudo_count: int = parameter(10, unit="points that move, added to those of a window", source=_PATTERNS)


NUMBERS = StillTexture()


def staying(now: Moment, earlier: Sequence[Image | None], point: Indices) -> Mask:
    """(P,) mask of points of the view at whose places all earlier half-resolution pictures (h, w) show the same."""
    row, column = now.view.row[point] // HALF, now.view.column[point] // HALF
    stays, nowhere = np.ones(point.size, dtype=np.bool_), np.zeros(point.size, dtype=np.float32)
    for picture in earlier:
        if picture is not None:
            stays &= ncc_at(now.half, picture, row, column, nowhere) > NUMBERS.alike
    return stays


def appeared(now: Moment, long_ago: Image, point: Indices) -> Mask:
    """(P,) mask of points of the view whose surroundings a half-resolution picture (h, w) shows nowhere nearby."""
    radius, reach = NUMBERS.shown_px // 2, NUMBERS.shown_px // 2 + NUMBERS.nearby_px
    here, there = (np.pad(one, reach, mode="edge") for one in (now.half, long_ago))
    alike = []
    for row, column in zip(now.view.row[point] // HALF + reach, now.view.column[point] // HALF + reach, strict=True):
        patch, window = (
            one[row - far : row + far + 1, column - far : column + far + 1]
            for one, far in ((here, radius), (there, reach))
        )
        alike.append(cv2.minMaxLoc(cv2.matchTemplate(window, patch, cv2.TM_CCOEFF_NORMED))[1])
    return np.array(alike) <= NUMBERS.alike


def measure_still_texture(now: Moment, point: Indices, stays: Mask) -> float:
    """The largest share of a window's points (P,) that stay, 0 to 1, of those that should have moved."""
    row, column = (place[point] // (HALF * NUMBERS.cell_px) for place in (now.view.row, now.view.column))
    height, width = (-(-side // NUMBERS.cell_px) for side in now.half.shape)
    return largest_share((row, column), stays, (height, width), NUMBERS.window, NUMBERS.pseudo_count)
