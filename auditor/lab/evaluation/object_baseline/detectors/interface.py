"""What detectors are, the objects that they find, and their boxes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from auditor.model.arrays import Image, Points
from auditor.model.optics.geometry import Matrix

CAR = "Car"
"""KITTI's word for the one kind of object that synthetic streets hold."""


@dataclass(frozen=True)
class ImageBox:
    """An upright rectangle in an image, in pixels."""

    left: float
    top: float
    right: float
    bottom: float

    @property
    def area(self) -> float:
        """Square pixels; 0 where it is turned inside out."""
        return max(self.right - self.left, 0.0) * max(self.bottom - self.top, 0.0)


@dataclass(frozen=True)
class SolidBox:
    """A box that stands on the ground, in the rig frame (x right, y down, z forward) as KITTI's labels give it.

    `x_m`, `y_m`, `z_m` are the centre of its underside; `yaw_rad` turns its length from the x axis towards -z.
    """

    x_m: float
    y_m: float
    z_m: float
    length_m: float
    width_m: float
    height_m: float
    yaw_rad: float

    @property
    def footprint_m(self) -> Matrix:
        """(4, 2) corners (x, z) seen from above, in order around the box."""
        cos, sin = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        along = np.array([1, 1, -1, -1]) * self.length_m / 2
        across = np.array([1, -1, -1, 1]) * self.width_m / 2
        return np.stack([self.x_m + cos * along + sin * across, self.z_m - sin * along + cos * across], axis=1)

    @property
    def corners_m(self) -> Matrix:
        """(8, 3) corners."""
        ground = self.footprint_m
        return np.concatenate(
            [np.insert(ground, 1, y, axis=1) for y in (self.y_m, self.y_m - self.height_m)], dtype=np.float64
        )


@dataclass(frozen=True)
class Detection:
    """One object: its box, its detector's score, and its kind; `label` is None where the kind is unknown."""

    box: ImageBox
    score: float = 1.0
    label: str | None = None


@dataclass(frozen=True)
class SolidDetection:
    """One object in space: its box, its detector's score, and its kind."""

    box: SolidBox
    score: float
    label: str


class Detector(Protocol):
    """What all detectors tell of themselves: `settings` are canonical JSON of all that can change a box."""

    @property
    def name(self) -> str:
        """A short name."""
        ...

    @property
    def settings(self) -> str:
        """Canonical JSON of all that can change a box."""
        ...

    @property
    def labels(self) -> frozenset[str]:
        """The kinds of object that it can name."""
        ...

    @property
    def libraries(self) -> Mapping[str, str]:
        """Versions of the libraries that run it, by name."""
        ...


class CameraDetector(Detector, Protocol):
    """Finds objects in images."""

    def detect(self, pixels: Image) -> tuple[Detection, ...]:
        """The objects in an (H, W) grey or (H, W, 3) BGR image."""
        ...


class CloudDetector(Detector, Protocol):
    """Finds objects in point clouds."""

    def detect(self, xyz_m: Points, rig_SE3_lidar: Matrix) -> tuple[SolidDetection, ...]:
        """The objects among (N, 3) points in the LiDAR frame, as boxes in the rig frame."""
        ...
