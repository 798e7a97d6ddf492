"""How much of each sensor was looked at in a frame: compared with other sensors, one at least, or two."""

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
    by each other one that sees the same place; a LiDAR's point by pairs of cameras, or by one camera and its own past.
    """
    voters = {camera: _grids(cells, camera, Check.ADDED_LIGHT) for camera in of_picture}
    shares = {camera: _of_camera(voters[camera], share) for camera, share in of_picture.items()}
    if points is not None:
        pairs, pasts = (_grids(cells, LIDAR, check) for check in (Check.LIDAR_CONFLICT, Check.PARALLAX_CONFLICT))
        shares[LIDAR] = Looked(_of_points([*pairs, *pasts], points), _of_points(pairs, points))
    return shares


def _grids(cells: Mapping[CountedPair, Cells], sensor: int, check: Check) -> list[Image]:
    """What was compared of a sensor by a check, by cell, a grid for each pair."""
    return [counts.valid for counted, counts in cells.items() if (counted.sensor, counted.check) == (sensor, check)]


def _of_camera(grids: list[Image], of_picture: float) -> Looked:
    if not grids:
        return NOT_LOOKED_AT
    voters = np.sum([valid > 0 for valid in grids], axis=0)
    return Looked(*(of_picture * float((voters >= fewest).mean()) for fewest in (1, 2)))


def _of_points(grids: list[Image], points: int) -> float:
    return min(int(np.maximum.reduce(grids).sum()) / max(points, 1), 1.0) if grids else 0.0
