"""The rays that a camera or a scanning LiDAR looks along.

Both are grids whose ray at (row, column) is (p[row] x[column], q[row], p[row] z[column]) in the sensor's frame (x
right, y down, z forward), so that the product of all rays with a vector is an outer product and costs next to nothing.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Plane = NDArray[np.float32]
Box = tuple[slice, slice]


class Rays(Protocol):
    """A grid of H x W rays."""

    @property
    def p(self) -> Plane:
        """(H,) by how much the rays of a row spread sideways."""

    @property
    def q(self) -> Plane:
        """(H,) how far the rays of a row look down."""

    @property
    def x(self) -> Plane:
        """(W,) how far the rays of a column look to the right."""

    @property
    def z(self) -> Plane:
        """(W,) how far the rays of a column look ahead."""

    @property
    def spread(self) -> float:
        """The angle between neighbours, in metres a metre."""

    def locate(self, points: Plane) -> tuple[Plane, Plane]:
        """Rows and columns, not whole, in which (..., 3) points before the sensor are seen."""


def product(rays: Rays, vector: Plane, box: Box) -> Plane:
    """(h, w) products of the rays in a box of the grid with one vector (3,)."""
    rows, columns = box
    along = vector[0] * rays.x[columns] + vector[2] * rays.z[columns]
    return np.asarray(rays.p[rows, None] * along[None, :] + (vector[1] * rays.q[rows])[:, None], dtype=np.float32)


@dataclass(frozen=True, eq=False)
class PinholeRays:
    """One ray a pixel; a point at distance t along its ray has depth z = t."""

    p: Plane
    q: Plane
    x: Plane
    z: Plane
    spread: float
    centre_px: tuple[float, float]

    def locate(self, points: Plane) -> tuple[Plane, Plane]:
        """Rows and columns of (..., 3) points with z > 0."""
        scale = np.float32(1 / self.spread) / points[..., 2]
        column_px, row_px = self.centre_px
        return points[..., 1] * scale + np.float32(row_px), points[..., 0] * scale + np.float32(column_px)


def pinhole(width_px: int, height_px: int, focal_px: float, centre_px: tuple[float, float]) -> PinholeRays:
    """The rays of a camera whose optical axis meets the image at `centre_px` (column, row)."""
    return PinholeRays(
        p=np.ones(height_px, np.float32),
        q=((np.arange(height_px) - centre_px[1]) / focal_px).astype(np.float32),
        x=((np.arange(width_px) - centre_px[0]) / focal_px).astype(np.float32),
        z=np.ones(width_px, np.float32),
        spread=1 / focal_px,
        centre_px=centre_px,
    )


@dataclass(frozen=True, eq=False)
class SpinningRays:
    """One ray a beam and azimuth step, of length 1: t is the range."""

    p: Plane
    q: Plane
    x: Plane
    z: Plane
    spread: float
    elevation: Plane
    first_azimuth: float
    azimuth_step: float

    def locate(self, points: Plane) -> tuple[Plane, Plane]:
        """Rows and columns of (..., 3) points with z > 0."""
        x, y, z = points[..., 0], points[..., 1], points[..., 2]
        elevation = np.arctan2(-y, np.hypot(x, z))
        beams = np.arange(len(self.elevation), dtype=np.float32)
        rows = np.interp(elevation, self.elevation[::-1], beams[::-1]).astype(np.float32)
        return rows, ((np.arctan2(x, z) - self.first_azimuth) / self.azimuth_step).astype(np.float32)


def spinning(elevation: Plane, reach: float, azimuth_step: float) -> SpinningRays:
    """The rays of beams at the given elevations (radians, descending) over azimuths from -reach to +reach."""
    azimuth = np.arange(-reach, reach, azimuth_step)
    return SpinningRays(
        p=np.cos(elevation).astype(np.float32),
        q=-np.sin(elevation).astype(np.float32),
        x=np.sin(azimuth).astype(np.float32),
        z=np.cos(azimuth).astype(np.float32),
        spread=azimuth_step,
        elevation=elevation,
        first_azimuth=-reach,
        azimuth_step=azimuth_step,
    )
