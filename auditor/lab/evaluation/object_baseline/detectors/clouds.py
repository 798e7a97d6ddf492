"""Detectors of objects in point clouds: networks in ONNX files."""

from dataclasses import dataclass

import numpy as np

from auditor.lab.evaluation.object_baseline.detectors.described import CloudInput, CloudOutput
from auditor.lab.evaluation.object_baseline.detectors.interface import SolidBox, SolidDetection
from auditor.lab.evaluation.object_baseline.detectors.networks import Network
from auditor.lab.evaluation.object_baseline.detectors.overlap import overlaps_on_ground
from auditor.model.arrays import Points
from auditor.model.optics.geometry import Matrix


@dataclass(frozen=True, eq=False)
class OnnxCloudDetector(Network):
    """A cloud detector made of a model and its description."""

    @property
    def taken(self) -> CloudInput:
        """Its input."""
        assert isinstance(self.description.input, CloudInput)
        return self.description.input

    @property
    def given(self) -> CloudOutput:
        """Its output."""
        assert isinstance(self.description.output, CloudOutput)
        return self.description.output

    def detect(self, xyz_m: Points, rig_SE3_lidar: Matrix) -> tuple[SolidDetection, ...]:
        """The objects among (N, 3) points in the LiDAR frame, as boxes in the rig frame.

        Raises SettingError where the model fails, or its output is not as described.
        """
        points = xyz_m
        if self.taken.frame == "camera":
            points = (xyz_m @ rig_SE3_lidar[:3, :3].T + rig_SE3_lidar[:3, 3]).astype(np.float32)
        shown = _as_points(points, self.taken) if self.taken.kind == "points" else _as_grid(points, self.taken)
        found = self.find(shown, len(self.given.columns))
        rows = [dict(zip(self.given.columns, map(float, row), strict=True)) for row in found.boxes]
        boxes = [self._box(row, rig_SE3_lidar) for row in rows]
        return tuple(SolidDetection(*one) for one in self.surest(found, boxes, overlaps_on_ground))

    def _box(self, row: dict[str, float], rig_SE3_lidar: Matrix) -> SolidBox | None:
        """The network's numbers as a box in the rig frame; None where it has no size."""
        given = self.given
        height, length, width, yaw = row.get("height", given.height_m), row["length"], row["width"], row["yaw"]
        if min(height, length, width) <= 0:
            return None
        half = height / 2 if given.centred else 0.0
        if self.taken.frame == "camera":
            y = row["y"] + half if "y" in row else given.ground_m
            return SolidBox(row["x"], y, row["z"], length, width, height, yaw)
        under = row["z"] - half if "z" in row else given.ground_m
        rotation, translation = rig_SE3_lidar[:3, :3], rig_SE3_lidar[:3, 3]
        x, y, z = map(float, rotation @ [row["x"], row["y"], under] + translation)
        heading = rotation @ [np.cos(yaw), np.sin(yaw), 0.0]
        return SolidBox(x, y, z, length, width, height, float(np.arctan2(-heading[2], heading[0])))


def _inside(points: Points, taken: CloudInput) -> Points:
    """The points within the described limits."""
    ends = np.array([taken.x_m, taken.y_m, taken.z_m], dtype=np.float32)
    inside: Points = points[((points >= ends[:, 0]) & (points < ends[:, 1])).all(axis=1)]
    return inside


def _as_points(points: Points, taken: CloudInput) -> Points:
    """(1, N, C): evenly spaced points where there are more, repeated points where there are fewer."""
    inside = _inside(points, taken)
    shown = np.zeros((taken.points, taken.columns), dtype=np.float32)
    if len(inside):
        most = max(len(inside), taken.points)
        chosen = np.arange(taken.points) * most // taken.points % len(inside)
        shown[:, :3] = inside[chosen]
    return shown[np.newaxis]


def _as_grid(points: Points, taken: CloudInput) -> Points:
    """(1, slices + empty, H, W): 1 where a cell holds a point."""
    inside = _inside(points, taken)
    along, across = taken.cells
    grid = np.zeros((taken.slices + taken.empty, along, across), dtype=np.float32)
    x, y = ((inside[:, axis] - first) / taken.cell_m for axis, first in ((0, taken.x_m[0]), (1, taken.y_m[0])))
    z = (inside[:, 2] - taken.z_m[0]) / (taken.z_m[1] - taken.z_m[0]) * taken.slices
    lengths = (taken.slices, along, across)
    grid[tuple(np.clip(of.astype(np.intp), 0, most - 1) for of, most in zip((z, x, y), lengths, strict=True))] = 1
    return np.ascontiguousarray((grid if taken.rows == "x" else grid.transpose(0, 2, 1))[np.newaxis])
