"""Where a camera has most added light: whether it saturates there, and the other cameras do not.

Light that is thrown into a camera outshines the scene, and saturates it in the middle. What a drop on a lens shows, and
glare and ghosts in a lens, are seldom brighter than the scene itself.
"""

from collections import defaultdict
from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.measurement.checks.count_grid import CELL_PX
from auditor.measurement.checks.tone_curve import saturation_level
from auditor.measurement.parameters import HALF
from auditor.model.arrays import Floats32, Image, Mask
from auditor.model.checks import Check, CountedPair
from auditor.model.measurement import Cells
from auditor.model.parameters import ADDED_SATURATION

_CELL = CELL_PX // HALF


def added_saturation(cells: Mapping[CountedPair, Cells], half_res: Mapping[int, Image]) -> dict[int, int]:
    """By camera, the half px that saturate near its most added light, and in most other cameras do not.

    `cells` are the frame's counts, `half_res` its (h, w) grey images at half resolution. Cameras of which no window
    could be compared are left out.
    """
    compared: dict[int, list[Cells]] = defaultdict(list)
    for counted, grid in cells.items():
        if counted.check is Check.ADDED_LIGHT:
            compared[counted.sensor].append(grid)
    saturated = {camera: image >= saturation_level(image) for camera, image in half_res.items()}
    found = {}
    for camera, voters in compared.items():
        said = _smallest_means(voters)
        if camera in saturated and np.isfinite(said).any():
            row, column = (int(place) for place in np.unravel_index(np.argmax(said), said.shape))
            found[camera] = _near(row, column, _alone(saturated, camera))
    return found


def _smallest_means(voters: list[Cells]) -> Floats32:
    """(rows, columns) the least of what the voters say of the window around each cell; -inf where one alone can."""
    valid, total = (np.stack([_window_sums(getattr(one, name)) for one in voters]) for name in ("valid", "total"))
    known = valid >= ADDED_SATURATION.fewest
    means = np.where(known, total / np.maximum(valid, 1), np.float32(np.inf)).min(axis=0)
    enough = np.count_nonzero(known, axis=0) >= min(ADDED_SATURATION.voters, len(voters))
    return np.where(enough, means, np.float32(-np.inf))


def _window_sums(grid: NDArray[np.integer]) -> Floats32:
    rows, columns = ADDED_SATURATION.window
    sums = cv2.boxFilter(
        grid.astype(np.float32), cv2.CV_32F, (columns, rows), normalize=False, borderType=cv2.BORDER_CONSTANT
    )
    return np.asarray(sums, dtype=np.float32)


def _alone(saturated: Mapping[int, Mask], camera: int) -> Mask:
    """(h, w) where a camera saturates, and of the others at most half do nearby: what is far lies at one place."""
    beside = np.ones(ADDED_SATURATION.beside_px, dtype=np.uint8)
    others = [cv2.dilate(mask.astype(np.uint8), beside) for other, mask in saturated.items() if other != camera]
    most = np.sum(others, axis=0) * 2 >= len(others) if others else np.zeros_like(saturated[camera])
    return np.asarray(saturated[camera] & ~most)


def _near(row: int, column: int, mask: Mask) -> int:
    """How many of a mask's pixels lie around a cell."""
    down, right = ADDED_SATURATION.near_px
    y, x = row * _CELL, column * _CELL
    return int(np.count_nonzero(mask[max(y - down, 0) : y + down, max(x - right, 0) : x + right]))
