"""A survey of a recording's beginning: its sensors, and enough stamps to learn their offsets and periods."""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from auditor.errors import DecodingError
from auditor.model.arrays import Points
from auditor.model.frames import Message
from auditor.recordings import schemas
from auditor.recordings.decoding import (
    CameraInfo,
    CloudDecoder,
    Decoders,
    DeepImageDecoder,
    ImageDecoder,
    PartDecoder,
    Transform,
    decoder_table,
    sensor_types,
)
from auditor.recordings.decoding.interface import CameraInfoDecoder, SizePx
from auditor.recordings.decoding.pictures import depth_of
from auditor.recordings.decoding.robot_descriptions import describes_robot, fixed_joints
from auditor.recordings.decoding.sensor_types import SensorKind
from auditor.recordings.formats.part_names import other_parts
from auditor.recordings.parameters import FIRST_LOOK, PICTURE_DEPTH, POINT_UNITS, SWEEPS
from auditor.recordings.recording import Recording, Topic
from auditor.recordings.rigs.calibrations import STANDARD, Conventions
from auditor.recordings.synchronisation.descriptions import Mountings, completed_by_texts, metadata_of
from auditor.recordings.synchronisation.first_messages import FileOrder, first_points, first_size_px, thinned
from auditor.recordings.synchronisation.sectors import Sector, in_parts, sector_of, show_whole_sweeps
from auditor.recordings.synchronisation.vehicles import frame_of, have_tf_each, info_of, sharing_frames, transform_of

_MOST_BYTES = 512 * 2**20  # sensor data that a first look reads: it bounds the work
_MOST_MESSAGES = 20_000  # messages that a first look reads: it bounds the work


class Sample(NamedTuple):
    """When one message was captured, by its stamp (0: it has none), and when it was recorded."""

    stamp_ns: int
    log_time_ns: int

    @property
    def time_ns(self) -> int:
        """Its stamp, or its log time where it has none."""
        return self.stamp_ns or self.log_time_ns


@dataclass(frozen=True)
class ImageTopic:
    """A topic of images; `size_px` is what its first readable image has.

    `depth_bits` are those of its values where they have more than 8, as far as its first pictures show.
    """

    topic: Topic
    frame_id: str
    size_px: SizePx
    samples: tuple[Sample, ...]
    depth_bits: int | None = None


@dataclass(frozen=True)
class CloudTopic:
    """A topic of point clouds; `points` is how many finite ones its first readable cloud has that is not all but empty.

    Where clouds are parts of sweeps, `sectors` are those of the `samples`; else there are none. `some_m` (N, 3) are
    some points of its first clouds, in metres; None where they were not looked at. Clouds recorded before `starts_ns`
    are all but empty: those of a LiDAR that has not started.
    """

    topic: Topic
    frame_id: str
    points: int
    samples: tuple[Sample, ...]
    sectors: tuple[Sector | None, ...] = ()
    some_m: Points | None = field(default=None, compare=False, repr=False)
    starts_ns: int = 0


@dataclass(frozen=True)
class UnreadableTopic:
    """A topic of camera pictures or LiDAR points of which no message could be read, why, and what to do about it."""

    topic: Topic
    kind: SensorKind
    reason: str
    remedy: str


@dataclass(frozen=True, eq=False)
class Survey:
    """The content of a recording's beginning.

    `camera_infos` goes by topic; `problems` are sentences for people. `interleaved` is False where the topics lie one
    after the other in the file, so that sensors cannot be paired in one read. `unreadable` holds topics that may have
    no message at all: whether they have, the recording's counts say after a whole read. `other_parts` are files beside
    those of the recording that are named as parts of the same drive. `conventions` are how its calibrations are read.
    `moving` are the frames, as parent and child, that move against each other. `metadata` are by topic the texts that
    describe the sensors of packets. `blank_infos` counts by topic the camera infos of zeros before the first other one.
    `spaces` are namespaces with frames of their own: see vehicles. `lost` are the problems that leave no message, and
    `transform_problems` those of transforms.
    """

    topics: tuple[Topic, ...]
    images: tuple[ImageTopic, ...]
    clouds: tuple[CloudTopic, ...]
    camera_infos: dict[str, CameraInfo]
    transforms: tuple[Transform, ...]
    problems: tuple[str, ...]
    interleaved: bool
    other_parts: tuple[Path, ...] = ()
    unreadable: tuple[UnreadableTopic, ...] = ()
    conventions: Conventions = STANDARD
    moving: frozenset[tuple[str, str]] = frozenset()
    metadata: Mapping[str, str] = field(default_factory=dict)
    blank_infos: Mapping[str, int] = field(default_factory=dict)
    spaces: frozenset[str] = frozenset()
    lost: tuple[str, ...] = ()
    transform_problems: tuple[str, ...] = ()

    @property
    def frames(self) -> list[tuple[str, str]]:
        """The topics of sensors, each with its coordinate frame."""
        sensors: tuple[ImageTopic | CloudTopic, ...] = (*self.images, *self.clouds)
        return [(one.topic.name, one.frame_id) for one in sensors]

    def samples(self, topic: str) -> tuple[Sample, ...]:
        """The sample stamps of a sensor's topic, in the order recorded."""
        sensors: tuple[ImageTopic | CloudTopic, ...] = (*self.images, *self.clouds)
        return next((sensor.samples for sensor in sensors if sensor.topic.name == topic), ())

    def sectors(self, topic: str) -> tuple[Sector | None, ...]:
        """The sectors of a LiDAR's clouds that are parts of sweeps, as its samples."""
        return next((cloud.sectors for cloud in self.clouds if cloud.topic.name == topic), ())


def survey(recording: Recording, units_m: Mapping[str, float] | None = None) -> Survey:
    """Survey the beginning; the recording can be read from its start afterwards. `units_m`: see Decoders.

    It ends as soon as every sensor topic known has given enough stamps and a calibration was seen, at the latest after
    _MOST_BYTES of sensor data. A message that cannot be decoded is a problem, not an error.
    """
    first_look = _Surveyor(recording, units_m).run()
    spaces = sharing_frames(first_look.frames)
    apart = spaces and have_tf_each(spaces, first_look.topics)
    return _Surveyor(recording, units_m, spaces).run() if apart else first_look


class _Surveyor:
    def __init__(self, recording: Recording, units_m: Mapping[str, float] | None, spaces: Collection[str] = ()) -> None:
        self._recording = recording
        self._spaces = spaces
        self._metadata = metadata_of(recording)
        self._decoders = Decoders(recording.definition, units_m, self._metadata)
        self._samples: dict[str, list[Sample]] = {}
        self._frame_turns: dict[str, list[str]] = {}
        self._sensors: dict[str, tuple[Topic, str, SizePx | int]] = {}
        self._sectors_seen: dict[str, list[Sector | None]] = {}
        self._some_m: dict[str, list[Points]] = {}
        self._points: dict[str, list[tuple[int, int]]] = {}
        self._infos: dict[str, CameraInfo] = {}
        self._blank_infos = Counter[str]()
        self._mountings = Mountings(spaces)
        self._described: dict[str, tuple[Transform, ...]] = {}
        self._problems: dict[str, None] = {}
        self._reasons: dict[str, str] = {}
        self._bytes = 0
        self._messages = 0
        self._order = FileOrder()
        self._largest: dict[str, int] = {}
        self._topics: Sequence[Topic] = ()
        self._names: dict[tuple[str, ...], tuple[str, ...]] = {}

    def run(self) -> Survey:
        topics = set(self._by_kind("image", "cloud", "camera_info", "transforms")) | self._descriptions()
        for message in self._recording.messages(topics) if topics or not self._recording.topics() else ():
            self._take(message)
            if self._enough():
                break
        lost = () if self._messages else [f"no message is left in it: {damage}" for damage in self._recording.damage]
        shared = self._shared()
        sensors = [sensor for name, sensor in sorted(self._sensors.items()) if name not in shared]
        images = [(t, f, size) for t, f, size in sensors if isinstance(size, tuple)]
        pictures = [
            ImageTopic(t, f, size, tuple(self._samples[t.name]), self._depth_bits(t.name, size))
            for t, f, size in images
        ]
        places = (*self._mountings.all(), *self._beyond_tf())
        infos, transforms, notes = completed_by_texts(self._recording, pictures, self._infos, places)
        for problem in (*lost, *notes):
            self._note(problem)
        unseen = self._note_unseen()
        self._note_undecodable()
        of_transforms = self._by_kind("transforms")
        return Survey(
            topics=self._recording.topics(),
            images=tuple(pictures),
            clouds=tuple(self._cloud(t, f, points) for t, f, points in sensors if isinstance(points, int)),
            camera_infos=dict(sorted(infos.items())),
            transforms=transforms,
            problems=tuple(self._problems),
            interleaved=self._order.interleaved and (len(self._samples) > 1 or not unseen),
            other_parts=other_parts(self._recording.files),
            unreadable=tuple(self._unreadable(shared)),
            moving=self._mountings.moving(),
            metadata=self._metadata,
            blank_infos=self._blank_infos,
            spaces=frozenset(self._spaces),
            lost=tuple(lost),
            transform_problems=tuple(one for one in self._problems if one.partition(": ")[0] in of_transforms),
        )

    def _by_kind(self, *kinds: str) -> tuple[str, ...]:
        """The topics of these kinds; they are asked for with every message, and found again only where topics came."""
        topics = self._recording.topics()
        if topics is not self._topics:
            self._topics, self._names = topics, {}
        if kinds not in self._names:
            self._names[kinds] = tuple(self._names_of(topics, kinds))
        return self._names[kinds]

    def _names_of(self, topics: Sequence[Topic], kinds: Sequence[str]) -> Iterator[str]:
        for topic in topics:
            decoder = self._decoders.of(topic.schema, topic.encoding)
            if decoder is not None and decoder.kind in kinds:
                yield topic.name

    def _descriptions(self) -> set[str]:
        return {topic.name for topic in self._recording.topics() if describes_robot(topic)}

    def _beyond_tf(self) -> Iterator[Transform]:
        """The places that a robot's description has of frames that tf does not place: what tf says goes before it."""
        placed = {transform.child for transform in self._mountings.all()}
        for topic, joints in sorted(self._described.items()):
            new_joints = [joint for joint in joints if joint.child not in placed]
            placed.update(joint.child for joint in new_joints)
            if new_joints:
                self._note(f"{topic}: the places of {len(new_joints)} frames are those of the robot's description")
            yield from new_joints

    def _enough(self) -> bool:
        if self._bytes > _MOST_BYTES:
            return True
        sensors = self._by_kind("image", "cloud")
        if not sensors or any(len(self._samples.get(topic, ())) < FIRST_LOOK.samples for topic in sensors):
            return self._long_enough()
        if not all(map(show_whole_sweeps, self._sectors_seen.values())):
            return self._long_enough()
        fixed = any(name.endswith("tf_static") for name in self._by_kind("transforms"))
        placed = bool(self._mountings or not fixed) and self._described.keys() == self._descriptions()
        complete = len(self._infos) == len(self._by_kind("camera_info")) and placed
        return complete or self._long_enough()

    def _long_enough(self) -> bool:
        return self._messages >= _MOST_MESSAGES

    def _take(self, message: Message) -> None:
        self._messages += 1
        decoder = self._decoders.of(message.schema, message.encoding)
        if decoder is None:
            self._take_description(message)
            return
        try:
            if decoder.kind == "transforms":
                for problem in self._mountings.take(message, decoder):
                    self._note(f"{message.topic}: {problem}")
            elif decoder.kind == "camera_info":
                self._take_info(message, decoder)
            else:
                self._take_sensor(message, decoder)
        except DecodingError as error:
            self._reasons.setdefault(message.topic, error.what)
            self._note(f"{message.topic}: {error.what}")

    def _take_info(self, message: Message, decoder: CameraInfoDecoder) -> None:
        """Take the first camera info of a topic that says something; where none does, a blank one."""
        before = self._infos.get(message.topic)
        if before is None or before.is_blank:
            info = info_of(decoder.camera_info(message), message.topic, self._spaces)
            self._infos[message.topic] = info
            self._blank_infos[message.topic] += info.is_blank

    def _take_description(self, message: Message) -> None:
        if message.schema == schemas.STRING and message.topic not in self._described:  # a name may have two types
            self._described[message.topic] = ()
            try:
                joints = fixed_joints(message, self._decoders.types)
                self._described[message.topic] = tuple(transform_of(j, message.topic, self._spaces) for j in joints)
            except DecodingError as error:
                self._note(f"{message.topic}: {error.what}")

    def _take_sensor(self, message: Message, decoder: ImageDecoder | CloudDecoder) -> None:
        self._bytes += len(message.data)
        header = decoder.header(message)
        frame_id = frame_of(header.frame_id, message.topic, self._spaces)
        if header.stamp_ns == 0 != message.log_time_ns:
            self._note(f"{message.topic}: stamps are 0; the time of recording is used instead")
        sample = Sample(header.stamp_ns, message.log_time_ns)
        self._samples.setdefault(message.topic, []).append(sample)
        if back_ns := self._order.jump_ns(message.topic, sample.time_ns, sample.log_time_ns):
            self._note(f"{message.topic}: the clock jumps back by {back_ns / 1e9:.1f} s")
        if message.topic not in self._sensors:
            size = first_size_px(message, decoder) if decoder.kind == "image" else first_points(message, decoder)
            topic = Topic(message.topic, message.schema, message.encoding)
            self._sensors[message.topic] = (topic, frame_id, size)
        turns = self._frame_turns.setdefault(message.topic, [])
        if frame_id and turns[-1:] != [frame_id]:
            turns.append(frame_id)
        if frame_id != self._sensors[message.topic][1]:
            self._note(f"{message.topic}: its messages are of several coordinate frames; the place of the first counts")
        if decoder.kind == "cloud":
            self._take_sector(message, decoder)
        if decoder.kind == "image" and len(self._samples[message.topic]) <= PICTURE_DEPTH.pictures:
            self._take_depth(message, decoder)

    def _take_sector(self, message: Message, decoder: CloudDecoder) -> None:
        """Note where a cloud looks, as long as the topic's clouds may be parts of sweeps."""
        sectors = self._sectors_seen.setdefault(message.topic, [])
        if len(sectors) < SWEEPS.looked_at or in_parts(sectors[: SWEEPS.looked_at]) or not any(sectors):
            xyz_m = decoder.xyz_m(message)
            sectors.append(sector_of(decoder.looks(message) if isinstance(decoder, PartDecoder) else xyz_m))
            self._points.setdefault(message.topic, []).append((message.log_time_ns, len(xyz_m)))
            some = self._some_m.setdefault(message.topic, [])
            if len(some) < SWEEPS.looked_at:
                some.append(thinned(xyz_m, len(some)))

    def _cloud(self, topic: Topic, frame_id: str, points: int) -> CloudTopic:
        samples, sectors = tuple(self._samples[topic.name]), self._sectors_of(topic.name)
        seen = self._points.get(topic.name, [])
        first = next((place for place, (_, count) in enumerate(seen) if count >= POINT_UNITS.fewest_points), 0)
        starts_ns, points = (seen[first][0], seen[first][1]) if first else (0, points)
        return CloudTopic(topic, frame_id, points, samples, sectors, self._some_of(topic.name), starts_ns)

    def _sectors_of(self, topic: str) -> tuple[Sector | None, ...]:
        sectors = self._sectors_seen.get(topic, [])
        return tuple(sectors) if len(sectors) == len(self._samples[topic]) and in_parts(sectors) else ()

    def _some_of(self, topic: str) -> Points | None:
        some = self._some_m.get(topic)
        return np.concatenate(some) if some else None

    def _take_depth(self, message: Message, decoder: ImageDecoder) -> None:
        largest = decoder.largest_value(message) if isinstance(decoder, DeepImageDecoder) else None
        if largest is not None:
            self._largest[message.topic] = max(largest, self._largest.get(message.topic, 0))

    def _depth_bits(self, topic: str, size_px: SizePx) -> int | None:
        """The depth of a topic of 16-bit values: that of all whose pictures have this size, for they are compared."""
        if topic not in self._largest:
            return None
        alike = (value for name, value in self._largest.items() if self._sensors[name][-1] == size_px)
        return depth_of(max(alike))

    def _note(self, problem: str) -> None:
        if len(self._problems) < 100:
            self._problems[problem] = None

    def _note_undecodable(self) -> None:
        for topic in self._recording.topics():
            if topic.schema in decoder_table() and self._decoders.of(topic.schema, topic.encoding) is None:
                self._note(f"{topic.name}: {topic.schema} in the encoding {topic.encoding!r} cannot be decoded")

    def _note_unseen(self) -> int:
        unseen = [name for name in self._by_kind("image", "cloud") if name not in self._samples]
        for name in unseen:
            self._note(f"{name}: no message of it could be read at the beginning")
        return len(unseen)

    def _shared(self) -> dict[str, str]:
        """The topics that several sensors share, whose frames take turns, and in words which frames."""
        takes_turns = {name: turns for name, turns in self._frame_turns.items() if len({*turns}) < len(turns)}
        return {name: " and ".join(dict.fromkeys(turns)) for name, turns in takes_turns.items()}

    def _unreadable(self, shared: Mapping[str, str]) -> Iterator[UnreadableTopic]:
        for topic in self._recording.topics():
            if topic.name in shared:
                kind = sensor_types.KINDS["image" if isinstance(self._sensors[topic.name][-1], tuple) else "cloud"]
                reason = f"the messages of several sensors take turns in it, in the frames {shared[topic.name]}"
                yield UnreadableTopic(topic, kind, reason, "record each on a topic of its own")
            if topic.name in self._sensors:
                continue
            decoder = self._decoders.of(topic.schema, topic.encoding)
            declared = decoder or self._decoders.in_any_encoding(topic.schema)
            if declared is not None and declared.kind in sensor_types.KINDS:
                kind, remedy = sensor_types.KINDS[declared.kind], sensor_types.remedy_of(topic.schema)
                reason = self._reasons.get(topic.name, "no message of it lies at the beginning, where rigs are found")
                if decoder is None:
                    reason = f"{topic.schema} in the encoding {topic.encoding!r} cannot be decoded"
                    remedy = f"convert its messages to {' or '.join(sorted(decoder_table()[topic.schema][0]))}"
                yield UnreadableTopic(topic, kind, reason, remedy)
            elif declared is None and topic.schema in sensor_types.UNREAD:
                kind, remedy = sensor_types.UNREAD[topic.schema]
                yield UnreadableTopic(topic, kind, f"{topic.schema} cannot be decoded", remedy)
