"""Clips: some seconds of a recording as an MCAP file, its messages as they were recorded, to the last bit."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from auditor.errors import RecordingError
from auditor.model.frames import Message
from auditor.recordings.decoding import Decoders
from auditor.recordings.recording import Recording, Topic
from auditor.recordings.synchronisation.metadata import metadata_topics
from auditor.recordings.writers.mcap_file import mcap_file

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
    known: dict[str, deque[Message]] = {
        topic: deque(maxlen=_MOST_BEFORE if kind == "transforms" else 1) for topic, kind in kinds.items()
    }
    for message in recording.messages(kinds.keys()):
        if message.topic not in known:
            continue
        if from_ns <= message.log_time_ns <= to_ns:
            del known[message.topic]
        elif message.log_time_ns < from_ns:
            known[message.topic].append(_kept(message))
    return sorted((message for some in known.values() for message in some), key=lambda one: one.log_time_ns)


def _kept(message: Message) -> Message:
    """The message with bytes of its own: a reader may use its buffer again."""
    return Message(message.topic, message.schema, message.encoding, message.log_time_ns, bytes(message.data))


def _schema_name(message: Message) -> str:
    """As MCAP files of its encoding have it: ROS 1 does not say that a type is a message."""
    return message.schema.replace("/msg/", "/") if message.encoding == "ros1" else message.schema


def _profile(recording: Recording) -> str:
    encodings = {topic.encoding for topic in recording.topics()}
    return {frozenset({"cdr"}): "ros2", frozenset({"ros1"}): "ros1"}.get(frozenset(encodings), "")
