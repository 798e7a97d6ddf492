"""Rigid motions and projections.

A rigid motion is a (4, 4) float64 matrix named `dst_SE3_src`: it takes homogeneous points of the src frame, in
metres, into the dst frame. A projection is the full (3, 4) matrix P of a camera, lens distortion apart: it takes
homogeneous points of the rig frame, in metres, to homogeneous pixels.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]


def compose(*motions: Matrix) -> Matrix:
    """Chain motions: `compose(a_SE3_b, b_SE3_c)` is a_SE3_c. Each is (4, 4)."""
    result = np.eye(4)
    for motion in motions:
        result = result @ motion
    return result


def invert(dst_SE3_src: Matrix) -> Matrix:
    """The (4, 4) motion src_SE3_dst."""
    rotation, translation = dst_SE3_src[:3, :3], dst_SE3_src[:3, 3]
    return motion(rotation.T, -rotation.T @ translation)


def motion(rotation: Matrix, translation_m: Matrix) -> Matrix:
    """A (4, 4) motion from a (3, 3) rotation and a translation of 3 metres."""
    result = np.eye(4)
    result[:3, :3] = rotation
    result[:3, 3] = translation_m
    return result


def rotation_from_quaternion(x: float, y: float, z: float, w: float) -> Matrix:
    """The (3, 3) rotation of a quaternion, which need not be of unit length. Raises ValueError for a zero one."""
    norm = float(np.sqrt(x * x + y * y + z * z + w * w))
    if not np.isfinite(norm) or norm == 0.0:
        raise ValueError("a quaternion of length zero is no rotation")
    x, y, z, w = x / norm, y / norm, z / norm, w / norm
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_from_rotation(rotation: Matrix) -> tuple[float, float, float, float]:
    """The unit quaternion (x, y, z, w), w >= 0, of a (3, 3) rotation."""
    # The eigenvector of the largest eigenvalue of Bar-Itzhack's matrix is exact for a true rotation and the nearest
    # quaternion for one with rounding in it.
    r = rotation
    k = np.array(
        [
            [r[0, 0] - r[1, 1] - r[2, 2], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0], r[2, 1] - r[1, 2]],
            [r[0, 1] + r[1, 0], r[1, 1] - r[0, 0] - r[2, 2], r[1, 2] + r[2, 1], r[0, 2] - r[2, 0]],
            [r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], r[2, 2] - r[0, 0] - r[1, 1], r[1, 0] - r[0, 1]],
            [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], r[0, 0] + r[1, 1] + r[2, 2]],
        ]
    )
    vector = np.linalg.eigh(k)[1][:, 3]
    if vector[3] < 0:
        vector = -vector
    x, y, z, w = (float(value) for value in vector)
    return x, y, z, w


def camera_centre(projection: Matrix) -> Matrix:
    """The (3,) optical centre in metres, in the frame that the full (3, 4) matrix P projects from."""
    return np.asarray(-np.linalg.solve(projection[:, :3], projection[:, 3]), dtype=np.float64)


def intrinsics_and_rotation(projection: Matrix) -> tuple[Matrix, Matrix]:
    """K and R of a full (3, 4) matrix P = K [R | t]: (3, 3) upper triangular, and the (3, 3) rotation rig to camera."""
    M = projection[:, :3]
    if not np.any(np.tril(M, -1)) and M[2, 2] == 1:
        return np.array(M), np.eye(3)
    # M = K R is the QR decomposition of M read backwards.
    Q, upper = np.linalg.qr(M[::-1].T)
    K, R = upper.T[::-1, ::-1], Q.T[::-1]
    signs = np.sign(np.diag(K))
    K, R = K * signs, signs[:, None] * R
    return K / K[2, 2], R * np.sign(np.linalg.det(R))


def angle_between(a: Matrix, b: Matrix) -> float:
    """The angle in radians, 0 to pi, between two directions of 3 numbers."""
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), np.dot(a, b)))


def beside_line_m(points_m: Sequence[Matrix]) -> Matrix:
    """By how much each of two points (3,) or more misses the line of two of them that misses the others least."""
    points = np.array(points_m)
    lines = ((points[a], points[b] - points[a]) for a, b in combinations(range(len(points)), 2))
    missed = [
        np.linalg.norm(np.cross(points - start, along), axis=1) / np.linalg.norm(along)
        for start, along in lines
        if along.any()
    ]
    return min(missed, key=lambda by: float(by.max()), default=np.zeros(len(points)))
