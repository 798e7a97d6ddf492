"""Warps from a pair's own view to the reference view of the same camera: a homography by rotation.

Both views of a camera k share its centre, so a rotation and two K take the one to the other, whatever the depth. The
ray r = K_r^-1 (u, v, 1) of the reference view is the direction s = T r of the pair's, seen there at K_p s / s_z. A
surface at z_p = f_p b / d_p along the pair's axis lies at z_r = z_p / s_z along the reference's, since r_z = 1; so a
warped disparity, at the pair's baseline b, is d_r = f_r b / z_r = d_p s_z f_r / f_p.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from auditor.measurement.count_grid import ImageGrid
from auditor.measurement.disparity.disparity_error import Comparison
from auditor.measurement.disparity.stereo import StereoMap
from auditor.measurement.parameters import HALF
from auditor.model.arrays import Floats32, Indices, Mask
from auditor.model.optics.geometry import Matrix
from auditor.model.rig import Camera


@dataclass(frozen=True, eq=False)
class _Lookup:
    """Which pixel of the pair's grid each of the reference's shows: `row` and `column` (h, w), 0 where not `inside`.

    `scale` (h, w) makes the pair's disparities the reference's, NaN where the pair does not see.
    """

    row: Indices
    column: Indices
    inside: Mask
    scale: Floats32


@dataclass(frozen=True, eq=False)
class PairToSharedView:
    """From a pair's own view to the reference view of either of its cameras.

    `own` and `reference` are ideal cameras of the two views; `own_SO3_reference` (3, 3) rotates the axes of the
    reference view to the pair's. Each step has one lookup, computed once.
    """

    own: Camera
    reference: Camera
    own_SO3_reference: Matrix
    _lookups: dict[int, _Lookup] = field(default_factory=dict)

    def stereo(self, own: StereoMap) -> StereoMap:
        """The map in the reference view of k, at the pair's baseline; unknown where the pair does not see."""
        at = self._lookup(own.step)
        return StereoMap(
            own.disparity_px[at.row, at.column] * at.scale,
            own.valid[at.row, at.column] & at.inside,
            own.textured[at.row, at.column] & at.inside,
            own.step,
            own.range_px,
        )

    def comparison(self, own: Comparison) -> Comparison:
        """The same counts, their pixels in the reference view; those outside it are dropped."""
        row, column = self._forward(own.row, own.column, own.step)
        height, width = _grid(self.reference, own.step)
        inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
        return Comparison(own.counts, row[inside], column[inside], own.step)

    def values(self, own: Floats32, step: int) -> Floats32:
        """Values (h, w) of a grid of that step in the reference view, NaN where the pair does not see."""
        at = self._lookup(step)
        return np.where(at.inside, own[at.row, at.column], np.float32(np.nan))

    @cached_property
    def grid(self) -> ImageGrid:
        """The grid of the reference view, for the pair's half-resolution pixels."""
        row, column = np.mgrid[: _grid(self.own, HALF)[0], : _grid(self.own, HALF)[1]]
        there = self._forward(row.ravel(), column.ravel(), HALF)
        return ImageGrid.elsewhere(*_grid(self.reference, HALF), *(one.reshape(row.shape) for one in there))

    def _lookup(self, step: int) -> _Lookup:
        if step not in self._lookups:
            self._lookups[step] = self._look_up(step)
        return self._lookups[step]

    def _look_up(self, step: int) -> _Lookup:
        height, width = _grid(self.reference, step)
        row, column = np.mgrid[:height, :width]
        s = self.own_SO3_reference @ _rays(self.reference, row.ravel(), column.ravel(), step)
        own_row, own_column = (index.reshape(height, width) for index in _pixels(self.own, s, step))
        rows, columns = _grid(self.own, step)
        ahead = s[2].reshape(height, width)
        inside = (ahead > 0) & (own_row >= 0) & (own_row < rows) & (own_column >= 0) & (own_column < columns)
        scale = np.where(inside, ahead * self.reference.focal_px / self.own.focal_px, np.nan).astype(np.float32)
        return _Lookup(np.where(inside, own_row, 0), np.where(inside, own_column, 0), inside, scale)

    def _forward(self, row: NDArray[np.integer], column: NDArray[np.integer], step: int) -> tuple[Indices, Indices]:
        r = self.own_SO3_reference.T @ _rays(self.own, row, column, step)
        return _pixels(self.reference, r, step)


def _grid(camera: Camera, step: int) -> tuple[int, int]:
    return -(-camera.height_px // step), -(-camera.width_px // step)


def _rays(camera: Camera, row: NDArray[np.integer], column: NDArray[np.integer], step: int) -> Matrix:
    """(3, M) rays (x, y, 1) through the middles of a grid's pixels."""
    K = camera.intrinsics
    u, v = (column + 0.5) * step - 0.5, (row + 0.5) * step - 0.5
    return np.stack([(u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1], np.ones(u.shape)])


def _pixels(camera: Camera, directions: Matrix, step: int) -> tuple[Indices, Indices]:
    """Rows and columns of the grid's pixels that (3, M) directions fall into; those behind the camera into none."""
    ahead = np.where(directions[2] > 0, directions[2], np.nan)
    u, v, _ = camera.intrinsics @ (directions / ahead)
    row, column = (np.nan_to_num(np.floor((at + 0.5) / step), nan=-1) for at in (v, u))
    return row.astype(np.intp), column.astype(np.intp)
