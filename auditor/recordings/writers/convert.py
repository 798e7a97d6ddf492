"""Copies of recordings as MCAP files with ROS 2 messages: unchanged, or with the data of some topics changed.

Messages in CDR, and those of other encodings that MCAP carries, keep their bytes. ROS 1 messages become CDR. A KITTI
drive's PNG files become CompressedImage messages that hold the same bytes, on the drive's own topics. A clip is some
seconds of a recording, whose messages are as they were recorded, to the last bit.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from types import MappingProxyType
from typing import Any, cast

import cv2
import numpy as np
from numpy.typing import NDArray
from rosbags.serde import SerdeError
from rosbags.typesys import TypesysError
from rosbags.typesys.store import Typestore

from auditor.errors import DecodingError, RecordingError
from auditor.model.frames import CameraImage, Message, PointCloud
from auditor.model.verdict import AttackLabel
from auditor.recordings import schemas
from auditor.recordings.decoding import Decoders
from auditor.recordings.decoding.clouds import PointCloudDecoder
from auditor.recordings.decoding.images import CompressedImageDecoder, RawImageDecoder
from auditor.recordings.decoding.kitti import OXTS, scan_points
from auditor.recordings.decoding.picture_heads import inspect_picture
from auditor.recordings.decoding.pictures import encode_picture
from auditor.recordings.decoding.poses import PoseDecoder
from auditor.recordings.decoding.ros import RosTypes, Types, registered, types_of
from auditor.recordings.recording import Damage, Definition, Recording, Topic
from auditor.recordings.synchronisation.descriptions import metadata_topics
from auditor.recordings.writers.mcap_file import mcap_file
from auditor.recordings.writers.messages import MessageMaker

Change = Callable[[CameraImage], CameraImage] | Callable[[PointCloud], PointCloud]
_GREY_ENCODINGS = {"mono8", "8UC1"}
_COLOUR_ENCODINGS = {"bgr8", "8UC3"}
HEADER = "std_msgs/msg/Header"
_ENDING = ".mcap"
_KITTI_SCHEMAS = "kitti/"
_ROS_ENCODINGS = frozenset({"cdr", "ros1"})


class Changing:
    """Changes ROS 2 messages, given a function that finds their definitions."""

    def __init__(
        self, maker: MessageMaker, definition: Callable[[str], Definition | None], depths: Mapping[str, int]
    ) -> None:
        self._maker = maker
        self._types = RosTypes(definition)
        self._raw, self._compressed = RawImageDecoder(self._types), CompressedImageDecoder(self._types)
        self._clouds = PointCloudDecoder(self._types)
        for topic, bits in depths.items():
            self._raw.use_depth(topic, bits)
            self._compressed.use_depth(topic, bits)
        self._makers: dict[str, Callable[[Message, Any], bytes]] = {
            schemas.IMAGE: self._raw_image,
            schemas.COMPRESSED_IMAGE: self._compressed_image,
            schemas.POINT_CLOUD: self._point_cloud,
        }

    def change(self, message: Message, change: Change) -> Message:
        """The changed message; the same one where it cannot be decoded: damaged messages are copied."""
        make = self._makers.get(message.schema)
        if make is None or message.encoding != "cdr":
            raise DecodingError(f"{message.schema} cannot be changed", where=message.topic)
        try:
            data = make(message, change)
        except DecodingError:
            return message
        return Message(message.topic, message.schema, message.encoding, message.log_time_ns, data)

    def _raw_image(self, message: Message, change: Callable[[CameraImage], CameraImage]) -> bytes:
        decoder = self._raw
        header = decoder.header(message)
        pixels = change(CameraImage(0, header.stamp_ns, decoder.pixels(message, colour=True))).pixels
        encoding = self._types.decode(message).encoding
        if pixels.ndim == 2:
            encoding = encoding if encoding in _GREY_ENCODINGS else "mono8"
        elif encoding == "rgb8":
            pixels = cast("NDArray[np.uint8]", cv2.cvtColor(pixels, cv2.COLOR_BGR2RGB))
        else:
            encoding = encoding if encoding in _COLOUR_ENCODINGS else "bgr8"
        return self._maker.raw_image(pixels, encoding, self._maker.header(header.stamp_ns, header.frame_id))

    def _compressed_image(self, message: Message, change: Callable[[CameraImage], CameraImage]) -> bytes:
        decoder = self._compressed
        header = decoder.header(message)
        form = inspect_picture(decoder.picture(message)).form
        pixels = change(CameraImage(0, header.stamp_ns, decoder.pixels(message, colour=True))).pixels
        data = encode_picture(pixels, form)
        # The format is free text that may describe the colours; it is kept.
        return self._maker.compressed_image(data, self._types.decode(message).format, header.stamp_ns, header.frame_id)

    def _point_cloud(self, message: Message, change: Callable[[PointCloud], PointCloud]) -> bytes:
        cloud = self._types.decode(message)
        stamp = cloud.header.stamp.sec * 10**9 + cloud.header.stamp.nanosec
        before = self._clouds.xyz_m(message)
        after = change(PointCloud(stamp, before)).xyz_m
        # The attacked cloud does not say which old point a new one was: intensities are not copied.
        points = np.zeros((len(after), 4), np.float32)
        points[:, :3] = after
        return self._maker.point_cloud(points, stamp, cloud.header.frame_id)


@dataclass(frozen=True)
class ConvertReport:
    """The result of a conversion: messages written by topic, topics left out with reasons, and the source's damage."""

    target: Path
    messages: Mapping[str, int]
    left_out: Mapping[str, str]
    damage: tuple[Damage, ...]


def convert(recording: Recording, target: Path) -> ConvertReport:
    """Write any recording as MCAP, its ground truth and metadata with it; other attachments are left behind.

    Raises RecordingError where the target does not end in .mcap, exists or cannot be written.
    """
    return rewrite(recording, target, {}, ())


def rewrite(
    recording: Recording,
    target: Path,
    changes: Mapping[str, Change],
    labels: Iterable[AttackLabel],
    depths: Mapping[str, int] = MappingProxyType({}),
) -> ConvertReport:
    """Copy a recording to MCAP with the data of some topics changed, and ground truth written inside.

    `changes` goes by topic: a function from CameraImage to CameraImage (colours as BGR where there are any; `sensor` is
    0), or from PointCloud to PointCloud. An image keeps the form it had (raw, PNG, JPEG at quality 95); a message that
    cannot be decoded stays as it is. Of values of more than 8 bits, as many as `depths` says by topic, the upper 8 are
    changed and written. `labels` is called after the last message. Raises RecordingError where a topic
    is not there, or the target does not end in .mcap, exists or cannot be written.
    """
    if target.suffix.lower() != _ENDING:
        raise RecordingError("recordings are written as MCAP", where=target, remedy=f"call it {target.stem}{_ENDING}")
    if target.exists():
        raise RecordingError("it exists already", where=target, remedy="choose another name, or remove it")
    there = {topic.name for topic in recording.topics()}
    if missing := sorted(changes.keys() - there):
        raise RecordingError(f"there is no topic {', '.join(missing)} to change", where=recording.path)
    ros2 = all(
        topic.encoding in _ROS_ENCODINGS or topic.schema.startswith(_KITTI_SCHEMAS) for topic in recording.topics()
    )
    maker = MessageMaker("cdr")
    copying = _Copying(recording, maker)
    changing = Changing(maker, copying.definition, depths)
    messages: dict[str, int] = {}
    last_ns = 0
    with mcap_file(target, profile="ros2" if ros2 else "", compression="zstd") as file:
        for message in recording.messages():
            outgoing = copying.to_ros2(message)
            if outgoing is None:
                continue
            if message.topic in changes:
                outgoing = changing.change(outgoing, changes[message.topic])
            topic = Topic(outgoing.topic, outgoing.schema, outgoing.encoding)
            file.write(topic, copying.definition(outgoing.schema), outgoing.log_time_ns, outgoing.data)
            messages[topic.name] = messages.get(topic.name, 0) + 1
            last_ns = max(last_ns, outgoing.log_time_ns)
        file.add_labels((*recording.labels(), *labels), last_ns)
        file.add_metadata({**recording.metadata(), "clock": recording.clock, "source": recording.recording_id})
    return ConvertReport(target, messages, copying.left_out, recording.damage)


class _Copying:
    """Turns the messages of one recording into ROS 2 messages, or leaves them as they are."""

    def __init__(self, recording: Recording, maker: MessageMaker) -> None:
        self._recording = recording
        self._maker = maker
        self._decoders = Decoders(recording.definition)
        self._poses = PoseDecoder(self._decoders.types)
        self._stores: dict[str, Typestore] = {}
        self.left_out: dict[str, str] = {}

    def definition(self, schema: str) -> Definition | None:
        """The definition to be written: the recording's own, unless its messages are serialised anew."""
        own = self._decoders.types.definition(schema)
        if own is not None and own.encoding != "ros1msg":
            return own
        store = self._stores.get(schema, self._maker.store)
        if schema not in store.fielddefs:
            return self._recording.definition(schema)  # one without text is copied as it is
        return Definition("ros2msg", store.generate_msgdef(schema, ros_version=2)[0].encode())

    def to_ros2(self, message: Message) -> Message | None:
        """The message to be written, or None, noting the topic, where it cannot be converted."""
        try:
            if message.schema.startswith(_KITTI_SCHEMAS):
                schema, data = self._from_kitti(message)
            elif message.encoding == "ros1":
                schema, data = message.schema, self._from_ros1(message)
            elif message.encoding == "cdr" and self.definition(message.schema) is None:
                self.left_out[message.topic] = f"the recording does not define {message.schema}"
                return None
            else:
                return message
        except (DecodingError, SerdeError, TypesysError, KeyError, AssertionError) as error:
            self.left_out[message.topic] = " ".join(str(error).split())
            return None
        return Message(message.topic, schema, "cdr", message.log_time_ns, data)

    def _from_ros1(self, message: Message) -> bytes:
        store = self._stores.get(message.schema)
        if store is None:
            store = _ros2_store(message.schema, self._decoders.types.definition(message.schema))
            self._stores[message.schema] = store
        return bytes(store.ros1_to_cdr(memoryview(message.data), message.schema))

    def _from_kitti(self, message: Message) -> tuple[str, bytes]:
        maker, decoder = self._maker, self._decoders.of(message.schema, message.encoding)
        if message.schema == OXTS:
            [(stamp_ns, fix)] = self._poses.poses(message)
            return schemas.GPS_FIX, maker.fix(fix, stamp_ns)
        assert decoder is not None
        if decoder.kind == "transforms":
            transforms = decoder.transforms(message)
            children = {transform.child: transform.parent_SE3_child for transform in transforms}
            parent = transforms[0].parent if transforms else ""
            return schemas.TRANSFORMS, maker.transforms(parent, children, message.log_time_ns)
        header = decoder.header(message)
        stamp = header.stamp_ns, header.frame_id
        if decoder.kind == "camera_info":
            info = decoder.camera_info(message)
            return schemas.CAMERA_INFO, maker.camera_info(info.projection, info.width_px, info.height_px, *stamp)
        if decoder.kind == "image":
            return schemas.COMPRESSED_IMAGE, maker.compressed_image(message.data, "png", *stamp)
        return schemas.POINT_CLOUD, maker.point_cloud(scan_points(message), *stamp)


def _ros2_store(schema: str, definition: Definition | None) -> Typestore:
    """The ROS 2 form of a ROS 1 definition: the same fields in lower case, headers without their counter."""
    types: Types = {
        name: (constants, [(field.lower(), kind) for field, kind in fields if (name, field) != (HEADER, "seq")])
        for name, (constants, fields) in types_of(schema, definition, "ros1").items()
    }
    return registered(schema, types)


CARRIED = frozenset({"cdr", "ros1", "protobuf", "json", "flatbuffer", "cbor", "msgpack"})
"""The message encodings that MCAP names. Others, as those of KITTI drives, are files and no messages."""

_MOST_BEFORE = 100  # messages of a topic: one camera info suffices, a tree of transforms may take several


@dataclass(frozen=True)
class Clip:
    """What was written: how many messages of the seconds themselves, and how many calibrations from before them."""

    messages: int
    before: int


def write_clip(recording: Recording, target: Path, from_ns: int, to_ns: int) -> Clip:
    """Write all messages that were recorded from one log time to another, both included, in the order of the file.

    Of topics of calibrations and transforms that say nothing in these seconds the last messages before them come
    first, at their own times: so the clip can be audited by itself. Raises RecordingError where nothing was recorded
    then, or the recording has messages that MCAP does not carry.
    """
    foreign = sorted({topic.encoding for topic in recording.topics()} - CARRIED)
    if foreign:
        raise RecordingError(
            f"it has data that MCAP does not carry as they are ({', '.join(foreign)})",
            where=recording.path,
            remedy="auditor convert writes them as messages",
        )
    before = _calibrations_before(recording, from_ns, to_ns)
    written = 0
    with mcap_file(target, profile=_profile(recording), compression="zstd") as file:
        for message in chain(before, _within(recording, from_ns, to_ns)):
            topic = Topic(message.topic, _schema_name(message), message.encoding)
            file.write(topic, recording.definition(message.schema), message.log_time_ns, message.data)
            written += 1
        file.add_metadata({**recording.metadata(), "clock": recording.clock, "source": recording.recording_id})
        if written == len(before):
            raise RecordingError("no message was recorded in the seconds of the clip", where=recording.path)
    return Clip(written - len(before), len(before))


def _within(recording: Recording, from_ns: int, to_ns: int) -> Iterator[Message]:
    return (message for message in recording.messages() if from_ns <= message.log_time_ns <= to_ns)


def _calibrations_before(recording: Recording, from_ns: int, to_ns: int) -> list[Message]:
    """The last messages before, in the order of their times, of topics of calibrations silent between two times."""
    decoders = Decoders(recording.definition)
    kinds: dict[str, str] = {
        topic.name: decoder.kind
        for topic in recording.topics()
        if (decoder := decoders.of(topic.schema, topic.encoding)) and decoder.kind in ("camera_info", "transforms")
    }
    kinds |= dict.fromkeys(metadata_topics(recording.topics()), "metadata")
    last_messages: dict[str, deque[Message]] = {
        topic: deque(maxlen=_MOST_BEFORE if kind == "transforms" else 1) for topic, kind in kinds.items()
    }
    for message in recording.messages(kinds.keys()):
        if message.topic not in last_messages:
            continue
        if from_ns <= message.log_time_ns <= to_ns:
            del last_messages[message.topic]
        elif message.log_time_ns < from_ns:
            last_messages[message.topic].append(_kept(message))
    return sorted((message for some in last_messages.values() for message in some), key=lambda one: one.log_time_ns)


def _kept(message: Message) -> Message:
    """The message with bytes of its own: a reader may use its buffer again."""
    return Message(message.topic, message.schema, message.encoding, message.log_time_ns, bytes(message.data))


def _schema_name(message: Message) -> str:
    """As MCAP files of its encoding have it: ROS 1 does not say that a type is a message."""
    return message.schema.replace("/msg/", "/") if message.encoding == "ros1" else message.schema


def _profile(recording: Recording) -> str:
    encodings = {topic.encoding for topic in recording.topics()}
    return {frozenset({"cdr"}): "ros2", frozenset({"ros1"}): "ros1"}.get(frozenset(encodings), "")
