"""One read of a recording for several streams of frames, as those of a ring's cameras are, and for whoever listens."""

from collections import deque
from collections.abc import Collection, Generator, Iterable, Iterator, Sequence
from itertools import chain
from typing import Protocol, TypeVar

from auditor.model.frames import Message
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
