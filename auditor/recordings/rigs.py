"""The rigs of a recording: which cameras overlap, in which order, and where the LiDAR lies.

Positions come from the projection matrices where any of them has an offset (P[3] = -fx' Tx, sensor_msgs/CameraInfo),
else from tf; never from both, since some converters write the same offset twice.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from auditor.errors import RigError
from auditor.geometry import Matrix, camera_centre, motion
from auditor.recordings.decoding import CameraInfo
from auditor.recordings.frame_tree import FrameTree
from auditor.recordings.surveying import CloudTopic, ImageTopic, Survey
from auditor.rig import Camera, Lidar, Rig

MIN_SENSORS = 3
MIN_BASELINE_M = 0.005
MAX_TURN = np.radians(0.5)
"""Rectified cameras of one rig look the same way; tf is often written with four digits."""

_SAME_PLACE_M = 1e-6
_KNOWN_RECTIFIED = "/kitti/camera_"
"""kitti2bag writes rectified images as image_raw, with the K and D of the unrectified camera."""


@dataclass(frozen=True, eq=False)
class _View:
    """An image topic with its calibration."""

    image: ImageTopic
    info: CameraInfo
    rectified: bool

    @property
    def name(self) -> str:
        return _sensor_name(self.image.topic.name)

    @property
    def frame_id(self) -> str:
        return self.info.header.frame_id or self.image.frame_id

    @property
    def K(self) -> Matrix:
        return self.info.projection[:, :3]

    @property
    def offset_m(self) -> Matrix:
        """Optical centre in the frame that P projects from, (3,) metres."""
        return camera_centre(self.info.projection)


@dataclass(frozen=True, eq=False)
class _Placed:
    """A group of views with their centres in one rig frame, and `rig_SE3_anchor`, where a tf frame lies in it."""

    views: tuple[_View, ...]
    centres_m: tuple[Matrix, ...]
    anchor: str
    rig_SE3_anchor: Matrix


@dataclass
class _Findings:
    """Why something is not part of a rig: told where no rig comes out."""

    reasons: list[str] = field(default_factory=list)


def find_rigs(survey: Survey) -> tuple[Rig, ...]:
    """Every group of overlapping cameras that, with a LiDAR or without, has three sensors, largest first.

    Cameras whose images are not rectified come out with `rectified=False`, so that a rig file can be written and
    corrected; `check_rig` refuses them. Raises RigError, saying what is missing, where there is no such group.
    """
    if not survey.images:
        raise RigError("no triple possible: there are no camera images", remedy="give a recording with two cameras")
    findings = _Findings()
    frames = FrameTree(survey.transforms)
    views = _views(survey, findings)
    rigs = []
    for group in _groups(views, frames):
        placed = _place(group, frames, findings)
        rig = _rig(placed, survey.clouds, frames, findings) if placed else None
        if rig is not None:
            rigs.append(rig)
    if not rigs:
        raise RigError(
            "no triple possible: " + "; ".join(_summary(survey, findings)),
            remedy="three sensors must overlap: two cameras side by side and a LiDAR, or three cameras; "
            "or describe the rig in a rig file",
        )
    return tuple(sorted(rigs, key=lambda rig: -len(rig.sensors)))


def check_rig(rig: Rig, survey: Survey) -> None:
    """Raises RigError where a rig names topics that are not there, images of another size, or unrectified cameras."""
    there = {topic.name for topic in survey.topics}
    missing = [rig.topic(sensor) for sensor in rig.sensors if rig.topic(sensor) not in there]
    if missing:
        raise RigError(
            f"the recording has no topic {', '.join(missing)}",
            where="rig",
            remedy=f"it has {', '.join(sorted(there)) or 'no topics at all'}",
        )
    unrectified = [camera.topic for camera in rig.cameras if not camera.rectified]
    if unrectified:
        raise RigError(
            f"the images of {', '.join(unrectified)} are not rectified, which is not supported yet",
            where="rig",
            remedy="record rectified images; or, if they are, write a rig file and set rectified = true in it",
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
    if len(rig.sensors) < MIN_SENSORS:
        raise RigError(f"no triple possible: the rig has {len(rig.sensors)} sensors of at least 3", where="rig")


def _times(size_px: tuple[int, int]) -> str:
    return f"{size_px[0]} x {size_px[1]}"


def _views(survey: Survey, findings: _Findings) -> list[_View]:
    """One view a camera: of several topics of the same camera the rectified, then the uncompressed one."""
    best: dict[str, _View] = {}
    for image in sorted(survey.images, key=_preference):
        found = _camera_info_of(image, survey)
        if found is None:
            findings.reasons.append(f"{image.topic.name} has no camera info")
            continue
        topic, info = found
        if (
            info.projection[0, 0] <= 0
            or info.projection[1, 1] <= 0
            or abs(np.linalg.det(info.projection[:, :3])) < 1e-9
        ):
            findings.reasons.append(f"{image.topic.name} is uncalibrated (its camera info has no focal length)")
            continue
        best.setdefault(topic, _View(image, info, _is_rectified(image, info)))
    return sorted(best.values(), key=lambda view: view.image.topic.name)


def _preference(image: ImageTopic) -> tuple[bool, bool, int, str]:
    name = image.topic.name
    return "rect" not in name, "compressed" in name.lower(), len(name), name


def _camera_info_of(image: ImageTopic, survey: Survey) -> tuple[str, CameraInfo] | None:
    for namespace in _namespaces(image.topic.name):
        topic = f"{namespace}/camera_info"
        if topic in survey.camera_infos:
            return topic, survey.camera_infos[topic]
    same_frame = [item for item in survey.camera_infos.items() if item[1].header.frame_id == image.frame_id != ""]
    return same_frame[0] if len(same_frame) == 1 else None


def _namespaces(topic: str) -> Iterator[str]:
    """Where a camera info may stand: beside the image, below it, or beside the image that was compressed."""
    above, _, last = topic.rpartition("/")
    yield above
    yield topic
    if "compressed" in last or last == "raw":
        yield above.rpartition("/")[0]


def _is_rectified(image: ImageTopic, info: CameraInfo) -> bool:
    name = image.topic.name
    if "rect" in name or name.startswith(_KNOWN_RECTIFIED):
        return True
    return not any(info.distortion) and bool(
        np.allclose(info.rotation, np.eye(3), atol=1e-9) or not info.rotation.any()
    )


def _groups(views: Sequence[_View], frames: FrameTree) -> list[list[_View]]:
    """Views of the same intrinsics, size and direction; each is compared with the first of its group."""
    groups: list[list[_View]] = []
    for view in views:
        for group in groups:
            if _alike(group[0], view, frames):
                group.append(view)
                break
        else:
            groups.append([view])
    return groups


def _alike(a: _View, b: _View, frames: FrameTree) -> bool:
    if a.image.size_px != b.image.size_px or not np.allclose(a.K, b.K, rtol=1e-4, atol=0.05):
        return False
    a_SE3_b = frames.between(a.frame_id, b.frame_id)
    if a_SE3_b is None:
        # Without tf only offsets in P say that two cameras belong together.
        return _distance_m(a.offset_m, b.offset_m) > _SAME_PLACE_M
    turn = np.arccos(np.clip((np.trace(a_SE3_b[:3, :3]) - 1) / 2, -1, 1))
    return bool(turn <= MAX_TURN)


def _place(group: Sequence[_View], frames: FrameTree, findings: _Findings) -> _Placed | None:
    """Put the views of a group into one rig frame."""
    origin = min(group, key=lambda view: _distance_m(view.offset_m, np.zeros(3)))
    offsets = [view.offset_m for view in group]
    by_tf = _centres_by_tf(group, origin, frames)
    if any(_distance_m(offset, np.zeros(3)) > _SAME_PLACE_M for offset in offsets) and not _two_origins(offsets, by_tf):
        # A frame shared by cameras at different places is the one that P projects from; else it is the camera's own.
        shared = any(
            view.frame_id == origin.frame_id and _distance_m(view.offset_m, origin.offset_m) > _SAME_PLACE_M
            for view in group
        )
        anchor_at = np.zeros(3) if shared else origin.offset_m
        centres = offsets
    elif by_tf is not None:
        anchor_at, centres = np.zeros(3), by_tf
    else:
        names = ", ".join(view.name for view in group)
        if len(group) > 1:
            findings.reasons.append(f"neither P nor tf says where {names} lie")
            return None
        anchor_at, centres = np.zeros(3), offsets
    return _Placed(tuple(group), tuple(centres), origin.frame_id, motion(np.eye(3), anchor_at))


def _centres_by_tf(group: Sequence[_View], origin: _View, frames: FrameTree) -> list[Matrix] | None:
    centres = []
    for view in group:
        origin_SE3_view = frames.between(origin.frame_id, view.frame_id)
        if origin_SE3_view is None:
            return None
        centres.append(origin_SE3_view[:3, 3])
    apart = len({view.frame_id for view in group}) == len(group)
    return centres if apart and len(group) > 1 else None


def _two_origins(offsets: Sequence[Matrix], by_tf: Sequence[Matrix] | None) -> bool:
    """True where two cameras without an offset lie apart in tf: each P is then told from its own stereo pair."""
    if by_tf is None:
        return False
    origins = [
        place for offset, place in zip(offsets, by_tf, strict=True) if _distance_m(offset, np.zeros(3)) <= _SAME_PLACE_M
    ]
    return any(_distance_m(place, origins[0]) > MIN_BASELINE_M for place in origins[1:])


def _rig(placed: _Placed, clouds: Sequence[CloudTopic], frames: FrameTree, findings: _Findings) -> Rig | None:
    order = _collinear(placed, findings)
    lidar = _lidar(placed, clouds, frames, findings)
    names = ", ".join(placed.views[index].name for index in order)
    if len(order) + (lidar is not None) < MIN_SENSORS or len(order) < 2:
        beside = f"the LiDAR {lidar.name}" if lidar else "no LiDAR"
        findings.reasons.append(
            f"{len(order)} camera{'s' * (len(order) > 1)} looking the same way ({names}) with {beside}"
        )
        return None
    cameras = tuple(
        _camera(number, placed.views[index], placed.centres_m[index]) for number, index in enumerate(order, start=1)
    )
    return Rig(lidar, cameras)


def _collinear(placed: _Placed, findings: _Findings) -> list[int]:
    """Indices of the cameras on one line, right to left; a camera at the place of another is left out."""
    by_x = sorted(range(len(placed.views)), key=lambda index: -float(placed.centres_m[index][0]))
    order: list[int] = []
    for index in by_x:
        if not order:
            order.append(index)
            continue
        step = placed.centres_m[order[-1]] - placed.centres_m[index]
        total = placed.centres_m[order[0]] - placed.centres_m[index]
        name = placed.views[index].name
        if step[0] < MIN_BASELINE_M:
            findings.reasons.append(f"{name} lies where {placed.views[order[-1]].name} lies")
        elif max(abs(total[1]), abs(total[2])) > max(0.02, 0.1 * float(total[0])):
            findings.reasons.append(f"{name} does not lie on one line with {placed.views[order[0]].name}")
        else:
            order.append(index)
    return order


def _camera(number: int, view: _View, centre_m: Matrix) -> Camera:
    width_px, height_px = view.image.size_px
    offset = view.offset_m
    # A P that already tells this centre is kept digit by digit.
    told = np.array_equal(offset, centre_m)
    projection = view.info.projection if told else view.K @ np.hstack([np.eye(3), -centre_m.reshape(3, 1)])
    return Camera(number, view.name, view.image.topic.name, width_px, height_px, projection, view.rectified)


def _lidar(placed: _Placed, clouds: Sequence[CloudTopic], frames: FrameTree, findings: _Findings) -> Lidar | None:
    """The LiDAR with the most points among those that tf connects with the cameras."""
    for cloud in sorted(clouds, key=lambda cloud: -cloud.points):
        anchor_SE3_lidar = frames.between(placed.anchor, cloud.frame_id)
        if anchor_SE3_lidar is not None:
            name = _sensor_name(cloud.topic.name)
            return Lidar(name, cloud.topic.name, placed.rig_SE3_anchor @ anchor_SE3_lidar)
        findings.reasons.append(
            f"tf does not connect {cloud.topic.name} (frame {cloud.frame_id!r}) with the camera frame {placed.anchor!r}"
        )
    return None


def _sensor_name(topic: str) -> str:
    """`/kitti/camera_gray_left/image_rect` -> `camera_gray_left`, `/kitti/velo/pointcloud` -> `velo`."""
    parts = [part for part in topic.split("/") if part]
    while len(parts) > 1 and any(word in parts[-1] for word in ("image", "compressed", "point", "cloud", "scan")):
        parts.pop()
    return parts[-1] if parts else topic


def _summary(survey: Survey, findings: _Findings) -> Iterator[str]:
    if not survey.camera_infos:
        yield "there is no camera info for any of the images"
    if not survey.clouds:
        yield "there is no LiDAR"
    yield from dict.fromkeys(findings.reasons[:12])


def _distance_m(a: Matrix, b: Matrix) -> float:
    return float(np.linalg.norm(a - b))
