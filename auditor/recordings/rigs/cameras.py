"""The cameras of a recording: image topics, each with its calibration, before they are placed in a rig."""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from auditor.errors import RigError
from auditor.model.optics.geometry import Matrix, camera_centre, motion
from auditor.model.optics.sensors import FISHEYE, NO_LENS, Lens, of_camera
from auditor.recordings.decoding import CameraInfo, Transform
from auditor.recordings.rigs.calibrations import (
    Axes,
    Conventions,
    Scale,
    ZeroLens,
    check_camera,
    check_size,
    of_pictures,
    scaled_by,
)
from auditor.recordings.rigs.left_out import Reason, first_ones, without_renamed
from auditor.recordings.synchronisation.survey import ImageTopic, Survey
from auditor.recordings.synchronisation.vehicles import space_of

_KNOWN_RECTIFIED = "/kitti/camera_"
"""kitti2bag writes rectified images as image_raw, with the K and D of the unrectified camera."""

_SAY_LENS = "give a rig file (--rig) that says which lens it has"
MOST_CANDIDATES = 200
"""Calibrated cameras a recording: it bounds the work."""


_BODY_R_OPTICAL = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])


@dataclass(frozen=True, eq=False)
class View:
    """An image topic with its calibration; `repairs` are sentences on what of the latter had to be put right.

    `space` is the namespace of its vehicle, where there are several that tf tells apart.
    """

    image: ImageTopic
    info: CameraInfo
    rectified: bool
    lens: Lens
    info_topic: str = ""
    repairs: tuple[str, ...] = ()
    axes: Axes = Axes.OPTICAL
    space: str = ""

    @property
    def name(self) -> str:
        """The camera's name, from its topic."""
        return sensor_name(self.image.topic.name)

    @property
    def topic(self) -> str:
        """The topic of its pictures."""
        return self.image.topic.name

    @property
    def frame_id(self) -> str:
        """The coordinate frame of its pictures: z looks ahead."""
        return optical_frame(self.info.header.frame_id or self.image.frame_id, self.axes)

    @property
    def K(self) -> Matrix:
        """(3, 3): directions in the camera frame to pixels of its images, without the lens distortion."""
        return self.projection[:, :3] if self.rectified else self.info.intrinsics

    @cached_property
    def projection(self) -> Matrix:
        """P, (3, 4); K without an offset where there is none, unless K is of a lens and the images are rectified."""
        if self.info.projection[0, 0] > 0 or (self.rectified and any(self.info.distortion)):
            return self.info.projection
        return np.hstack([self.info.intrinsics, np.zeros((3, 1))])

    @property
    def offset_m(self) -> Matrix:
        """Optical centre in the frame that P projects from, (3,) metres."""
        return camera_centre(self.projection)

    @property
    def rotation(self) -> Matrix:
        """(3, 3), from the frame that P projects from to that of the pictures."""
        # R of a camera info takes the camera as it is mounted to the rectified one.
        turned = not self.rectified and self.info.rotation.any()
        return self.info.rotation.T if turned else np.eye(3)


def read_by(survey: Survey, conventions: Conventions) -> Survey:
    """A survey whose calibrations are read by other conventions; frames of bodies get optical ones in tf."""
    frames = {view.frame_id for view in find_views(survey, [])} if conventions.axes is Axes.BODY else set()
    optical = (
        Transform(frame, optical_frame(frame, conventions.axes), motion(_BODY_R_OPTICAL, np.zeros(3)))
        for frame in sorted(frames)
    )
    return replace(survey, conventions=conventions, transforms=(*survey.transforms, *optical))


def zero_lenses(survey: Survey) -> dict[str, str]:
    """The image topics of cameras whose lens is one by the angle with coefficients of 0, each with a sentence on it."""
    views = filter(_has_zero_lens, find_views(survey, []))
    return {view.image.topic.name: f"the lens of {view.name} {_zero_lens(view.info)}" for view in views}


def _zero_lens(info: CameraInfo) -> str:
    return f"is called {info.distortion_model!r} with coefficients of 0"


def optical_frame(frame_id: str, axes: Axes) -> str:
    """The frame whose z axis looks ahead, of a camera whose frame is called so."""
    return frame_id if axes is Axes.OPTICAL else f"{frame_id} (optical)"


def find_views(survey: Survey, reasons: list[Reason]) -> list[View]:
    """One view a camera: of several topics of the same camera the rectified, then the uncompressed one.

    `reasons` gets a sentence for each image topic that is left out.
    """
    best: dict[str, View] = {}
    infos_by_frame = _infos_by_frame(survey)
    in_tf = {frame for transform in survey.transforms for frame in (transform.parent, transform.child)}
    for image in sorted(without_renamed(survey.images, reasons), key=_preference):
        calibration = _camera_info_of(image, survey, infos_by_frame)
        if calibration is None:
            reasons.append(Reason(f"{image.topic.name} has no camera info", image.topic.name))
            continue
        topic, info = calibration
        try:
            view = _view(image, info, survey.conventions)
        except RigError as error:
            reasons.append(Reason(f"{image.topic.name}: {error.what}", image.topic.name))
            continue
        view = replace(view, info_topic=topic, space=space_of(image.topic.name, survey.spaces))
        view = _in_known_frame(view, in_tf)
        best.setdefault(topic, replace(view, axes=survey.conventions.axes))
    views = sorted(best.values(), key=lambda view: view.image.topic.name)
    names = (view.name for view in views)
    return first_ones(views, MOST_CANDIDATES, "cameras are calibrated", names, reasons)


_OF_DATA = re.compile(
    r"image|compressed|point|cloud|scans?$|^(frames?|raw|rect|rgb|colou?r|mono|video|data|pictures?)$"
)
"""The parts of a topic's name that say what its messages are, and not whose."""


def sensor_name(topic: str) -> str:
    """`/kitti/camera_gray_left/image_rect` -> `camera_gray_left`, `/eye_a/frame` -> `eye_a`."""
    parts = [part for part in topic.split("/") if part]
    while len(parts) > 1 and _OF_DATA.search(parts[-1]):
        parts.pop()
    return parts[-1] if parts else topic


def _view(image: ImageTopic, info: CameraInfo, conventions: Conventions) -> View:
    """The view of an image topic. Raises RigError where its calibration is not that of a camera."""
    check_size(image.size_px)
    repairs = _scaled(image, info) if conventions.scale is Scale.DECLARED else ()
    info = of_pictures(info, image.size_px, conventions.scale)
    if _is_rectified(image, info):
        view = View(image, info, rectified=True, lens=NO_LENS, repairs=repairs)
    else:
        lens, K = of_camera(info.distortion_model, info.distortion, info.intrinsics)
        view = View(image, replace(info, intrinsics=K), rectified=False, lens=lens, repairs=repairs)
    if conventions.zero_lens is not ZeroLens.NAMED and _has_zero_lens(view):
        if conventions.zero_lens is ZeroLens.LEFT_OUT:
            raise RigError(
                f"its lens {_zero_lens(info)}, and images and points do not tell whether it has one: {_SAY_LENS}"
            )
        view = replace(view, lens=NO_LENS)
    check_camera((view.K, view.projection[:, :3]), view.rotation, view.lens.coefficients)
    return view


def _has_zero_lens(view: View) -> bool:
    return view.lens.model == FISHEYE and not any(view.lens.coefficients)


def _scaled(image: ImageTopic, info: CameraInfo) -> tuple[str, ...]:
    ratio = scaled_by(info, image.size_px)
    if ratio is None:
        return ()
    width_px, height_px = image.size_px
    return (
        f"{image.topic.name} has pictures of {width_px} x {height_px} px and a camera info of {info.width_px} x "
        f"{info.height_px} px: its K and P were scaled by {ratio:.3g}",
    )


def _in_known_frame(view: View, in_tf: Collection[str]) -> View:
    """The view in the frame of its pictures, where tf knows that one and not the frame of the camera info."""
    declared, of_image = view.info.header.frame_id, view.image.frame_id
    if declared in in_tf or of_image not in in_tf:
        return view
    repair = f"tf does not know {declared!r}, the frame of {view.info_topic}: the frame {of_image!r} of its pictures "
    header = replace(view.info.header, frame_id=of_image)
    repairs = (*view.repairs, *([repair + "was taken"] if declared else []))
    return replace(view, info=replace(view.info, header=header), repairs=repairs)


def _preference(image: ImageTopic) -> tuple[bool, bool, int, str]:
    name = image.topic.name
    return "rect" not in name, "compressed" in name.lower(), len(name), name


def _infos_by_frame(survey: Survey) -> dict[str, list[str]]:
    """The topics of camera infos by the coordinate frame of their pictures."""
    topics: dict[str, list[str]] = {}
    for topic, info in survey.camera_infos.items():
        topics.setdefault(info.header.frame_id, []).append(topic)
    return topics


def _camera_info_of(
    image: ImageTopic, survey: Survey, infos_by_frame: Mapping[str, Sequence[str]]
) -> tuple[str, CameraInfo] | None:
    # Where a camera has an info of its lens and one of its rectified pictures, each goes with its own.
    names = ("camera_info_rect", "camera_info") if "rect" in image.topic.name else ("camera_info",)
    for namespace in _namespaces(image.topic.name):
        for topic in (f"{namespace}/{name}" for name in names):
            if topic in survey.camera_infos:
                return topic, survey.camera_infos[topic]
    same_frame = infos_by_frame.get(image.frame_id, ()) if image.frame_id else ()
    return (same_frame[0], survey.camera_infos[same_frame[0]]) if len(same_frame) == 1 else None


def _namespaces(topic: str) -> Iterator[str]:
    """The namespaces of a camera info: beside the image, below it, or beside the image that was compressed."""
    above, _, last = topic.rpartition("/")
    yield above
    yield topic
    if "compressed" in last or last == "raw":
        yield above.rpartition("/")[0]


def _is_rectified(image: ImageTopic, info: CameraInfo) -> bool:
    name = image.topic.name
    if "rect" in name or name.startswith(_KNOWN_RECTIFIED):
        return True
    if info.distortion_model and of_camera(info.distortion_model, info.distortion, info.intrinsics)[0] != NO_LENS:
        return False
    return not any(info.distortion) and bool(
        np.allclose(info.rotation, np.eye(3), atol=1e-9) or not info.rotation.any()
    )
