"""The rigs of a recording: which cameras look the same way, in which order, and where the LiDAR lies."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from auditor.errors import RigError
from auditor.model.optics.common_view import common_view
from auditor.model.optics.geometry import Matrix, motion
from auditor.model.rig import LIDAR, Camera, Lidar, Rig
from auditor.recordings.decoding.calibration_texts import Calibrations
from auditor.recordings.parameters import RIG_LIMITS
from auditor.recordings.rigs.cameras import View, find_views
from auditor.recordings.rigs.extrinsics import aligned, apart
from auditor.recordings.rigs.files import chained_cameras, read_calibrations, read_rig
from auditor.recordings.rigs.frame_tree import FrameTree
from auditor.recordings.rigs.lacking import lacking_calibration, no_rig, no_sensors, told_together, what_to_record
from auditor.recordings.rigs.left_out import AtOnePlace, Reason, TooFew, first_ones, names_of, overlapping_most
from auditor.recordings.rigs.lidars import best_lidar, lidar_of, lidars_alone, on_vehicle
from auditor.recordings.rigs.ordering import (
    MIN_BASELINE_M,
    PlacedViews,
    grouped,
    grouped_alike,
    place,
)
from auditor.recordings.synchronisation.descriptions import completed
from auditor.recordings.synchronisation.survey import CloudTopic, Survey

MIN_SENSORS = 3
IDENTIFYING = 4
"""The least number of sensors that identify an attacked one; three can only detect an attack."""
_MOST_RIGS = 24  # it bounds the work


class FoundRigs(NamedTuple):
    """The rigs of a recording, with cameras and large ones first, and why other cameras and LiDARs are in none."""

    rigs: tuple[Rig, ...]
    left_out: tuple[Reason, ...]

    @property
    def reasons(self) -> tuple[str, ...]:
        """The reasons in words."""
        return tuple(map(str, self.left_out))


def find_rigs(survey: Survey) -> tuple[Rig, ...]:
    """As `search_rigs`. Raises RigError, saying what is missing, where there is none."""
    if not survey.images and not survey.clouds:
        raise no_sensors(survey)
    search = search_rigs(survey)
    if not search.rigs:
        raise no_rig(survey, search.left_out)
    return search.rigs


def search_rigs(survey: Survey) -> FoundRigs:
    """Every group of overlapping cameras that, with a LiDAR or without, has three sensors.

    Rectified cameras of one size and focal length are taken as they are. Where these are too few to identify an
    attacked one, or one more stands beside their line, all that look the same way are one rig, to be rectified when
    they are measured. Each camera that is in no such rig is one of its own with the LiDAR: its own past stands in for a
    second camera. LiDARs that overlap are a rig besides. Each that is in no rig is one alone, with its own past.
    """
    reasons: list[Reason] = []
    rigs: list[Rig] = []
    frames = FrameTree(survey.transforms)
    survey = replace(survey, clouds=on_vehicle(survey, frames, reasons))
    views = find_views(survey, reasons)
    why: list[Reason] = []
    groups = grouped(views, frames)
    for group in groups:
        rigs.extend(_rigs_of(group, survey, frames, why))
    alone = list(_lone_rigs(_in_no_rig(views, rigs, why), survey, frames))
    reasons.extend(_of_others(told_together(why, groups, frames), [rig.camera(1).name for rig in alone]))
    rigs.extend(alone)
    rigs.extend(lidars_alone(rigs, survey, frames, reasons))
    if rigs and survey.images and not any(rig.cameras for rig in rigs):
        reasons.extend(map(Reason, lacking_calibration(survey)))
    rigs.sort(key=lambda rig: (not rig.cameras, -len(rig.sensors)))
    names = (f"the one of {names_of([camera.name for camera in rig.cameras] or [rig.name(LIDAR)])}" for rig in rigs)
    rigs = first_ones(rigs, _MOST_RIGS, "rigs are possible", names, reasons)
    return FoundRigs(tuple(rigs), tuple(dict.fromkeys(reasons)))


def _rigs_of(group: Sequence[View], survey: Survey, frames: FrameTree, reasons: list[Reason]) -> Iterator[Rig]:
    alike = grouped_alike(group, frames)
    why: list[Reason] = []
    beside: list[Reason] = []
    rectified = [rig for views in alike if (rig := _rectified_rig(views, survey, frames, why, beside)) is not None]
    one_kind = [len(views) for views in alike] == [len(group)]
    enough = one_kind or any(len(rig.sensors) >= IDENTIFYING for rig in rectified)
    if not enough or beside:
        why_mixed: list[Reason] = []
        mixed = list(_mixed_rigs(group, survey, frames, why_mixed))
        if not enough or (mixed and mixed[0].n > max((rig.n for rig in rectified), default=0)):
            reasons.extend(why_mixed)
            yield from mixed or rectified
            return
    reasons.extend(why + beside)
    yield from rectified


def _in_no_rig(views: Sequence[View], rigs: Sequence[Rig], reasons: Sequence[Reason]) -> list[View]:
    """The views of cameras that no rig has: neither by this topic nor by another of the same frame or place."""
    topics = {camera.topic for rig in rigs for camera in rig.cameras}
    held = {view.frame_id for view in views if view.image.topic.name in topics and view.frame_id}
    doubled = {why.of for why in reasons if isinstance(why, AtOnePlace)}
    outside = [view for view in views if view.image.topic.name not in topics and view.frame_id not in held]
    return [view for view in outside if not (rigs and view.name in doubled)]


def _of_others(reasons: Sequence[Reason], names: Collection[str]) -> Iterator[Reason]:
    """The reasons why cameras are not compared, but for those of cameras of these names: they are after all."""
    return (why for why in reasons if not names or not (isinstance(why, TooFew) or why.of in names))


def _lone_rigs(views: Sequence[View], survey: Survey, frames: FrameTree) -> Iterator[Rig]:
    """A rig of each camera with the LiDAR; further topics of one camera are left out."""
    of_cameras: dict[str, View] = {}
    for view in views:
        of_cameras.setdefault(view.frame_id or view.image.topic.name, view)
    for view in of_cameras.values():
        placed = place([view], frames, [], survey.conventions.positions)
        lidar = _lidar(placed, survey.clouds, frames, []) if placed else None
        if placed is not None and lidar is not None and _within_reach(placed, lidar):
            camera = _rectified_camera(placed, 0) if view.rectified else _turned_camera(placed, 0)
            yield Rig(lidar, (replace(camera, number=1),))


def _within_reach(placed: PlacedViews, lidar: Lidar) -> bool:
    """Whether a lone camera and a LiDAR may be on one vehicle."""
    apart_m = float(np.linalg.norm(lidar.rig_SE3_lidar[:3, 3] - placed.centres_m[0]))
    return apart_m <= RIG_LIMITS.most_apart_m


def _rectified_rig(
    views: Sequence[View], survey: Survey, frames: FrameTree, reasons: list[Reason], beside: list[Reason]
) -> Rig | None:
    placed = place(views, frames, reasons, survey.conventions.positions)
    if placed is None:
        return None
    order = _collinear(placed, reasons, beside)
    cameras = overlapping_most([_rectified_camera(placed, index) for index in order], reasons)
    return _rig(cameras, _lidar(placed, survey.clouds, frames, reasons), reasons)


def _mixed_rigs(views: Sequence[View], survey: Survey, frames: FrameTree, reasons: list[Reason]) -> Iterator[Rig]:
    """Rigs of the cameras that can be measured together; each camera left out gets a rig with those that fit it."""
    placed = place(views, frames, reasons, survey.conventions.positions)
    if placed is None:
        return
    lidar = _lidar(placed, survey.clouds, frames, reasons)
    why: list[Reason] = []
    cameras = apart([_turned_camera(placed, index) for index in range(len(placed.views))], why)
    cameras = overlapping_most(cameras, reasons)
    covered: set[str] = set()
    for through in (None, *cameras):
        if through is not None and (through.topic in covered or not covered):
            continue
        # The reasons why a second rig leaves cameras out are not given: these cameras are in the first rig.
        together, turn = aligned(cameras, why if through is None else [], through)
        rig = _rig(together, _turned(lidar, turn), why if through is None else [])
        if rig is not None and (through is None or through.topic in map(rig.topic, rig.sensors)):
            covered.update(camera.topic for camera in rig.cameras)
            yield rig
    names = {camera.name for camera in cameras if camera.topic in covered}
    reasons.extend(reason for reason in why if reason.of not in names)


def _rig(cameras: Sequence[Camera], lidar: Lidar | None, reasons: list[Reason]) -> Rig | None:
    if len(cameras) + (lidar is not None) < MIN_SENSORS or len(cameras) < 2:
        reasons.append(TooFew([camera.name for camera in cameras]))
        return None
    return Rig(lidar, tuple(replace(camera, number=number) for number, camera in enumerate(cameras, start=1)))


def given_rig(path: Path, survey: Survey) -> Rig:
    """The rig of a file: a rig.toml, or calibrations in YAML. Raises RigError where it does not fit the recording."""
    rig = _with_depths(rig_of_yaml(path, survey) if _is_yaml(path) else read_rig(path), survey)
    check_rig(rig, survey)
    return rig


def _with_depths(rig: Rig, survey: Survey) -> Rig:
    """The rig with the depths that the recording shows, where the file does not say them."""
    shown = {image.topic.name: image.depth_bits for image in survey.images}
    cameras = (replace(camera, depth_bits=camera.depth_bits or shown.get(camera.topic)) for camera in rig.cameras)
    return replace(rig, cameras=tuple(cameras))


def check_rig_file(path: Path) -> None:
    """Raises RigError where a rig file cannot be read, whatever the recordings."""
    if _is_yaml(path):
        read_calibrations(path)
    else:
        read_rig(path)


def _is_yaml(path: Path) -> bool:
    return path.suffix in {".yaml", ".yml"}


def rig_of_yaml(path: Path, survey: Survey) -> Rig:
    """The rig of Kalibr's camchain.yaml, or that of the most sensors by the recording and other calibrations in YAML.

    Raises RigError where the file has none, or gives no rig.
    """
    calibrations = read_calibrations(path)
    if any(camera.info.header.frame_id for camera in calibrations.cameras):
        return _rig_of_camchain(path, calibrations, survey)
    infos, transforms = completed(calibrations, survey.images, survey.camera_infos, survey.transforms, replacing=True)
    searched = search_rigs(replace(survey, camera_infos=infos, transforms=transforms))
    rigs = [rig for rig in searched.rigs if rig.cameras]  # a LiDAR alone needs no calibration
    if not rigs:
        raise RigError("no rig by these calibrations: " + "; ".join(searched.reasons), where=path)
    return rigs[0]


def _rig_of_camchain(path: Path, calibrations: Calibrations, survey: Survey) -> Rig:
    """The rig of Kalibr's camchain.yaml, with the LiDAR that the recording's tf connects with one of its cameras.

    Raises RigError where its cameras form no rig.
    """
    reasons: list[Reason] = []
    cameras = chained_cameras(calibrations, path)
    _check_count(len(cameras))
    aside, turn = aligned(cameras, reasons)
    rig = _rig(aside, _turned(_lidar_beside(cameras, survey), turn), reasons)
    if rig is None:
        why = "; ".join(map(str, reasons))
        raise RigError(f"no triple possible: {why}", where=path, remedy=what_to_record(reasons))
    return rig


def _lidar_beside(cameras: Sequence[Camera], survey: Survey) -> Lidar | None:
    frames = FrameTree(survey.transforms)
    frame_ids = {image.topic.name: image.frame_id for image in survey.images}
    for camera in cameras:
        for cloud in sorted(on_vehicle(survey, frames, []), key=lambda cloud: -cloud.points):
            camera_SE3_lidar = frames.between(frame_ids.get(camera.topic, ""), cloud.frame_id)
            if camera_SE3_lidar is not None:
                rig_SE3_lidar = motion(camera.rotation.T, camera.centre_m) @ camera_SE3_lidar
                return lidar_of(cloud, rig_SE3_lidar, camera.rotation[2])
    return None


def _turned(lidar: Lidar | None, turn: Matrix) -> Lidar | None:
    return replace(lidar, rig_SE3_lidar=motion(turn, np.zeros(3)) @ lidar.rig_SE3_lidar) if lidar else None


def check_rig(rig: Rig, survey: Survey) -> None:
    """Raises RigError where a rig names topics that are not there, images of another size, or has no common view."""
    _check_count(rig.n)
    there = {topic.name for topic in survey.topics}
    missing = [rig.topic(sensor) for sensor in rig.sensors if rig.topic(sensor) not in there]
    if missing:
        raise RigError(
            f"the recording has no topic {', '.join(missing)}",
            where="rig",
            remedy=f"it has {', '.join(sorted(there)) or 'no topics at all'}",
        )
    seen = {image.topic.name: image.size_px for image in survey.images}
    for camera in rig.cameras:
        size_px = camera.width_px, camera.height_px
        if seen.get(camera.topic, size_px) != size_px:
            raise RigError(
                f"{camera.topic} has images of {_times(seen[camera.topic])} px, not {_times(size_px)}",
                where="rig",
                remedy="take the rig file of this vehicle",
            )
    if len(rig.sensors) < MIN_SENSORS and not rig.by_time:
        raise RigError(f"no triple possible: the rig has {len(rig.sensors)} sensors of at least 3", where="rig")
    if not rig.is_rectified:
        common_view(rig)
    if not rig.shares_view:
        for pair in rig.required_pairs:
            common_view(rig.pair(*pair), widest=True)


def _check_count(cameras: int) -> None:
    if cameras > RIG_LIMITS.most_cameras:
        raise RigError(
            f"the rig has {cameras} cameras, and at most {RIG_LIMITS.most_cameras} are compared",
            where="rig",
            remedy="leave out those that overlap the others least",
        )


def _times(size_px: tuple[int, int]) -> str:
    return f"{size_px[0]} x {size_px[1]}"


def _collinear(placed: PlacedViews, reasons: list[Reason], beside: list[Reason]) -> list[int]:
    """Indices of the cameras on one line, right to left; a camera at the place of another is left out.

    The reason is added to `beside` for cameras that do not lie on the line, to `reasons` for others.
    """
    by_x = sorted(range(len(placed.views)), key=lambda index: -float(placed.centres_m[index][0]))
    order: list[int] = []
    for index in by_x:
        if not order:
            order.append(index)
            continue
        step = placed.centres_m[order[-1]] - placed.centres_m[index]
        total = placed.centres_m[order[0]] - placed.centres_m[index]
        view = placed.views[index]
        if step[0] < MIN_BASELINE_M:
            reasons.append(AtOnePlace(view, placed.views[order[-1]]))
        elif max(abs(total[1]), abs(total[2])) > max(0.02, 0.1 * float(total[0])):
            beside.append(Reason(f"{view.name} does not lie on one line with {placed.views[order[0]].name}", view.name))
        else:
            order.append(index)
    return order


def _rectified_camera(placed: PlacedViews, index: int) -> Camera:
    """The camera of a rectified view where it was placed; its number is not known yet."""
    view, centre_m = placed.views[index], placed.centres_m[index]
    # A P that already has this centre is kept digit by digit.
    declared = np.array_equal(view.offset_m, centre_m)
    return _camera(
        view, view.projection if declared else view.K @ np.column_stack([np.eye(3), -centre_m]), rectified=True
    )


def _turned_camera(placed: PlacedViews, index: int) -> Camera:
    view, centre_m = placed.views[index], placed.centres_m[index]
    seen_from = np.column_stack([np.eye(3), -centre_m])
    return _camera(view, view.K @ placed.rotations[index] @ seen_from, rectified=False)


def _camera(view: View, projection: Matrix, *, rectified: bool) -> Camera:
    width_px, height_px = view.image.size_px
    name, topic, depth_bits = view.name, view.image.topic.name, view.image.depth_bits
    return Camera(0, name, topic, width_px, height_px, projection, rectified, view.lens, depth_bits=depth_bits)


def _lidar(placed: PlacedViews, clouds: Sequence[CloudTopic], frames: FrameTree, reasons: list[Reason]) -> Lidar | None:
    """The LiDAR that covers most of what the cameras see, among those that tf connects with them."""
    connected: list[tuple[CloudTopic, Matrix]] = []
    for cloud in sorted(clouds, key=lambda cloud: -cloud.points):
        anchor_SE3_lidar = frames.between(placed.anchor, cloud.frame_id)
        if anchor_SE3_lidar is not None:
            connected.append((cloud, placed.rig_SE3_anchor @ anchor_SE3_lidar))
        elif not connected:
            frame, topic = f"(frame {cloud.frame_id!r})", cloud.topic.name
            why = f"tf does not connect {topic} {frame} with the camera frame {placed.anchor!r}"
            reasons.append(Reason(f"{why}: record their tf, or describe the rig in a rig file (--rig)", topic))
    best = best_lidar(placed, connected)
    return lidar_of(*best, np.sum([rotation[2] for rotation in placed.rotations], axis=0)) if best else None
