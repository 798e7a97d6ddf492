"""Ego-motion: how a camera moved between two of its pictures.

Corners at LiDAR points are followed from one picture into the other and back. Where they are found and how far away
they are gives the motion by perspective-n-point, whatever share of them moves by itself or has a wrong range.
"""

from typing import NamedTuple

import cv2
import numpy as np

from auditor.measurement.checks.photometric_consistency import ncc_at
from auditor.measurement.count_grid import Rows
from auditor.measurement.moment import Moment
from auditor.measurement.parameters import HALF, LIDAR_PROJECTION
from auditor.measurement.time_parameters import EGO_MOTION
from auditor.model.arrays import Floats32, Image, Indices, Mask
from auditor.model.optics.geometry import Matrix

_CONFIDENCE = 0.99  # probability that a trial of RANSAC is free of outliers, OpenCV's
_LEVELS = 3  # of the pyramid, OpenCV's
_TRIALS = 100  # of RANSAC, OpenCV's


_MIDDLE = (1 / HALF - 1) / 2
HALVED = np.array([[1 / HALF, 0, _MIDDLE], [0, 1 / HALF, _MIDDLE], [0, 0, 1]])
"""From pixels to half px, whose middles lie between those of two pixels."""

_WINDOW = (EGO_MOTION.flow_window_px, EGO_MOTION.flow_window_px)


class Motion(NamedTuple):
    """A point x of the camera's frame, in metres, lies at `rotation` x + `translation_m` in its frame of a moment ago.

    `rotation` is (3, 3), `translation_m` (3,). `by_ranges` it follows from two scans alone, to a few decimetres.
    """

    rotation: Matrix
    translation_m: Matrix
    by_ranges: bool = False

    @property
    def length_m(self) -> float:
        """How far the camera moved."""
        return float(np.linalg.norm(self.translation_m))

    def lasting(self, times: float) -> "Motion":
        """The motion that goes on alike for so many times as long."""
        turn = np.asarray(cv2.Rodrigues(self.rotation)[0], dtype=np.float64)
        return Motion(np.asarray(cv2.Rodrigues(turn * times)[0], dtype=np.float64), self.translation_m * times)


_STANDS = Motion(np.eye(3), np.zeros(3))
"""That of a camera that stands."""

_AHEAD = np.array([0.0, 0.0, 1.0])
"""In the rig's axes."""


def pixels_of(intrinsics: Matrix, points_m: Matrix) -> Matrix:
    """(M, 2) pixels, column and row, of (M, 3) points in the camera's frame."""
    seen = points_m @ intrinsics.T
    return np.asarray(seen[:, :2] / seen[:, 2:])


def ego_motion(now: Moment, before: Moment, some: Indices, expected: Motion | None = None) -> Motion | None:
    """The motion of a camera since the moment before; None where too few corners tell it.

    `some` are the numbers of the points of the view at which corners may lie. Where corners move far by the motion that
    is `expected`, they are sought there. A pattern that is thrown into the lens stands, as if the camera stood, and so
    does a picture that is repeated: where most corners stand, the LiDAR's ranges decide.
    """
    motion, stands = _by_corners(now, before, some, expected)
    if not stands:
        return motion
    rest, _ = _by_corners(now, before, some[~_stays(now, before, some)], expected)
    agreed = _ranges_agree(now, before, motion or _STANDS) + EGO_MOTION.ranges_gain
    if rest is not None and _ranges_agree(now, before, rest) > agreed:
        return rest
    if motion is None:
        return None
    ranged = _by_ranges(now, before)
    return ranged if _ranges_agree(now, before, ranged) > agreed else motion


def _by_corners(now: Moment, before: Moment, some: Indices, expected: Motion | None) -> tuple[Motion | None, bool]:
    """The motion by corners at some points, None where too few tell it, and whether most of those that fit it stand."""
    intrinsics = HALVED @ now.camera.intrinsics
    row, column = now.view.row[some] // HALF, now.view.column[some] // HALF
    points_m = now.point_m[some][_corners(now.half, row, column)]
    corners = pixels_of(intrinsics, points_m).astype(np.float32)
    places, seen = _followed(now.half, before.half, corners, _guessed(corners, intrinsics, points_m, expected))
    there, where = points_m[seen], places[seen].astype(np.float64)
    motion, fitting = _solved(there, where, intrinsics)
    moved = np.hypot(*(where - corners[seen]).T) > EGO_MOTION.moved_px
    return motion, bool(2 * np.count_nonzero(fitting & moved) <= np.count_nonzero(fitting))


def _stays(now: Moment, before: Moment, some: Indices) -> Mask:
    """(P,) mask of the points at whose places both pictures show the same."""
    row, column = now.view.row[some] // HALF, now.view.column[some] // HALF
    return ncc_at(now.half, before.half, row, column, np.zeros(some.size, dtype=np.float32)) > EGO_MOTION.stays


def _by_ranges(now: Moment, before: Moment) -> Motion:
    """The motion straight ahead of the vehicle by which most ranges of two scans agree."""
    ahead = now.camera.rotation @ _AHEAD
    steps = max(round(EGO_MOTION.fastest_m_s * now.after_s(before) / EGO_MOTION.as_far_m), 1)
    motions = [Motion(np.eye(3), EGO_MOTION.as_far_m * step * ahead, by_ranges=True) for step in range(1, steps + 1)]
    return max(motions, key=lambda one: _ranges_agree(now, before, one))


def _solved(there_m: Matrix, where_px: Matrix, intrinsics: Matrix) -> tuple[Motion | None, Mask]:
    """The motion by which most points (C, 3) lie at their pixels (C, 2) of the image before, and which of them (C,)."""
    fits = np.zeros(len(there_m), dtype=np.bool_)
    if len(there_m) < EGO_MOTION.fewest:
        return None, fits
    solved, turn, translation, fitting = cv2.solvePnPRansac(
        there_m,
        where_px,
        intrinsics,
        None,
        iterationsCount=_TRIALS,
        reprojectionError=EGO_MOTION.inlier_px,
        confidence=_CONFIDENCE,
    )
    if not solved or fitting is None or len(fitting) < max(EGO_MOTION.fewest, EGO_MOTION.least_share * len(there_m)):
        return None, fits
    inliers = fitting.ravel()
    fits[inliers] = True
    turn, translation = cv2.solvePnPRefineLM(there_m[inliers], where_px[inliers], intrinsics, None, turn, translation)
    rotation = np.asarray(cv2.Rodrigues(turn)[0], dtype=np.float64)
    return Motion(rotation, np.asarray(translation, dtype=np.float64).ravel()), fits


def _ranges_agree(now: Moment, before: Moment, motion: Motion) -> float:
    """The share of what stands above the road in one scan that lies, moved, where the scan before has as far a point.

    The road itself looks alike from everywhere.
    """
    upright = np.flatnonzero(now.view.below_m < EGO_MOTION.upright_m)
    upright = upright[:: max(-(-upright.size // EGO_MOTION.most_upright), 1)]
    moved_m = now.point_m[upright] @ motion.rotation.T + motion.translation_m
    moved_m = moved_m[moved_m[:, 2] > LIDAR_PROJECTION.nearest_m]
    column, row = np.rint(pixels_of(HALVED @ before.camera.intrinsics, moved_m)).astype(np.intp).T
    height, width = before.nearest_m.shape
    inside = np.flatnonzero((row >= 0) & (row < height) & (column >= 0) & (column < width))
    away = moved_m[inside, 2] - before.nearest_m[row[inside], column[inside]]
    away = away[np.isfinite(away)]
    return float(np.mean(np.abs(away) < EGO_MOTION.as_far_m)) if away.size else 0.0


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
