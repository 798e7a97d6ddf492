"""Rays of a camera or of a LiDAR, and what they hit."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auditor.model.arrays import Floats32, Indices


@dataclass(frozen=True, eq=False)
class Rays:
    """A grid of H x W rays in the rig frame.

    `x`, `y` and `z` are their directions and `origin` the places they start from; each broadcasts to (H, W). `pixel` is
    the angle in radians between neighbours. A grid with `focal_px` is a camera's: z = 1, distances along the rays are
    depths, and `principal_px` is the pixel straight ahead. Without one it is a LiDAR's: columns are evenly spaced
    azimuths from `first_azimuth` on. A camera whose rays are bent has x and y for each pixel and no `principal_px`.
    """

    shape: tuple[int, int]
    x: Floats32
    y: Floats32
    z: Floats32
    origin: tuple[Floats32, Floats32, Floats32]
    pixel: float
    principal_px: tuple[float, float] | None = None
    focal_px: float | None = None
    first_azimuth: float = 0.0

    def camera_directions(self, at: Indices) -> tuple[Floats32, Floats32]:
        """The x and y of a camera's rays at (N,) flat places of the grid."""
        if self.principal_px is None:
            return self.x.take(at), self.y.take(at)
        row, column = np.divmod(at, self.shape[1])
        return self.x.take(column), self.y.take(row)


@dataclass(frozen=True, eq=False)
class Hits:
    """The hits of H x W rays: the piece (-1: none), its s and t there, and the distance in lengths of the ray (inf)."""

    piece: NDArray[np.int32]
    s: Floats32
    t: Floats32
    distance: Floats32
