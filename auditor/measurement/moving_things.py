"""What is found elsewhere since it moves by itself.

The LiDAR saw it a moment ago as well: a group of points whose pictures fit one rigid thing, that moved as far towards
the camera or away from it as the LiDAR says, moves.
"""

from typing import NamedTuple

import cv2
import numpy as np

from auditor.measurement.ego_motion import pixels_of
from auditor.measurement.parameters import HALF
from auditor.measurement.time_parameters import PARALLAX_CONFLICT
from auditor.model.arrays import Floats, Floats32, Indices, Mask
from auditor.model.optics.geometry import Matrix


class FoundElsewhere(NamedTuple):
    """P points that are found elsewhere than where their ranges put them in the picture of a moment ago.

    `pixel` (P, 2) where they are now, `point_m` (P, 3) in the camera's frame, `place` (P, 2) the pixels where they are
    found, `scale` (P,) how many px are one of the pictures in which they were sought.
    """

    pixel: Floats
    point_m: Matrix
    place: Floats
    scale: Indices


def moving(K: Matrix, nearest_m: Floats32, elsewhere: FoundElsewhere) -> Mask:
    """(P,) mask of the points that belong to things that move.

    `K` (3, 3) are the camera's intrinsics, `nearest_m` (h, w) the depths that the LiDAR saw a moment ago at half px.
    Neighbouring points whose depth changed alike are one thing. It moves where one translation takes them to where they
    are found, by which their depth changes as the LiDAR saw it change; half of them have to fit. What touches it and
    moved alike is a part of it, as a car's rear window is: there the LiDAR's rows met another part a moment ago.
    """
    moves = np.zeros(len(elsewhere.pixel), dtype=np.bool_)
    row, column = np.rint(elsewhere.place[:, ::-1].T / HALF).astype(np.intp)
    height, width = nearest_m.shape
    depth_m = nearest_m[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
    # What the LiDAR had not seen there may move along with the camera.
    deeper_m = np.where(np.isfinite(depth_m), depth_m - elsewhere.point_m[:, 2], 0.0)

    def moves_by(moved_m: Matrix, part: Indices) -> bool:
        missed_px = _missed_px(K, elsewhere.point_m[part], elsewhere.place[part], moved_m) / elsewhere.scale[part]
        return bool(np.median(missed_px) < PARALLAX_CONFLICT.moving_px)

    for neighbours in _neighbours(elsewhere.pixel):
        parts = _alike_parts(neighbours, deeper_m)
        moved = [
            _moved_m(K, elsewhere.point_m[part], elsewhere.place[part], float(np.median(deeper_m[part])))
            for part in parts
        ]
        of_things = [one for one, part in zip(moved, parts, strict=True) if moves_by(one, part)]
        for part in parts:
            moves[part] = any(moves_by(one, part) for one in of_things)
    return moves


def _moved_m(K: Matrix, point_m: Matrix, place: Floats, deeper_m: float) -> Matrix:
    """(3,) the translation that takes points (P, 3) to where they are found (P, 2), that much deeper; the median."""
    ray = (place - K[:2, 2]) / (K[0, 0], K[1, 1])
    return np.array([*np.median(ray * (point_m[:, 2:] + deeper_m) - point_m[:, :2], axis=0), deeper_m])


def _missed_px(K: Matrix, point_m: Matrix, place: Floats, moved_m: Matrix) -> Floats:
    """(P,) by how many px points (P, 3) that move by a translation (3,) miss where they are found (P, 2)."""
    return np.asarray(np.hypot(*(pixels_of(K, point_m + moved_m) - place).T))


def _neighbours(pixel: Floats) -> list[Indices]:
    """The points (P, 2) in groups, in cells that touch."""
    if not len(pixel):
        return []
    cell = (pixel / PARALLAX_CONFLICT.cluster_px).astype(np.intp)
    cell -= cell.min(axis=0) - 1
    marked = np.zeros(cell.max(axis=0) + 2, dtype=np.uint8)
    marked[cell[:, 0], cell[:, 1]] = 1
    _, labels = cv2.connectedComponents(cv2.dilate(marked, np.ones((3, 3), np.uint8)))
    label = labels[cell[:, 0], cell[:, 1]]
    order = np.argsort(label, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(label[order])) + 1)


def _alike_parts(points: Indices, deeper_m: Floats) -> list[Indices]:
    """Some points in groups whose depths changed (P,) alike."""
    order = points[np.argsort(deeper_m[points], kind="stable")]
    return np.split(order, np.flatnonzero(np.diff(deeper_m[order]) > PARALLAX_CONFLICT.changed_alike_m) + 1)
