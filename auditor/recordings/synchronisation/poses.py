"""The poses nearest to the frames of a recording, for a place of what happens in them.

They are placed behind the read of the sensors: nothing of them can change a frame. Their messages are kept from that
read where they are few, and come of a read of their own where they are many. What is kept of a topic's poses is no more
than one before and one behind each frame, so memory is bounded by frames and topics, and both are bounded.
"""

from bisect import bisect_left
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import isnan
from operator import itemgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auditor.model.frames import FramePose, Message, Pose, PoseTopic
from auditor.recordings.decoding.poses import PoseDecoder, PoseError, pose_rank
from auditor.recordings.decoding.ros import RosTypes
from auditor.recordings.recording import Recording, Topic

FAR = "far from every frame"
MANY_TOPICS = "too many topics"
MANY_FRAMES = "too many frames of reference"
_MOST_TRACKS = 8  # topics and frames of reference a recording: it bounds the work
_MOST_PLACES = 1_000_000  # frames times topics, 28 hours of one at 10 Hz: it bounds the memory
_MOST_APART_NS = 10 * 10**9  # from a frame to a pose of it: beyond, the vehicle may be anywhere


_MOST_KEPT_BYTES, _MESSAGE_BYTES = 32 * 2**20, 512
"""Of messages that are kept, and what each takes beside its data."""

_GEOGRAPHIC = ("latitude_deg", "longitude_deg", "altitude_m", "heading_deg")
_LOCAL = ("x_m", "y_m", "z_m", "heading_deg")


class FrameTimes(NamedTuple):
    """The numbers and stamps of frames, as they were measured."""

    numbers: Sequence[int]
    stamps_ns: Sequence[int]


@dataclass(frozen=True)
class FramePoses:
    """The poses of a recording's frames, and what became of the messages of each topic of poses."""

    topics: tuple[PoseTopic, ...] = ()
    tracks: tuple["_Track", ...] = field(default=(), repr=False)

    def __iter__(self) -> Iterator[FramePose]:
        """The poses, topic by topic in the order of their names."""
        for track in self.tracks:
            yield from track.poses()


class PoseMessages:
    """Keeps the messages of a recording's topics of poses as somebody else's read passes them, while they are few."""

    def __init__(self, recording: Recording) -> None:
        self.topics = frozenset(topic.name for topic in _topics_of(recording)[:_MOST_TRACKS])
        self._kept: list[Message] = []
        self._left_bytes = _MOST_KEPT_BYTES

    def take(self, message: Message) -> None:
        """Take one message, in the order of the recording."""
        self._left_bytes -= len(message.data) + _MESSAGE_BYTES
        if self._left_bytes >= 0:
            self._kept.append(message)
        else:
            self._kept.clear()

    def of(self, topics: Collection[str]) -> Iterable[Message] | None:
        """The messages of some topics, once the whole recording has passed; None where they were not all kept."""
        if self._left_bytes < 0 or not self.topics.issuperset(topics):
            return None
        return (message for message in self._kept if message.topic in topics)


def read_poses(recording: Recording, frames: FrameTimes, passed: PoseMessages | None = None) -> FramePoses:
    """The poses of some frames; a recording that has topics of them is read through unless they have `passed`.

    Raises what its reader does.
    """
    wanted = _topics_of(recording)
    if not wanted or not frames.numbers:
        return FramePoses()
    reading = _Reading(recording, frames, wanted)
    kept = passed.of(reading.topics) if passed is not None else None
    for message in recording.messages(reading.topics) if kept is None else kept:
        reading.take(message)
    return reading.result()


def _topics_of(recording: Recording) -> list[Topic]:
    """The topics of poses, those that go first before the others."""
    ranked = [(rank, topic) for topic in recording.topics() if (rank := pose_rank(topic)) is not None]
    return [topic for _, topic in sorted(ranked, key=itemgetter(0))]  # those of one rank stay by name


class _Reading:
    def __init__(self, recording: Recording, frames: FrameTimes, topics: Sequence[Topic]) -> None:
        self._recording = recording
        order = np.argsort(np.asarray(frames.stamps_ns, dtype=np.int64), kind="stable")[:_MOST_PLACES]
        self._numbers = [int(frames.numbers[place]) for place in order]
        self._stamps_ns = [int(frames.stamps_ns[place]) for place in order]
        self._most_tracks = min(_MOST_TRACKS, max(1, _MOST_PLACES // len(order)))
        self._decoder = PoseDecoder(RosTypes(recording.definition))
        self._tracks: dict[tuple[str, str], _Track] = {}
        self._found = topics
        self.topics = frozenset(topic.name for topic in topics[: self._most_tracks])
        self._read: Counter[str] = Counter()
        self._dropped: dict[str, Counter[str]] = {topic.name: Counter() for topic in topics}

    def take(self, message: Message) -> None:
        self._read[message.topic] += 1
        try:
            for stamped in self._decoder.poses(message):
                self._place(message, stamped.stamp_ns or message.log_time_ns, stamped.pose)
        except PoseError as error:
            self._dropped[message.topic][error.what] += 1

    def _place(self, message: Message, stamp_ns: int, pose: Pose) -> None:
        place = bisect_left(self._stamps_ns, stamp_ns)
        near = self._stamps_ns[max(place - 1, 0) : place + 1]
        if min(abs(stamp_ns - frame_ns) for frame_ns in near) > _MOST_APART_NS:
            self._dropped[message.topic][FAR] += 1
            return
        track = self._tracks.get((message.topic, pose.frame_id))
        if track is None:
            if len(self._tracks) == self._most_tracks:
                self._dropped[message.topic][MANY_FRAMES] += 1
                return
            topic = Topic(message.topic, message.schema, message.encoding)
            track = _Track(topic, pose, self._numbers, self._stamps_ns)
            self._tracks[message.topic, pose.frame_id] = track
        track.take(place, stamp_ns, pose)

    def result(self) -> FramePoses:
        tracks = tuple(track for _, track in sorted(self._tracks.items()))
        frames: Counter[str] = Counter()
        for track in tracks:
            frames[track.topic.name] = max(frames[track.topic.name], len(track.frames))
        return FramePoses(tuple(self._account(topic, frames[topic.name]) for topic in self._found), tracks)

    def _account(self, topic: Topic, frames: int) -> PoseTopic:
        read = self._read[topic.name]
        if topic.name not in self.topics:
            read = self._recording.counts.get(topic.name, 0)
            self._dropped[topic.name][MANY_TOPICS] = read
        return PoseTopic(topic.name, topic.schema, read, frames, dict(sorted(self._dropped[topic.name].items())))


class _Nearest(NamedTuple):
    """By frame: whether its nearest pose lies before (0) or behind (1) it, where that is kept, and how far it is."""

    side: NDArray[np.intp]
    place: NDArray[np.intp]
    offset_ns: NDArray[np.int64]


class _Track:
    """The poses of one topic in one frame of reference: by frame the last before it and the first behind it.

    A pose is kept at the frame before it and at the frame behind it, where no other pose lies between.
    """

    def __init__(self, topic: Topic, first: Pose, numbers: Sequence[int], stamps_ns: Sequence[int]) -> None:
        self.topic = topic
        self._frame_id = first.frame_id
        self._columns = _LOCAL if first.latitude_deg is None else _GEOGRAPHIC
        self._numbers, self._stamps_ns = numbers, stamps_ns
        frames = len(stamps_ns)
        self._nearest_ns = np.zeros((2, frames), np.int64)
        self._there = np.zeros((2, frames), np.bool_)
        self._values: NDArray[np.float64] = np.full((2, frames, len(self._columns)), np.nan)

    def take(self, place: int, stamp_ns: int, pose: Pose) -> None:
        """A pose that lies before the frame at this place, and behind the one before that."""
        if place < len(self._stamps_ns):
            self._keep(0, place, stamp_ns, pose, later=True)
        if place > 0:
            self._keep(1, place - 1, stamp_ns, pose, later=False)

    def _keep(self, side: int, place: int, stamp_ns: int, pose: Pose, *, later: bool) -> None:
        known_ns = self._nearest_ns[side, place]
        if not self._there[side, place] or (stamp_ns > known_ns if later else stamp_ns < known_ns):
            self._there[side, place], self._nearest_ns[side, place] = True, stamp_ns
            values = [getattr(pose, name) for name in self._columns]
            self._values[side, place] = [np.nan if value is None else value for value in values]

    @cached_property
    def _nearest(self) -> _Nearest:
        """The nearest pose of each frame, once all were taken."""
        frames = np.arange(len(self._stamps_ns))
        before = np.maximum.accumulate(np.where(self._there[0], frames, -1))
        behind = np.minimum.accumulate(np.where(self._there[1], frames, len(frames))[::-1])[::-1]
        sides = [self._offsets_ns(0, before), self._offsets_ns(1, behind)]
        side = (np.abs(sides[1]) < np.abs(sides[0])).astype(np.intp)
        place = np.where(side == 1, behind, before).clip(0, len(frames) - 1)
        return _Nearest(side, place, np.where(side == 1, sides[1], sides[0]))

    def _offsets_ns(self, side: int, places: NDArray[np.intp]) -> NDArray[np.int64]:
        """How far behind its frame the pose of each place lies; as far as can be where the place is none."""
        none = (places < 0) | (places == len(places))
        stamps_ns = np.asarray(self._stamps_ns, dtype=np.int64)
        offsets_ns = self._nearest_ns[side, np.where(none, 0, places)] - stamps_ns
        return np.where(none, np.iinfo(np.int64).max, offsets_ns)

    @cached_property
    def frames(self) -> NDArray[np.intp]:
        """The places of the frames that have a pose."""
        return np.flatnonzero(np.abs(self._nearest.offset_ns) <= _MOST_APART_NS)

    def poses(self) -> Iterator[FramePose]:
        """The poses of the frames that have one, by stamp."""
        for frame in self.frames:
            values = self._values[self._nearest.side[frame], self._nearest.place[frame]].tolist()
            coordinates = {name: value for name, value in zip(self._columns, values, strict=True) if not isnan(value)}
            yield FramePose(
                frame=self._numbers[frame],
                stamp_ns=self._stamps_ns[frame],
                offset_ns=int(self._nearest.offset_ns[frame]),
                topic=self.topic.name,
                schema=self.topic.schema,
                pose=Pose(self._frame_id, **coordinates),
            )
