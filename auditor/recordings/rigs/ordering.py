"""The positions and viewing directions of a group of cameras.

Positions come from the projection matrices where any of them has an offset (P[3] = -fx' Tx, sensor_msgs/CameraInfo),
else from tf; never from both, since some converters write the same offset twice. Where the two contradict each other
the survey's conventions say which counts, and `contradictions` all ways to read them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from auditor.model.optics.geometry import Matrix, angle_between, motion
from auditor.recordings.parameters import RIG_LIMITS
from auditor.recordings.rigs.calibrations import Axes, Conventions, Positions, Scale, contradicts_size
from auditor.recordings.rigs.cameras import View, find_views
from auditor.recordings.rigs.frame_tree import FrameTree
from auditor.recordings.rigs.left_out import Reason, names_of
from auditor.recordings.synchronisation.survey import Survey
from auditor.recordings.synchronisation.vehicles import sharing_frames

MIN_BASELINE_M = 0.005

MAX_TURN = np.radians(0.5)
"""Rectified cameras of one rig look the same way; tf is often written with four digits."""

MAX_SQUINT = float(np.radians(20))
"""Cameras that look further apart than this share too little to be compared."""

MAX_ZOOM = 2.5
"""Of two focal lengths the longer may be so many times the shorter."""

_SAME_PLACE_M = 1e-6


@dataclass(frozen=True, eq=False)
class PlacedViews:
    """A group of views in one rig frame: `centres_m` (3,) and `rotations` (3, 3), rig frame to pictures, of each.

    `rig_SE3_anchor` is the place of the tf frame `anchor` in it.
    """

    views: tuple[View, ...]
    centres_m: tuple[Matrix, ...]
    rotations: tuple[Matrix, ...]
    anchor: str
    rig_SE3_anchor: Matrix


def grouped(views: Sequence[View], frames: FrameTree) -> list[list[View]]:
    """Views that look about the same way, at about the same scale; each is compared with the first of its group."""
    return _grouped(views, frames, _beside)


def grouped_alike(views: Sequence[View], frames: FrameTree) -> list[list[View]]:
    """Rectified views of the same intrinsics, size and direction."""
    return _grouped([view for view in views if view.rectified], frames, _alike)


def _grouped(
    views: Sequence[View], frames: FrameTree, belongs: Callable[[View, View, FrameTree], bool]
) -> list[list[View]]:
    groups: list[list[View]] = []
    for view in views:
        for group in groups:
            if belongs(group[0], view, frames):
                group.append(view)
                break
        else:
            groups.append([view])
    return groups


def _beside(a: View, b: View, frames: FrameTree) -> bool:
    zoom = float(a.K[0, 0] / b.K[0, 0])
    if not 1 / MAX_ZOOM <= zoom <= MAX_ZOOM:
        return False
    a_SE3_b = frames.between(a.frame_id, b.frame_id)
    if a_SE3_b is None:
        return _distinguished(a, b)
    return angle_between(a_SE3_b[:3, 2], np.array([0.0, 0, 1])) <= MAX_SQUINT


def _alike(a: View, b: View, frames: FrameTree) -> bool:
    if a.image.size_px != b.image.size_px or not np.allclose(a.K, b.K, rtol=1e-4, atol=0.05):
        return False
    a_SE3_b = frames.between(a.frame_id, b.frame_id)
    if a_SE3_b is None:
        return _distinguished(a, b)
    turn = np.arccos(np.clip((np.trace(a_SE3_b[:3, :3]) - 1) / 2, -1, 1))
    return bool(turn <= MAX_TURN)


def _distinguished(a: View, b: View) -> bool:
    """Without tf only offsets in P show that two cameras belong together."""
    return a.space == b.space and _distance_m(a.offset_m, b.offset_m) > _SAME_PLACE_M


def place(
    group: Sequence[View], frames: FrameTree, reasons: list[Reason], positions: Positions = Positions.P
) -> PlacedViews | None:
    """Put the views of a group into one rig frame; None, with the reason, where their positions are not known."""
    origin = _origin(group)
    offsets = [view.offset_m for view in group]
    if positions is Positions.NEGATED:
        offsets = [-offset for offset in offsets]
    by_tf = _by_tf(group, origin, frames)
    if _has_offsets(offsets) and not _two_origins(offsets, by_tf) and not (positions is Positions.TF and by_tf):
        # A frame that cameras at different places share is the one that P projects from; else it is the camera's own.
        shared = any(
            view.frame_id == origin.frame_id and _distance_m(view.offset_m, origin.offset_m) > _SAME_PLACE_M
            for view in group
        )
        anchor = np.eye(4) if shared else motion(origin.rotation.T, origin.offset_m)
        centres, rotations = offsets, [view.rotation for view in group]
    elif by_tf is not None:
        anchor = np.eye(4)
        centres = [origin_SE3_view[:3, 3] for origin_SE3_view in by_tf]
        rotations = [origin_SE3_view[:3, :3].T for origin_SE3_view in by_tf]
    else:
        if len(group) > 1:
            reasons.append(_not_placed(group))
            return None
        anchor, centres, rotations = np.eye(4), offsets, [np.eye(3)]
    return _near(PlacedViews(tuple(group), tuple(centres), tuple(rotations), origin.frame_id, anchor), reasons)


def _not_placed(group: Sequence[View]) -> Reason:
    """Why the positions of a group are not known."""
    names = tuple(view.name for view in group)
    spaces = [f"/{one}" for one in sharing_frames((view.image.topic.name, view.frame_id) for view in group)]
    if not spaces:
        return Reason(f"neither P nor tf gives the positions of {', '.join(names)}", others=names)
    problem = f"the cameras below {names_of(spaces)} have coordinate frames of the same names, as of several vehicles"
    remedy = f"record the tf of each below its own name ({spaces[0]}/tf_static), or give a rig file of one (--rig)"
    return Reason(f"{problem}: {remedy}", others=names)


class Contradictions(NamedTuple):
    """What a recording says twice of its calibration, and differently, a sentence each; and all ways to read it.

    The first candidate is the standard's. `doubts` are sentences on what is odd and may be right all the same.
    """

    sentences: tuple[str, ...]
    candidates: tuple[Conventions, ...]
    doubts: tuple[str, ...] = ()


def contradictions(survey: Survey) -> Contradictions:
    """Where the calibrations of a recording contradict each other or its pictures."""
    views, frames = find_views(survey, []), FrameTree(survey.transforms)
    sizes = [_of_size(view, survey) for view in views]
    places = [_of_places(group, frames) for group in grouped(views, frames)]
    sentences = tuple(filter(None, (*sizes, *places)))
    upwards = tuple(filter(None, (_of_axes(view, survey, frames) for view in views)))
    candidates = tuple(
        replace(survey.conventions, positions=positions, scale=scale, axes=axes)
        for positions in ((Positions.P, Positions.TF) if any(places) else (Positions.P,))
        for scale in (Scale if any(sizes) else (Scale.DECLARED,))
        for axes in (Axes if upwards else (Axes.OPTICAL,))
    )
    return Contradictions(sentences, candidates, upwards)


def _of_axes(view: View, survey: Survey, frames: FrameTree) -> str:
    """That a camera looks up or down by tf, as one does whose frame is that of its body; empty where it does not."""
    for cloud in survey.clouds:
        lidar_SE3_view = frames.between(cloud.frame_id, view.frame_id)
        if lidar_SE3_view is not None and abs(lidar_SE3_view[2, 2]) > RIG_LIMITS.steepest:
            way = "up" if lidar_SE3_view[2, 2] > 0 else "down"
            return f"by tf {view.name} looks {way}, seen from {cloud.topic.name}"
    return ""


def _of_size(view: View, survey: Survey) -> str:
    info, size_px = survey.camera_infos[view.info_topic], view.image.size_px
    if not contradicts_size(info, size_px):
        return ""
    declared = f"{info.width_px} x {info.height_px} px" + (f", binned by {max(info.binning)}" * (max(info.binning) > 1))
    return f"{view.info_topic} declares {declared}, and the pictures have {size_px[0]} x {size_px[1]} px"


def _of_places(group: Sequence[View], frames: FrameTree) -> str:
    """What P and tf say of the positions of a group where they contradict each other; empty where they do not."""
    origin = _origin(group)
    offsets = [view.offset_m for view in group]
    by_tf = _by_tf(group, origin, frames)
    if by_tf is None or not _has_offsets(offsets) or _two_origins(offsets, by_tf):
        return ""
    for view, place_in_tf in zip(group, by_tf, strict=True):
        by_p_m = view.offset_m - origin.offset_m
        by_tf_m = origin.rotation.T @ place_in_tf[:3, 3]
        apart_m = max(_distance_m(by_p_m, np.zeros(3)), _distance_m(by_tf_m, np.zeros(3)))
        if _distance_m(by_p_m, by_tf_m) > max(RIG_LIMITS.positions_agree_m, RIG_LIMITS.positions_agree * apart_m):
            return (
                f"P puts {view.name} {_metres(by_p_m)} m beside {origin.name}, and tf {_metres(by_tf_m)} m "
                "(right, down, ahead)"
            )
    return ""


def _metres(place_m: Matrix) -> str:
    return "(" + ", ".join(f"{value:+.3f}" for value in place_m) + ")"


def _origin(group: Sequence[View]) -> View:
    return min(group, key=lambda view: _distance_m(view.offset_m, np.zeros(3)))


def _has_offsets(offsets: Sequence[Matrix]) -> bool:
    return any(_distance_m(offset, np.zeros(3)) > _SAME_PLACE_M for offset in offsets)


def _near(placed: PlacedViews, reasons: list[Reason]) -> PlacedViews:
    """The views within reach of the one that has most of them within its reach."""
    centres_m = np.array(placed.centres_m)
    apart_m = np.linalg.norm(centres_m[:, None] - centres_m, axis=2)
    near = apart_m <= RIG_LIMITS.most_apart_m
    middle = int(np.argmax(near.sum(axis=1)))
    for index in np.flatnonzero(~near[middle]):
        name, other = placed.views[index].name, placed.views[middle].name
        reasons.append(Reason(f"{name} lies {apart_m[middle, index]:.0f} m from {other}: on no vehicle", name))
    kept = np.flatnonzero(near[middle]).tolist()
    return replace(
        placed,
        views=tuple(placed.views[index] for index in kept),
        centres_m=tuple(placed.centres_m[index] for index in kept),
        rotations=tuple(placed.rotations[index] for index in kept),
    )


def _by_tf(group: Sequence[View], origin: View, frames: FrameTree) -> list[Matrix] | None:
    places = []
    for view in group:
        origin_SE3_view = frames.between(origin.frame_id, view.frame_id)
        if origin_SE3_view is None:
            return None
        places.append(origin_SE3_view)
    apart = len({view.frame_id for view in group}) == len(group)
    return places if apart and len(group) > 1 else None


def _two_origins(offsets: Sequence[Matrix], by_tf: Sequence[Matrix] | None) -> bool:
    """True where two cameras without an offset lie apart in tf: each P then belongs to its own stereo pair."""
    if by_tf is None:
        return False
    origins = [
        place[:3, 3]
        for offset, place in zip(offsets, by_tf, strict=True)
        if _distance_m(offset, np.zeros(3)) <= _SAME_PLACE_M
    ]
    return any(_distance_m(place, origins[0]) > MIN_BASELINE_M for place in origins[1:])


def _distance_m(a: Matrix, b: Matrix) -> float:
    return float(np.linalg.norm(a - b))
