"""Cameras that nobody rectified -> those that can be, numbered from right to left along the line they stand on.

Left out, with the reason, are cameras at the place of another, beside the line of the others, or behind them, and those
that share too little of their view.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from auditor.common_view import common_view
from auditor.errors import RigError
from auditor.geometry import Matrix, motion
from auditor.recordings.placing import MIN_BASELINE_M
from auditor.rig import Camera, Rig

_FAR_M = 10.0
MOST_OFF_PX = 1.0
"""A camera beside the line sees what is 10 m away on other rows: more than this and matching fails."""

_LEAST_SHARED = 0.25
_LEAST_ASIDE = 0.5  # sine of the angle between the line and where the cameras look


def aligned(
    cameras: Sequence[Camera], reasons: list[str], through: Camera | None = None
) -> tuple[list[Camera], Matrix]:
    """The cameras that make a rig, in a frame whose x axis is their line, and the (3, 3) turn into that frame.

    The line is the one with the most cameras, `through` one of them if asked for.
    """
    apart = _apart(cameras, reasons)
    if len(apart) < 2 or (through is not None and through not in apart):
        return apart[:1], np.eye(3)
    on_line = _on_line(apart, reasons, through)
    turn = _turn(on_line)
    if turn is None:
        reasons.append(f"{', '.join(camera.name for camera in on_line)} stand one behind the other")
        return apart[:1], np.eye(3)
    turned = [_in_frame(camera, turn) for camera in on_line]
    return _overlapping(sorted(turned, key=lambda camera: -float(camera.centre_m[0])), reasons), turn


def off_line_px(cameras: Sequence[Camera]) -> float:
    """By how many rows the camera farthest from the line of the outermost two misses what is 10 m away."""
    first, last = cameras[0].centre_m, cameras[-1].centre_m
    focal_px = min(camera.focal_px for camera in cameras)
    return max(_beside_m(camera, first, last) for camera in cameras) * focal_px / _FAR_M


def _apart(cameras: Sequence[Camera], reasons: list[str]) -> list[Camera]:
    kept: list[Camera] = []
    for camera in cameras:
        there = [other for other in kept if np.linalg.norm(camera.centre_m - other.centre_m) < MIN_BASELINE_M]
        if there:
            reasons.append(f"{camera.name} lies where {there[0].name} lies")
        else:
            kept.append(camera)
    return kept


def _on_line(cameras: list[Camera], reasons: list[str], through: Camera | None) -> list[Camera]:
    """The most cameras on one line; of several such lines the one along which they lie farthest apart."""
    limit_m = MOST_OFF_PX * _FAR_M / min(camera.focal_px for camera in cameras)

    def near(pair: tuple[Camera, Camera]) -> list[Camera]:
        return [camera for camera in cameras if _beside_m(camera, pair[0].centre_m, pair[1].centre_m) <= limit_m]

    def length_m(pair: tuple[Camera, Camera]) -> float:
        return float(np.linalg.norm(pair[0].centre_m - pair[1].centre_m))

    pairs = [pair for pair in combinations(cameras, 2) if through is None or through in pair]
    best = max(pairs, key=lambda pair: (len(near(pair)), length_m(pair)))
    line = near(best)
    others = (camera for camera in cameras if camera not in line)
    reasons.extend(f"{other.name} does not lie on one line with {best[0].name} and {best[1].name}" for other in others)
    return line


def _beside_m(camera: Camera, first: Matrix, last: Matrix) -> float:
    along = (last - first) / np.linalg.norm(last - first)
    return float(np.linalg.norm(np.cross(camera.centre_m - first, along)))


def _turn(cameras: Sequence[Camera]) -> Matrix | None:
    """(3, 3) to a frame whose x axis is the cameras' line, pointing to their right, and z where they look.

    None where that is along the line.
    """
    centres = np.array([camera.centre_m for camera in cameras])
    across, _, ahead = np.sum([camera.rotation for camera in cameras], axis=0)
    x = np.linalg.svd(centres - centres.mean(axis=0))[2][0]
    x = -x if x @ across < 0 else x
    z = ahead - x * (x @ ahead)
    if np.linalg.norm(z) < _LEAST_ASIDE * np.linalg.norm(ahead):
        return None
    z = z / np.linalg.norm(z)
    return np.stack([x, np.cross(z, x), z])


def _in_frame(camera: Camera, turn: Matrix) -> Camera:
    return replace(camera, projection=camera.projection @ motion(turn.T, np.zeros(3)))


def _overlapping(cameras: list[Camera], reasons: list[str]) -> list[Camera]:
    """Leave out the camera that costs the others most of their view, until what is left sees enough together."""
    while len(cameras) > 1:
        alone = min(_seen_px([camera]) for camera in cameras)
        if _seen_px(cameras) >= _LEAST_SHARED * alone > 0:
            break
        worst = max(cameras, key=lambda left_out: _seen_px([camera for camera in cameras if camera is not left_out]))
        cameras = [camera for camera in cameras if camera is not worst]
        reasons.append(f"{worst.name} shares too little of its view with {', '.join(c.name for c in cameras)}")
    return cameras


def _seen_px(cameras: Sequence[Camera]) -> int:
    """Pixels of the common view."""
    try:
        view = common_view(Rig(None, tuple(replace(camera, number=n) for n, camera in enumerate(cameras, start=1))))
    except RigError:
        return 0
    return view.x.size * view.y.size
