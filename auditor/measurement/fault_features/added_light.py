"""Where a camera has most added light: whether it saturates there, and the other cameras do not.

Light that is thrown into a camera outshines the scene, and saturates it in the middle. What a drop on a lens shows, and
glare and ghosts in a lens, are seldom brighter than the scene itself.
"""

from collections import defaultdict
from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.measurement.count_grid import CELL_PX
from auditor.measurement.parameters import HALF
from auditor.measurement.tone_curve import saturation_level
from auditor.model.arrays import Floats32, Image, Mask
from auditor.model.checks import FEWEST_VOTERS, Check, CountedPair
from auditor.model.measurement import LIGHT_STEPS, Cells
from auditor.model.parameters import ADDED_LIGHT, IMAGE_WINDOW

_CELL = CELL_PX // HALF


def saturated_by_light(cells: Mapping[CountedPair, Cells], half_res: Mapping[int, Image]) -> dict[int, int]:
    """Of each camera the half px near most of its added light that saturate, and in most other cameras do not.

    `cells` are the frame's counts, `half_res` its (h, w) grey images at half resolution. Cameras of which no window
    could be compared are left out.
    """
    compared: dict[int, list[Cells]] = defaultdict(list)
    for counted, grid in cells.items():
        if counted.check is Check.ADDED_LIGHT:
            compared[counted.sensor].append(grid)
    saturated = {camera: image >= saturation_level(image) for camera, image in half_res.items()}
    counts = {}
    for camera, voters in compared.items():
        said = _smallest_means(voters)
        if camera in saturated and np.isfinite(said).any():
            row, column = (int(place) for place in np.unravel_index(np.argmax(said), said.shape))
            counts[camera] = _alone_near(row, column, saturated, camera)
    return counts


def _smallest_means(voters: list[Cells]) -> Floats32:
    """(rows, columns) the least of what the voters say of the window around each cell; -inf where one alone can."""
    valid, total = (np.stack([_window_sums(getattr(one, name)) for one in voters]) for name in ("valid", "total"))
    full = valid >= IMAGE_WINDOW.pseudo_count
    means = np.where(full, total / (valid + IMAGE_WINDOW.pseudo_count) / LIGHT_STEPS, np.inf).min(axis=0)
    enough = np.count_nonzero(full, axis=0) >= min(FEWEST_VOTERS, len(voters))
    return np.where(enough, means, -np.inf).astype(np.float32)


def _window_sums(grid: NDArray[np.integer]) -> Floats32:
    rows, columns = IMAGE_WINDOW.cells
    sums = cv2.boxFilter(
        grid.astype(np.float32), cv2.CV_32F, (columns, rows), normalize=False, borderType=cv2.BORDER_CONSTANT
    )
    return np.asarray(sums, dtype=np.float32)


def _alone_near(row: int, column: int, saturated: Mapping[int, Mask], camera: int) -> int:
    """How many px around a cell saturate in a camera, and in at most half of the others nearby, where they lie apart.

    What is far away lies at one place in all images; only what is around the cell is looked at.
    """
    down, right = ADDED_LIGHT.near_px
    rows, columns = ADDED_LIGHT.beside_px
    top, left = (max(at * _CELL - reach, 0) for at, reach in ((row, down), (column, right)))
    bottom, end = row * _CELL + down, column * _CELL + right
    own = saturated[camera][top:bottom, left:end]
    others = [mask for other, mask in saturated.items() if other != camera]
    if not others or not own.any():
        return int(np.count_nonzero(own))
    above, before = min(rows, top), min(columns, left)
    beside = np.ones(ADDED_LIGHT.beside_px, dtype=np.uint8)
    votes = np.zeros(own.shape, dtype=np.intp)
    for mask in others:
        part = mask[top - above : bottom + rows, left - before : end + columns].view(np.uint8)
        near = np.asarray(cv2.dilate(part, beside), dtype=np.uint8)
        votes += near[above:, before:][: own.shape[0], : own.shape[1]]
    return int(np.count_nonzero(own & (votes * 2 < len(others))))
