"""What a recording says of its sensors beside their data: mountings in tf, metadata of packets, calibrations as texts.

Of transforms the beginning counts: where sensors are mounted, and which frames move against each other. What describes
sensors of packets stands on a topic beside them, is attached to the recording, or lies in the packets.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Protocol

import numpy as np

from auditor.errors import DecodingError
from auditor.model.frames import Message
from auditor.recordings import schemas
from auditor.recordings.decoding.calibration_texts import Calibrations, CameraCalibration, calibrations_of
from auditor.recordings.decoding.interface import CameraInfo, Transform, TransformsDecoder
from auditor.recordings.decoding.points.ouster import MAX_METADATA, sensor_of
from auditor.recordings.decoding.points.velodyne import calibration_of, names_no_model
from auditor.recordings.decoding.ros import RosTypes
from auditor.recordings.parameters import MOVING_FRAMES
from auditor.recordings.recording import CarriesCalibrations, Recording, Topic
from auditor.recordings.synchronisation.vehicles import transform_of
from auditor.safety.budget import MAX_TRANSFORM_BYTES, MAX_TRANSFORMS, MAX_TRANSFORMS_BYTES

_FIXED_TO_THE_WORLD = frozenset({"map", "odom", "earth"})
"""Frames in which vehicles move, by their names in REP 105."""

_MOST_ABOVE = 64  # frames above one that are looked at for a loop: it bounds the work


class Mountings:
    """The first transform between each two frames: mountings do not move."""

    def __init__(self, spaces: Collection[str] = ()) -> None:
        self._spaces = spaces
        self._known: dict[tuple[str, str], Transform] = {}
        self._above: dict[str, str] = {}
        self._last: dict[tuple[str, str], Transform] = {}
        self._steps: dict[tuple[str, str], int] = {}
        self._static: set[tuple[str, str]] = set()
        self._bytes = 0

    def __len__(self) -> int:
        return len(self._known)

    def all(self) -> tuple[Transform, ...]:
        """The transforms, in the order in which they came."""
        return tuple(self._known.values())

    def moving(self) -> frozenset[tuple[str, str]]:
        """The frames, as parent and child, that move against each other, or may as one of them is the world's."""
        moved = {link for link, steps in self._steps.items() if steps >= MOVING_FRAMES.fewest_steps}
        return frozenset(moved | {one for one in self._known.keys() - self._static if _FIXED_TO_THE_WORLD & {*one}})

    def take(self, message: Message, decoder: TransformsDecoder) -> Iterator[str]:
        """Take the transforms of a message, and give the problems. Raises DecodingError where it has none."""
        size = len(message.data)
        if size > MAX_TRANSFORM_BYTES:
            yield f"a message of {size} bytes of transforms is left out; at most {MAX_TRANSFORM_BYTES} are accepted"
        elif len(self._known) >= MAX_TRANSFORMS:
            yield f"more than {MAX_TRANSFORMS} transforms: the rest of tf is left out"
        elif self._bytes + size > MAX_TRANSFORMS_BYTES:
            yield f"more than {MAX_TRANSFORMS_BYTES} bytes of transforms: the rest of tf is left out"
        else:
            self._bytes += size
            for transform in decoder.transforms(message):
                own = transform_of(transform, message.topic, self._spaces)
                if problem := transform.problem or self._contradiction(own):
                    yield f"{transform.parent} to {transform.child}: {problem}"
                else:
                    self._place(own, static=message.topic.endswith("tf_static"))

    def _contradiction(self, transform: Transform) -> str:
        """Why a transform cannot be one of a tree, with what came before it; empty where it can."""
        if transform.parent == transform.child:
            return "a frame cannot be its own parent: it is left out"
        if (transform.parent, transform.child) in self._known:
            return ""
        above: str | None = transform.parent
        for _ in range(_MOST_ABOVE):
            above = self._above.get(above) if above is not None else None
            if above == transform.child:
                return f"a loop, {transform.child} is above {transform.parent} already: it is left out"
        return ""

    def _place(self, transform: Transform, *, static: bool) -> None:
        link = transform.parent, transform.child
        self._known.setdefault(link, transform)
        self._above.setdefault(transform.child, transform.parent)
        if static:
            self._static.add(link)
        elif _apart(self._last.setdefault(link, transform), transform):
            self._last[link] = transform
            self._steps[link] = self._steps.get(link, 0) + 1


def _apart(a: Transform, b: Transform) -> bool:
    """Whether a frame went from one place to another, and was not measured anew where it is."""
    difference = np.abs(a.parent_SE3_child - b.parent_SE3_child)
    return bool(difference[:3, 3].max() > MOVING_FRAMES.step_m or difference[:3, :3].max() > MOVING_FRAMES.step_rad)


_NAME = "metadata"


def metadata_of(recording: Recording) -> dict[str, str]:
    """By topics of packets the texts that describe their sensors.

    The driver publishes a text once, often before anything else: of a topic the first counts, and nothing behind the
    last of them is read. A text that is attached stands for all topics that have none, where there is only one. The
    packets of an HDL-64E have it in them.
    """
    beside = _beside(recording.topics())
    published = _published(recording, metadata_topics(recording.topics()))
    attached = set(_attached(recording)) if any(place not in published for place in beside.values()) else set()
    shared = attached.pop() if len(attached) == 1 else None
    pairs = ((name, published.get(place, shared)) for name, place in beside.items())
    texts = {name: text for name, text in sorted(pairs) if text is not None}
    return texts | _gathered(recording)


def metadata_topics(topics: Sequence[Topic]) -> set[str]:
    """The topics that describe the sensors of packets."""
    texts = {topic.name for topic in topics if topic.schema == schemas.STRING}
    return texts.intersection(_beside(topics).values())


def _beside(topics: Sequence[Topic]) -> dict[str, str]:
    """By topic of packets where its driver publishes the metadata."""
    packets = {topic.name for topic in topics if topic.schema in schemas.OUSTER}
    return {name: f"{name.rpartition('/')[0]}/{_NAME}" for name in packets}


def _gathered(recording: Recording) -> dict[str, str]:
    """The calibrations that packets of Velodynes hold, of LiDARs whose packets name no model."""
    calibrations: dict[str, str] = {}
    for topic in recording.topics():
        if topic.schema == schemas.VELODYNE and names_no_model(_packets(recording, topic)):
            text = calibration_of(_packets(recording, topic))
            calibrations.update({} if text is None else {topic.name: text})
    return calibrations


def _packets(recording: Recording, topic: Topic) -> Iterator[bytes]:
    types = RosTypes(recording.definition)
    for message in recording.messages({topic.name}):
        try:
            packets = types.decode(message).packets if message.schema == topic.schema else ()
        except DecodingError:
            continue
        yield from (packet.data.tobytes() for packet in packets)


def _published(recording: Recording, topics: set[str]) -> dict[str, str]:
    texts: dict[str, str] = {}
    types = RosTypes(recording.definition)
    for message in recording.messages(topics) if topics else ():
        if message.schema == schemas.STRING and message.topic not in texts and len(message.data) <= MAX_METADATA:
            try:
                texts[message.topic] = types.decode(message).data
            except DecodingError:
                continue
        if texts.keys() == topics:
            break
    return texts


def _attached(recording: Recording) -> Iterator[str]:
    for text in recording.calibrations().values() if isinstance(recording, CarriesCalibrations) else ():
        try:
            sensor_of(text)
        except DecodingError:
            continue
        yield text


_MOST_CHARACTERS = 2**17
"""Of all texts of a recording: a parser of YAML takes 12 us for each."""


class PictureTopic(Protocol):
    """A topic of pictures; see survey.ImageTopic."""

    @property
    def topic(self) -> Topic:
        """The topic."""

    @property
    def frame_id(self) -> str:
        """The frame of its first picture."""


def completed_by_texts(
    recording: Recording,
    images: Sequence[PictureTopic],
    infos: dict[str, CameraInfo],
    transforms: tuple[Transform, ...],
) -> tuple[dict[str, CameraInfo], tuple[Transform, ...], list[str]]:
    """Camera infos and transforms with what texts beside the messages add to them, and a sentence on each text."""
    texts = recording.calibrations() if isinstance(recording, CarriesCalibrations) else {}
    left, notes = _MOST_CHARACTERS, []
    for name, text in sorted(texts.items()):
        if name.lower().endswith(".json"):
            continue  # the metadata of a LiDAR's packets
        left -= len(text)
        if left < 0:
            break
        with suppress(DecodingError):  # attachments may be anything
            more, places = completed(calibrations_of(text), images, infos, transforms, replacing=False)
            added = len(more) - len(infos), len(places) - len(transforms)
            if any(added):
                notes.append(f"{name}: {added[0]} cameras and {added[1]} frames are as this text in the recording says")
            infos, transforms = more, places
    return infos, transforms, notes


def completed(
    calibrations: Calibrations,
    images: Iterable[PictureTopic],
    infos: Mapping[str, CameraInfo],
    transforms: Sequence[Transform],
    *,
    replacing: bool,
) -> tuple[dict[str, CameraInfo], tuple[Transform, ...]]:
    """Camera infos by topic, and transforms; those of the recording stay, or with `replacing` give way."""
    camera_infos, frames = dict(infos), {}
    for image in images:
        for calibration in calibrations.cameras:
            if _is_of(image.topic.name, calibration):
                frames[calibration.info.header.frame_id] = image.frame_id or calibration.info.header.frame_id
                info = replace(
                    calibration.info,
                    header=replace(calibration.info.header, frame_id=frames[calibration.info.header.frame_id]),
                )
                beside, below = (
                    f"{name}/camera_info" for name in (image.topic.name.rpartition("/")[0], image.topic.name)
                )
                if replacing and beside in camera_infos:
                    camera_infos[beside] = info
                elif beside not in camera_infos:
                    camera_infos.setdefault(below, info)
    named = tuple(
        replace(one, parent=frames.get(one.parent, one.parent), child=frames.get(one.child, one.child))
        for one in calibrations.transforms
    )
    first, then = (named, transforms) if replacing else (transforms, named)
    placed = {one.child for one in first}
    return camera_infos, (*first, *(one for one in then if one.child not in placed))


def _is_of(topic: str, calibration: CameraCalibration) -> bool:
    """Whether a calibration is that of a topic's camera: by the topic, or by a part of it that is the camera's name."""
    return topic == calibration.camera or calibration.camera.strip("/") in topic.strip("/").split("/")
