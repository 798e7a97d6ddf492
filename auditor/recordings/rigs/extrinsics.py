"""Chooses, from cameras that are not rectified, those that can be, and numbers them from right to left.

Cameras on one line will share a view, of others each pair gets its own. Left out, with the reason, are cameras at the
place of another, one behind the other, and those that share too little of their view.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from auditor.errors import RigError
from auditor.model.optics.common_view import CELL_PX, FARTHEST_PX, common_view, upright
from auditor.model.optics.geometry import Matrix, motion
from auditor.model.parameters import COMMON_VIEW
from auditor.model.rig import Camera, Rig
from auditor.recordings.rigs.left_out import AtOnePlace, Reason
from auditor.recordings.rigs.ordering import MIN_BASELINE_M

_LEAST_SHARED = 0.25
_LEAST_ASIDE = 0.5  # sine of the angle between the direction from one camera to another and their viewing direction
_MOST_CELLS = 160  # rays from the middle of a view to its edge, where cameras are only compared: it bounds the work


def aligned(
    cameras: Sequence[Camera], reasons: list[Reason], through: Camera | None = None
) -> tuple[list[Camera], Matrix]:
    """The cameras that make a rig, in a frame whose x axis points to their right, and the (3, 3) turn into that frame.

    `through` names a camera that is kept: others are left out in its place. Of cameras on one line x is the line.
    """
    standing = apart(cameras, reasons)
    if through is not None and through not in standing:
        return standing[:1], np.eye(3)
    kept = standing
    while len(kept) > 1:
        turn = _turn(kept)
        if turn is None:
            names = tuple(camera.name for camera in kept)
            reasons.append(Reason(f"{', '.join(names)} stand one behind the other", others=names))
            break
        rig = _numbered(sorted((_in_frame(camera, turn) for camera in kept), key=lambda c: -float(c.centre_m[0])))
        odd = _odd_one_out(rig, through, reasons)
        if odd is None:
            return list(rig.cameras), turn
        kept = [camera for camera in kept if camera.topic != odd.topic]
    return standing[:1], np.eye(3)


def apart(cameras: Sequence[Camera], reasons: list[Reason]) -> list[Camera]:
    """The cameras less those at the place of another; `reasons` gets a sentence for each of these."""
    kept: list[Camera] = []
    centres_m = np.empty((len(cameras), 3))
    for camera in cameras:
        near = np.linalg.norm(centres_m[: len(kept)] - camera.centre_m, axis=1) < MIN_BASELINE_M
        if near.any():
            reasons.append(AtOnePlace(camera, kept[int(np.argmax(near))]))
        else:
            centres_m[len(kept)] = camera.centre_m
            kept.append(camera)
    return kept


def _turn(cameras: Sequence[Camera]) -> Matrix | None:
    """(3, 3) to a frame with x to the cameras' right, along their line if they have one, and z where they look.

    None where that is along the line.
    """
    if not _numbered(cameras).shares_view:
        return upright(cameras)
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


def _numbered(cameras: Sequence[Camera]) -> Rig:
    return Rig(None, tuple(replace(camera, number=number) for number, camera in enumerate(cameras, start=1)))


def _odd_one_out(rig: Rig, through: Camera | None, reasons: list[Reason]) -> Camera | None:
    """The camera that has to be left out next, if any; the reason is added to the reasons."""
    if not rig.shares_view and (odd := _least_fitting(rig, _aside, _LEAST_ASIDE, through)):
        return _left_out(*odd, "{} stands behind {} or in front of it", reasons)
    alone = min(_seen_px([camera]) for camera in rig.cameras)
    if not _seen_px(rig.cameras) >= _LEAST_SHARED * alone > 0:
        worst = max(rig.cameras, key=lambda left_out: _seen_px([c for c in rig.cameras if c is not left_out]))
        others = ", ".join(camera.name for camera in rig.cameras if camera is not worst)
        reasons.append(Reason(f"{worst.name} shares too little of its view with {others}", worst.name))
        return worst

    def shared(a: Camera, b: Camera) -> float:
        return _seen_px([a, b], widest=True) / alone

    if not rig.shares_view and (odd := _least_fitting(rig, shared, _LEAST_SHARED, through)):
        return _left_out(*odd, "{} shares too little of its view with {} once both are rectified", reasons)
    return None


def _left_out(odd: Camera, other: Camera, why: str, reasons: list[Reason]) -> Camera:
    reasons.append(Reason(why.format(odd.name, other.name), odd.name, (other.name,)))
    return odd


def _least_fitting(
    rig: Rig, fit: Callable[[Camera, Camera], float], least: float, through: Camera | None
) -> tuple[Camera, Camera] | None:
    """Of the cameras that fit another one by less than `least` the one that fits all worst, and that other one.

    Only pairs that are matched have to fit.
    """
    fits = {(rig.camera(i), rig.camera(k)): fit(rig.camera(i), rig.camera(k)) for i, k in rig.pairs}
    poor = [pair for pair, its in fits.items() if its < least]
    candidates = [c for pair in poor for c in pair if through is None or c.topic != through.topic]
    if not candidates:
        return None
    odd = min(candidates, key=lambda camera: sum(its for pair, its in fits.items() if camera in pair))
    (other, *_) = (c for pair in poor if odd in pair for c in pair if c is not odd)
    return odd, other


def _aside(a: Camera, b: Camera) -> float:
    """The sine of the angle between the direction from one to the other and their viewing direction."""
    ahead, apart = a.rotation[2] + b.rotation[2], b.centre_m - a.centre_m
    return float(np.linalg.norm(np.cross(ahead, apart)) / np.linalg.norm(ahead) / np.linalg.norm(apart))


def _seen_px(cameras: Sequence[Camera], *, widest: bool = False) -> int:
    """The number of pixels of the common view that all see."""
    focal_px = min(camera.focal_px for camera in cameras)
    reach_px = min(COMMON_VIEW.widest * focal_px, FARTHEST_PX)
    cell_px = max(CELL_PX, int(reach_px / _MOST_CELLS))
    try:
        return common_view(_numbered(cameras), widest=widest, cell_px=cell_px).seen_px
    except RigError:
        return 0
