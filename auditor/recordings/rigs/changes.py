"""Changes of calibrations within a recording, each with its time, and the stretches of time between them.

Camera infos, transforms and the size of pictures may change.
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from statistics import median
from typing import NamedTuple

from auditor.errors import DecodingError
from auditor.model.frames import Message
from auditor.recordings.decoding import CameraInfo, Decoders, ImageDecoder, Transform
from auditor.recordings.decoding.interface import SizePx
from auditor.recordings.parameters import CALIBRATION_CHANGES, FIRST_LOOK
from auditor.recordings.recording import Recording
from auditor.recordings.rigs.calibrations import same_camera_info, same_place
from auditor.recordings.synchronisation.survey import Survey
from auditor.recordings.synchronisation.vehicles import info_of, transform_of
from auditor.safety.budget import MAX_TRANSFORM_BYTES

_STAMP_END = 12
"""A ROS message begins with 4 bytes and the stamp: what follows is the same in each message of one calibration."""
_MOST_MESSAGES = 500  # messages that change a calibration: it bounds the work

_PLAIN_NAMES = frozenset({"cdr", "ros1", "protobuf"})
"""Encodings that write a name as its bytes in UTF-8; JSON may write it otherwise."""


class Key(NamedTuple):
    """What may change: the camera info or the picture size of a topic, or the transform between two frames."""

    kind: str
    name: str
    child: str = ""

    def __str__(self) -> str:
        return {
            "info": self.name,
            "size": f"the picture size of {self.name}",
            "transform": f"tf from {self.name} to {self.child}",
        }[self.kind]


Value = CameraInfo | SizePx | Transform


class Change(NamedTuple):
    """A new value, and since when it holds."""

    time_ns: int
    key: Key
    value: Value


class Changes:
    """The changes of a recording, found in its messages as they are taken one by one, at most `most_messages` of them.

    `topics` are those whose messages are to be taken. `until_ns` is when the first change comes that is too many; None
    where there is none.
    """

    def __init__(self, recording: Recording, survey: Survey, keys: frozenset[Key]) -> None:
        self._keys = keys
        self._links = [(key.name.encode(), key.child.encode()) for key in keys if key.kind == "transform"]
        self._decoders = Decoders(recording.definition)
        self._spaces = survey.spaces
        self._delay_ns = _delay_ns(survey)
        self._values: dict[Key, Value] = {Key("info", t): info for t, info in survey.camera_infos.items()}
        self._values |= {Key("transform", one.parent, one.child): one for one in survey.transforms}
        self._values |= {Key("size", image.topic.name): image.size_px for image in survey.images}
        self._tails: dict[str, bytes] = {}
        self._begun: set[str] = set()
        self._new_sizes: dict[Key, list[Change]] = {}
        self._found: list[Change] = []
        self.until_ns: int | None = None
        self.topics = {key.name for key in self._keys if key.kind != "transform"}
        if any(key.kind == "transform" for key in self._keys):
            self.topics |= {t.name for t in recording.topics() if self._kind(t.schema, t.encoding) == "transforms"}

    @property
    def found(self) -> list[Change]:
        """The changes so far, in order of time."""
        return sorted(self._found, key=lambda change: change.time_ns)

    @property
    def any(self) -> bool:
        """Whether there was a change so far."""
        return bool(self._found)

    def read(self, recording: Recording) -> None:
        """Take the messages of a whole recording, up to the first change that is too many."""
        for message in recording.messages(self.topics):
            self.take(message)
            if self.until_ns is not None:
                return

    def take(self, message: Message) -> None:
        """Take one message, in the order of the recording."""
        with suppress(DecodingError):
            for change in self._changes(message):
                if len(self._found) == _MOST_MESSAGES:
                    self.until_ns = change.time_ns
                    return
                self._values[change.key] = change.value
                self._found.append(change)

    def _kind(self, schema: str, encoding: str) -> str:
        decoder = self._decoders.of(schema, encoding)
        return decoder.kind if decoder is not None else ""

    def _changes(self, message: Message) -> Iterator[Change]:
        decoder = self._decoders.of(message.schema, message.encoding)
        if decoder is None:
            return
        if decoder.kind == "transforms":
            if not self._may_have_links(message):
                return
            for link in decoder.transforms(message):
                transform = transform_of(link, message.topic, self._spaces)
                key = Key("transform", transform.parent, transform.child)
                if not transform.problem and self._differs(key, transform):
                    yield Change(message.log_time_ns - self._delay_ns, key, transform)
        elif decoder.kind == "camera_info" and self._is_new(message):
            info = info_of(decoder.camera_info(message), message.topic, self._spaces)
            key = Key("info", message.topic)
            if not info.is_blank:
                self._begun.add(message.topic)
            if message.topic in self._begun and self._differs(key, info):
                yield Change(self._time_ns(message, info.header.stamp_ns), key, info)
        elif decoder.kind == "image":
            yield from self._of_size(message, decoder)

    def _may_have_links(self, message: Message) -> bool:
        """False where a message cannot hold a transform that a rig needs: to search names is faster than to decode."""
        if len(message.data) > MAX_TRANSFORM_BYTES:
            return False
        if message.encoding not in _PLAIN_NAMES or self._spaces:
            return True
        data = bytes(message.data)
        return any(parent in data and child in data for parent, child in self._links)

    def _differs(self, key: Key, value: CameraInfo | Transform) -> bool:
        """True where a rig needs it, and it is not what was in force."""
        before = self._values.get(key)
        if key not in self._keys or before is None:
            return False
        if isinstance(before, CameraInfo) and isinstance(value, CameraInfo):
            return not same_camera_info(before, value)
        return not (
            isinstance(before, Transform)
            and isinstance(value, Transform)
            and same_place(before.parent_SE3_child, value.parent_SE3_child)
        )

    def _is_new(self, message: Message) -> bool:
        """True unless the bytes are those of the message before, but for the stamp."""
        if message.encoding not in {"cdr", "ros1"}:
            return True
        tail = bytes(message.data[_STAMP_END:])
        before, self._tails[message.topic] = self._tails.get(message.topic), tail
        return tail != before

    def _of_size(self, message: Message, decoder: ImageDecoder) -> Iterator[Change]:
        """A change of size, once enough pictures in a row show it: a damaged one alone does not."""
        key = Key("size", message.topic)
        size_px = decoder.size_px(message)
        if size_px == self._values.get(key):
            self._new_sizes.pop(key, None)
            return
        change = Change(self._time_ns(message, decoder.header(message).stamp_ns), key, size_px)
        waiting = self._new_sizes.setdefault(key, [])
        if waiting and waiting[0].value != size_px:
            waiting.clear()
        waiting.append(change)
        if len(waiting) == CALIBRATION_CHANGES.pictures_a_size:
            yield self._new_sizes.pop(key)[0]

    def _time_ns(self, message: Message, stamp_ns: int) -> int:
        """The stamp of a message, or what its log time says where the stamp lies far from that."""
        usual_ns = message.log_time_ns - self._delay_ns
        return stamp_ns if stamp_ns > 0 and abs(stamp_ns - usual_ns) <= FIRST_LOOK.most_lag_ns else usual_ns


def _delay_ns(survey: Survey) -> int:
    """The usual time from a stamp to its log time."""
    samples = [one for image in survey.images for one in image.samples if one.stamp_ns > 0]
    return int(median(one.log_time_ns - one.stamp_ns for one in samples)) if samples else 0


@dataclass(frozen=True)
class Stretch:
    """The time from `from_ns` to before `until_ns`; None is the recording's beginning or end.

    With a `reason` its frames cannot be audited, and are skipped.
    """

    from_ns: int | None = None
    until_ns: int | None = None
    reason: str = ""

    def holds(self, time_ns: int) -> bool:
        """True for a time in the stretch."""
        begun = self.from_ns is None or time_ns >= self.from_ns
        return begun and (self.until_ns is None or time_ns < self.until_ns)


WHOLE = (Stretch(),)
"""All of a recording."""


def stretch_at(stretches: Sequence[Stretch], time_ns: int) -> int | None:
    """The place of the stretch that a time lies in; None where another rig is in force."""
    return next((place for place, stretch in enumerate(stretches) if stretch.holds(time_ns)), None)
