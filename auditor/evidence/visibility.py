"""What a witness camera can see too, as the LiDAR has it."""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.evidence.lidar import LidarView
from auditor.evidence.parameters import HALF, LIDAR_PROJECTION, MATCHER_RANGE
from auditor.rig import Rig


def visible_to_witness(view: LidarView, rig: Rig, witness: int, d0_px: NDArray[np.float32]) -> NDArray[np.bool_]:
    """(M,) mask of the points of a view that no much nearer point hides from the witness's camera.

    `d0_px` is DM_{0,k} at that witness. A point is hidden where another, within 7 x 3 half-resolution pixels of the
    witness's image, is nearer by more than 3 px at a baseline of 0.6 m. Points outside its image are not visible.
    """
    # The z-buffer of the source camera is kept at half resolution.
    camera = rig.camera(witness)
    scale = np.float32(LIDAR_PROJECTION.baseline_m / rig.baseline_m(witness, view.reference))
    height, width = -(-camera.height_px // HALF), -(-camera.width_px // HALF)
    # Rectified images share their rows, so the point's row in the reference is its row in the witness as well.
    row = np.minimum(view.row // HALF, height - 1)
    column = np.rint((view.u_px - d0_px) / HALF).astype(np.intp)
    inside = (column >= 0) & (column < width)
    column = np.clip(column, 0, width - 1)
    nearness = np.where(inside, d0_px * scale, 0).astype(np.float32)
    nearest = np.zeros((height, width), dtype=np.float32)
    np.maximum.at(nearest, (row, column), nearness)
    nearest = np.asarray(
        cv2.dilate(nearest, np.ones(LIDAR_PROJECTION.source_window_px, dtype=np.uint8)), dtype=np.float32
    )
    return np.asarray(inside & (nearest[row, column] - nearness <= LIDAR_PROJECTION.nearer_by_px))


class Reach(NamedTuple):
    """What is nearer than a disparity of `limit_px` is too near, and hides what lies up to `hides_px` left of it."""

    limit_px: float
    hides_px: int


def too_near(
    view: LidarView, alone: NDArray[np.bool_], witness: int, reach: Reach, shape: tuple[int, int]
) -> NDArray[np.bool_]:
    """(h, w) half-resolution mask of where the LiDAR sees something too near to be compared.

    16 px around it are masked, and what it can hide from the witness. Points that stand `alone` (M,) hide nothing: in
    light rain a few dozen drops would keep most of the view from the cameras' witnesses.
    """
    near = view.disparity_px(witness) > reach.limit_px
    near &= ~alone
    mask = np.zeros(shape, dtype=np.uint8)
    if near.any():
        row, column = view.row[near] // HALF, view.column[near] // HALF
        mask[row, column] = 1
        mask = np.asarray(cv2.dilate(mask, np.ones(MATCHER_RANGE.around_px, dtype=np.uint8)), dtype=np.uint8)
        leftward = np.ones((1, reach.hides_px // HALF), dtype=np.uint8)
        mask = np.asarray(cv2.dilate(mask, leftward, anchor=(0, 0)), dtype=np.uint8)
    return mask.astype(np.bool_)
