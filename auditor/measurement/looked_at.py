"""How much of each sensor was looked at in a frame: compared with other sensors, one at least, or two."""

from collections import defaultdict
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from auditor.model.arrays import Image
from auditor.model.checks import Check, CountedPair
from auditor.model.measurement import Cells
from auditor.model.rig import LIDAR


class Looked(NamedTuple):
    """Shares, 0 to 1, of a camera's picture or of the LiDAR's points, that one other sensor or two compared."""

    by_one: float
    by_two: float


NOT_LOOKED_AT = Looked(0.0, 0.0)


def looked_at(
    cells: Mapping[CountedPair, Cells], of_picture: Mapping[int, float], points: int | None
) -> dict[int, Looked]:
    """What was looked at of each camera of `of_picture`, and of the LiDAR where it has so many `points`.

    `of_picture` is the share of each camera's recorded picture that the grids of its counts cover. A camera is compared
    by each other one that sees the same place; a LiDAR's point by pairs of cameras, so always by two.
    """
    grids: dict[int, list[Image]] = defaultdict(list)
    for counted, counts in cells.items():
        if counted.check in {Check.ADDED_LIGHT, Check.LIDAR_CONFLICT}:
            grids[counted.sensor].append(counts.valid)
    shares = {camera: _of_camera(grids[camera], share) for camera, share in of_picture.items()}
    if points is not None:
        compared = int(np.maximum.reduce(grids[LIDAR]).sum()) / max(points, 1) if grids[LIDAR] else 0.0
        shares[LIDAR] = Looked(min(compared, 1.0), min(compared, 1.0))
    return shares


def _of_camera(grids: list[Image], of_picture: float) -> Looked:
    if not grids:
        return NOT_LOOKED_AT
    voters = np.sum([valid > 0 for valid in grids], axis=0)
    return Looked(*(of_picture * float((voters >= fewest).mean()) for fewest in (1, 2)))
