"""One read of a recording for several streams of frames, as those of a ring's cameras are, and for whoever listens.

What streams show of their sensors' health are the use of messages, the time they cover, and clock offsets.
"""

from collections import Counter, deque
from collections.abc import Collection, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Protocol, TypeVar

from auditor.model.coverage import TopicCoverage
from auditor.model.frames import Frame, Message, SensorState, SkippedFrame, TopicBalance
from auditor.model.rig import Rig
from auditor.recordings.recording import Recording
from auditor.recordings.synchronisation.frames import FrameStream
from auditor.recordings.synchronisation.window import MESSAGE_BYTES, MOST_WAITING_BYTES

Item = TypeVar("Item")


class FarAheadError(Exception):
    """A stream is so far ahead of another that too many messages wait: each needs a read of its own."""


class Listener(Protocol):
    """Takes the messages of its `topics` in a read that is made for frames."""

    @property
    def topics(self) -> Collection[str]:
        """The topics that it takes."""

    def take(self, message: Message) -> None:
        """Take one message, in the order of the recording."""


def share_a_read(recording: Recording, streams: Sequence[FrameStream], listeners: Iterable[Listener] = ()) -> None:
    """Let the next iteration of each of these streams, the only one there is, take its messages from one read.

    The streams have to be iterated in turn: messages wait for those that are behind. Listeners hear all of their topics
    before the last stream ends. The topics must be interleaved: else each has a read of its own. An iteration raises
    FarAheadError where more than MOST_WAITING_BYTES wait.
    """
    _SharedRead(recording, streams, [one for one in listeners if one.topics])


def in_turn(streams: Sequence[Iterable[Item]]) -> Iterator[tuple[int, Item]]:
    """The items of several streams, one of each in turn, with the places of their streams."""
    left = {place: iter(stream) for place, stream in enumerate(streams)}
    while left:
        for place, items in list(left.items()):
            try:
                item = next(items)
            except StopIteration:
                del left[place]
                continue
            yield place, item


class _SharedRead:
    def __init__(self, recording: Recording, streams: Sequence[FrameStream], listeners: Sequence[Listener]) -> None:
        self._recording = recording
        self._listeners = [(frozenset(one.topics), one) for one in listeners]
        self._waiting: list[tuple[frozenset[str], deque[Message]]] = []
        self._waiting_bytes = 0
        self._damaged = False
        for stream in streams:
            mine = deque[Message]()
            self._waiting.append((stream.topics, mine))
            stream.take_from(self._messages(stream.topics, mine))
        self._topics = frozenset(chain(*(topics for topics, _ in (*self._waiting, *self._listeners))))
        self._read = self._passed()

    def _messages(self, topics: frozenset[str], mine: deque[Message]) -> Generator[Message]:
        """The messages of one stream."""
        while mine or next(self._read, None) is not None:
            while mine:
                message = mine.popleft()
                self._waiting_bytes -= _size(message)
                yield message
        if self._damaged and topics != self._topics:
            # Some of it may be of messages that are another's: what is damaged of the stream's own is read again.
            deque(self._recording.messages(topics), maxlen=0)

    def _passed(self) -> Iterator[bool]:
        """Hand the messages of the recording on, one for each step."""
        for message in self._recording.messages(self._topics):
            for topics, listener in self._listeners:
                if message.topic in topics:
                    listener.take(message)
            for topics, waiting in self._waiting:
                if message.topic in topics:
                    waiting.append(message)
                    self._waiting_bytes += _size(message)
            if len(self._waiting) > 1 and self._waiting_bytes > MOST_WAITING_BYTES:
                raise FarAheadError
            yield True
        self._damaged = bool(self._recording.damage)


def _size(message: Message) -> int:
    return len(message.data) + MESSAGE_BYTES


@dataclass(frozen=True)
class SensorHealth:
    """One sensor: the use of its messages, its offset to the leftmost camera, and its first and last frame's stamps."""

    balance: TopicBalance
    offset_ns: int
    present: int = 0
    first_ns: int | None = None
    last_ns: int | None = None


@dataclass(frozen=True)
class Health:
    """All frames of a recording, with one rig; `skipped` counts moments without a frame by reason.

    `coverage` is of each topic of camera pictures or LiDAR points, those outside the rig included; `undecoded` says
    which messages did not decode.
    """

    frames: int
    skipped: Mapping[str, int]
    clock_jumps: int
    period_ns: int
    first_ns: int | None
    sensors: Mapping[int, SensorHealth]
    coverage: tuple[TopicCoverage, ...] = ()
    undecoded: tuple[str, ...] = ()


def check_health(streams: Sequence[tuple[FrameStream, Rig]]) -> list[Health]:
    """Synchronise and decode all frames of some streams in turn, and return the health of each one's sensors."""
    checks = [_Check(rig) for _, rig in streams]
    for place, item in in_turn([stream for stream, _ in streams]):
        checks[place].take(item)
    return [check.health(stream) for check, (stream, _) in zip(checks, streams, strict=True)]


class _Check:
    """What the frames of one stream show of its sensors."""

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self._frames = 0
        self._skipped: Counter[str] = Counter()
        self._seen: dict[int, list[int]] = {sensor: [] for sensor in rig.sensors}
        self._present: Counter[int] = Counter()

    def take(self, item: Frame | SkippedFrame) -> None:
        if isinstance(item, SkippedFrame):
            self._skipped[item.reason] += 1
            return
        self._frames += 1
        for sensor, presence in item.presence.items():
            if presence.state is SensorState.PRESENT:
                self._present[sensor] += 1
                stamps_ns = [*self._seen[sensor], item.stamp_ns]
                self._seen[sensor] = [min(stamps_ns), max(stamps_ns)]

    def health(self, stream: FrameStream) -> Health:
        balance = {topic.sensor: topic for topic in stream.balance if topic.sensor is not None}
        return Health(
            frames=self._frames,
            skipped=dict(sorted(self._skipped.items())),
            clock_jumps=stream.clock_jumps,
            period_ns=stream.timing.period_ns,
            first_ns=min((first for first, _ in filter(None, self._seen.values())), default=None),
            sensors={
                sensor: SensorHealth(
                    balance.get(sensor, TopicBalance(self._rig.topic(sensor), "", sensor)),
                    stream.timing.offset_ns[sensor],
                    self._present[sensor],
                    *self._seen[sensor],
                )
                for sensor in self._rig.sensors
            },
            coverage=stream.coverage,
            undecoded=stream.undecoded,
        )
