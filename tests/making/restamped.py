"""The messages of an MCAP file with other stamps, log times or bytes, as other recorders and attackers write them."""

import struct
from collections.abc import Callable, Iterable
from itertools import count
from pathlib import Path
from typing import NamedTuple

from auditor.recordings import Topic, open_recording
from auditor.recordings.recording import Definition
from auditor.recordings.writers.mcap_file import McapFile

SECOND_NS = 10**9


class Told(NamedTuple):
    """One message of a sensor: its number among those of its topic, its stamp, log time and bytes (ROS 2)."""

    topic: str
    number: int
    stamp_ns: int
    log_time_ns: int
    data: bytes


class Extra(NamedTuple):
    """A topic that is added: `messages` are (log time, bytes)."""

    topic: Topic
    messages: tuple[tuple[int, bytes], ...]
    definition: Definition | None = None


def rewritten(
    source: Path, target: Path, change: Callable[[Told], Iterable[Told]], extra: Iterable[Extra] = ()
) -> Path:
    """A copy in which each message of images and points is replaced by those that `change` gives for it."""
    numbers: dict[str, count[int]] = {}
    with open_recording(source) as recording, target.open("wb") as out:
        file = McapFile(out, "ros2", "none")
        topics = {topic.name: topic for topic in recording.topics()}
        for one in extra:
            for log_time_ns, data in one.messages:
                file.write(one.topic, one.definition, log_time_ns, data)
        for message in recording.messages():
            definition = recording.definition(message.schema)
            written = [(message.log_time_ns, bytes(message.data))]
            if message.schema in {"sensor_msgs/msg/Image", "sensor_msgs/msg/PointCloud2"}:
                number = next(numbers.setdefault(message.topic, count()))
                seconds, nanoseconds = struct.unpack_from("<iI", message.data, 4)
                stamp_ns = seconds * SECOND_NS + nanoseconds
                told = Told(message.topic, number, stamp_ns, message.log_time_ns, bytes(message.data))
                written = [(other.log_time_ns, _stamped(other)) for other in change(told)]
            for log_time_ns, data in written:
                file.write(topics[message.topic], definition, log_time_ns, data)
        file.finish()
    return target


def _stamped(told: Told) -> bytes:
    seconds, nanoseconds = divmod(told.stamp_ns, SECOND_NS)
    return told.data[:4] + struct.pack("<iI", seconds, nanoseconds) + told.data[12:]
