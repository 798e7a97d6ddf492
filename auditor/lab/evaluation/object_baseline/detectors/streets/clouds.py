"""The detector of cars in point clouds that was trained on synthetic streets: it looks at them from above."""

from pathlib import Path

import numpy as np

from auditor.lab.evaluation.object_baseline.detectors.interface import CAR, SolidBox, SolidDetection
from auditor.lab.evaluation.object_baseline.detectors.overlap import overlaps_on_ground, suppressed
from auditor.lab.evaluation.object_baseline.detectors.streets.network import (
    MOST_OVERLAP,
    STRIDE,
    CentreNet,
    StreetDetector,
    unpacked,
)
from auditor.model.arrays import Floats, Floats32, Points
from auditor.model.optics.geometry import Matrix

CELL_M = 0.2
CELLS = 256
"""It sees CELLS x CELLS cells: from the camera ahead, and half of them to either side."""

HEIGHTS_M = (-0.6, 1.9)
SLICES = 10
"""The rig frame's y is downwards, and the road is about 1.65 m below a camera."""

SHIPPED = Path(__file__).with_name("clouds_fp16.safetensors")
SHIPPED_SHA256 = "88142ffe2b27be97b48b8cc392530005612f7b826285a860161e93d5d9051ffd"

NUMBERS = 8
_USUAL_M = (4.2, 1.75, 1.5)
_ROAD_M = 1.65
_DENSE = 32.0
"""Points of a cell that count as many."""


class StreetClouds(StreetDetector):
    """A trained network as a detector for point clouds."""

    def detect(self, xyz_m: Points, rig_SE3_lidar: Matrix) -> tuple[SolidDetection, ...]:
        """The cars among (N, 3) points in the LiDAR frame, as boxes in the rig frame."""
        points = (xyz_m @ rig_SE3_lidar[:3, :3].T + rig_SE3_lidar[:3, 3]).astype(np.float32)
        places, numbers = self.trained.peaks(shown(points))
        boxes = [SolidBox(*row) for row in decoded(places[:, 1:], numbers).tolist()]
        kept = suppressed(places[:, 0], overlaps_on_ground(boxes, boxes), MOST_OVERLAP)
        return tuple(SolidDetection(boxes[at], float(places[at, 0]), CAR) for at in kept)


def shipped_clouds() -> StreetClouds:
    """The detector that comes with auditor. Raises SettingError where its weights are missing or were changed."""
    return StreetClouds(unpacked(new_network(), SHIPPED, SHIPPED_SHA256))


def new_network() -> CentreNet:
    """A network that is not trained."""
    return CentreNet(SLICES + 1, NUMBERS)


def shown(points: Points) -> Floats32:
    """(SLICES + 1, CELLS, CELLS) of the network's input, of points in the rig frame: rows ahead, columns to the right.

    1 where a slice of a cell holds a point; the last is how many points the cell has, as a logarithm.
    """
    row, column = (points[:, 2] / CELL_M), points[:, 0] / CELL_M + CELLS / 2
    low, high = HEIGHTS_M
    level = (points[:, 1] - low) / (high - low) * SLICES
    inside = (row >= 0) & (row < CELLS) & (column >= 0) & (column < CELLS) & (level >= 0) & (level < SLICES)
    place = row[inside].astype(np.intp), column[inside].astype(np.intp)
    grid = np.zeros((SLICES + 1, CELLS, CELLS), dtype=np.float32)
    grid[level[inside].astype(np.intp), *place] = 1
    count = np.bincount(place[0] * CELLS + place[1], minlength=CELLS * CELLS).reshape(CELLS, CELLS)
    grid[-1] = np.log1p(count) / np.log(_DENSE)
    return grid


def decoded(cells: Floats, numbers: Floats) -> Floats:
    """(M, 7) boxes as SolidBox has them; `cells` are (M, 2) rows and columns of the map."""
    step = CELL_M * STRIDE
    z, x = ((cells + 0.5 + numbers[:, 1::-1]) * step - (0, CELLS * CELL_M / 2)).T
    length, width, height = np.exp(np.clip(numbers[:, 2:5], -2, 2)).T * np.array(_USUAL_M)[:, None]
    yaw = np.arctan2(numbers[:, 6], numbers[:, 7]) / 2
    return np.stack([x, numbers[:, 5] + _ROAD_M, z, length, width, height, yaw], axis=1)


def encoded(cells: Floats, boxes: Floats) -> Floats:
    """The (M, NUMBERS) that `decoded` makes (M, 7) boxes of; a box turned by half a turn is the same."""
    x, y, z, *sizes, yaw = boxes.T
    across = (x + CELLS * CELL_M / 2) / (CELL_M * STRIDE) - cells[:, 1] - 0.5
    ahead = z / (CELL_M * STRIDE) - cells[:, 0] - 0.5
    scaled = [np.log(size / usual) for size, usual in zip(sizes, _USUAL_M, strict=True)]
    return np.stack([across, ahead, *scaled, y - _ROAD_M, np.sin(2 * yaw), np.cos(2 * yaw)], axis=1)
