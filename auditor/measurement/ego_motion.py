"""Ego-motion: how a camera moved between two of its pictures.

Corners at LiDAR points are followed from one picture into the other and back. Where they are found and how far away
they are gives the motion by perspective-n-point, whatever share of them moves by itself or has a wrong range.
"""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.measurement.parameters import LIDAR_PROJECTION
from auditor.measurement.time_parameters import EGO_MOTION
from auditor.model.arrays import Floats32, Image, Indices, Mask
from auditor.model.optics.geometry import Matrix

_CONFIDENCE = 0.99  # probability that a trial of RANSAC is free of outliers, OpenCV's
_LEVELS = 3  # of the pyramid, OpenCV's
_TRIALS = 100  # of RANSAC, OpenCV's


Rows = NDArray[np.signedinteger]
"""Rows or columns of pixels: (M,)."""

_WINDOW = (EGO_MOTION.flow_window_px, EGO_MOTION.flow_window_px)


class Motion(NamedTuple):
    """A point x of the camera's frame, in metres, lies at `rotation` x + `translation_m` in its frame of a moment ago.

    `rotation` is (3, 3), `translation_m` (3,).
    """

    rotation: Matrix
    translation_m: Matrix

    def lasting(self, times: float) -> "Motion":
        """The motion that goes on alike for so many times as long."""
        turn = np.asarray(cv2.Rodrigues(self.rotation)[0], dtype=np.float64)
        return Motion(np.asarray(cv2.Rodrigues(turn * times)[0], dtype=np.float64), self.translation_m * times)


def pixels_of(intrinsics: Matrix, points_m: Matrix) -> Matrix:
    """(M, 2) pixels, column and row, of (M, 3) points in the camera's frame."""
    seen = points_m @ intrinsics.T
    return np.asarray(seen[:, :2] / seen[:, 2:])


def ego_motion(
    now: Image,
    before: Image,
    intrinsics: Matrix,
    points_m: Matrix,
    pixels: tuple[Rows, Rows],
    expected: Motion | None = None,
) -> Motion | None:
    """The motion between two half-resolution grey images (h, w); None where too few corners tell it.

    `intrinsics` (3, 3) are those of the half-resolution images; `points_m` (M, 3) LiDAR points in the camera's frame
    now, `pixels` their rows and columns (M,). Where corners move far by the motion that is `expected`, they are sought
    there.
    """
    chosen = _corners(now, *pixels)
    corners = pixels_of(intrinsics, points_m[chosen]).astype(np.float32)
    places, seen = _followed(now, before, corners, _guessed(corners, intrinsics, points_m[chosen], expected))
    if np.count_nonzero(seen) < EGO_MOTION.fewest:
        return None
    there, where = points_m[chosen][seen], places[seen].astype(np.float64)
    solved, turn, translation, fitting = cv2.solvePnPRansac(
        there,
        where,
        intrinsics,
        None,
        iterationsCount=_TRIALS,
        reprojectionError=EGO_MOTION.inlier_px,
        confidence=_CONFIDENCE,
    )
    if not solved or fitting is None or len(fitting) < max(EGO_MOTION.fewest, EGO_MOTION.least_share * len(there)):
        return None
    inliers = fitting.ravel()
    turn, translation = cv2.solvePnPRefineLM(there[inliers], where[inliers], intrinsics, None, turn, translation)
    rotation = np.asarray(cv2.Rodrigues(turn)[0], dtype=np.float64)
    return Motion(rotation, np.asarray(translation, dtype=np.float64).ravel())


def _corners(image: Image, row: Rows, column: Rows) -> Indices:
    """The points with the strongest corners, one a block of the image at most."""
    strength = np.asarray(cv2.cornerMinEigenVal(image, EGO_MOTION.corner_px))[row, column]
    height, width = (-(-side // EGO_MOTION.corner_block_px) for side in image.shape)
    block = row // EGO_MOTION.corner_block_px * width + column // EGO_MOTION.corner_block_px
    highest = np.full(height * width, -np.inf, dtype=np.float32)
    np.maximum.at(highest, block, strength)
    best = np.flatnonzero(strength == highest[block])
    best = best[np.unique(block[best], return_index=True)[1]]
    strongest = np.argsort(-strength[best], kind="stable")[: EGO_MOTION.most_corners]
    return np.asarray(best[strongest])


def _guessed(corners_px: Floats32, intrinsics: Matrix, points_m: Matrix, expected: Motion | None) -> Floats32:
    """(C, 2) by how much corners should move; 0 where that is not known or little."""
    if expected is None or not len(corners_px):
        return np.zeros_like(corners_px)
    there_m = points_m @ expected.rotation.T + expected.translation_m
    ahead = there_m[:, 2:] > LIDAR_PROJECTION.nearest_m
    there_px = pixels_of(intrinsics, np.where(ahead, there_m, points_m))
    moved = np.where(ahead, there_px - corners_px, 0).astype(np.float32)
    far = float(np.median(np.hypot(*moved.T))) >= EGO_MOTION.guessed_from_px
    return np.asarray(moved if far else np.zeros_like(moved))


def _followed(now: Image, before: Image, corners_px: Floats32, moved_px: Floats32) -> tuple[Floats32, Mask]:
    """Where corners (C, 2) lie in the image before, and which of them lead back to where they began.

    They are sought `moved_px` (C, 2) from where they are now.
    """
    if not len(corners_px):
        return corners_px, np.zeros(0, dtype=np.bool_)
    there, seen = _flow(now, before, corners_px, moved_px)
    back, seen_back = _flow(before, now, there, -moved_px)
    returned = np.abs(back - corners_px).max(axis=1) < EGO_MOTION.returns_px
    return there, seen & seen_back & returned


def _flow(image: Image, other: Image, points_px: Floats32, moved_px: Floats32) -> tuple[Floats32, Mask]:
    """Where points (C, 2) of one image lie in the other, sought `moved_px` from there, and whether they were found."""
    places, seen, _ = cv2.calcOpticalFlowPyrLK(
        image,
        other,
        points_px,
        points_px + moved_px,
        winSize=_WINDOW,
        maxLevel=_LEVELS,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW if moved_px.any() else 0,
    )
    return np.asarray(places, dtype=np.float32), np.asarray(seen).ravel() > 0
