"""Drives in several files, as recorders split them: what is latched lies in the first part only."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from mcap.writer import CompressionType, Writer
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Rosbag2Writer

from auditor.model.frames import Frame, Message
from auditor.model.rig import Rig
from auditor.recordings import open_recording, schemas
from auditor.recordings.recording import METADATA_TOPIC
from auditor.recordings.writers.messages import MessageMaker
from tests.making.small_drives import WRITERS

CALIBRATION = frozenset({schemas.CAMERA_INFO, schemas.TRANSFORMS})
SUFFIXES = (".mcap", ".bag", ".db3")


def messages_of(suffix: str, rig: Rig, frames: Iterable[Frame]) -> list[Message]:
    """The messages that a recorder of that kind writes, with each calibration once, at the beginning."""
    with TemporaryDirectory() as folder:
        whole = Path(folder) / (f"whole{suffix}" if suffix != ".db3" else "whole")
        WRITERS[suffix](whole, rig, frames)
        with open_recording(whole) as recording:
            messages = [message for message in recording.messages() if message.topic != METADATA_TOPIC]
    first = {message.topic: message for message in reversed(messages)}
    return [message for message in messages if message.schema not in CALIBRATION or message is first[message.topic]]


def write_messages(path: Path, messages: Sequence[Message], *, indexed: bool = True) -> Path:
    """A file of the kind that its name ends with."""
    path.parent.mkdir(parents=True, exist_ok=True)
    maker = MessageMaker("ros1" if path.suffix == ".bag" else "cdr")
    if path.suffix == ".mcap":
        _write_mcap(path, messages, maker, indexed=indexed)
    elif path.suffix == ".bag":
        with BagWriter(path) as writer:
            _write_ros(writer, messages, maker)
    else:
        with TemporaryDirectory() as folder:
            with Rosbag2Writer(Path(folder) / "a", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
                _write_ros(writer, messages, maker)
            path.write_bytes((Path(folder) / "a" / "a.db3").read_bytes())
    return path


def write_parts(
    folder: Path, suffix: str, messages: Sequence[Message], starts_ns: Sequence[int], name: str = "drive"
) -> list[Path]:
    """`drive_0`, `drive_1` and so on: a new one begins at each of the times."""
    edges = [0, *starts_ns, 2**63]
    return [
        write_messages(
            folder / f"{name}_{number}{suffix}",
            [message for message in messages if edges[number] <= message.log_time_ns < edges[number + 1]],
        )
        for number in range(len(edges) - 1)
    ]


def some(messages: Iterable[Message], choose: Callable[[Message], bool]) -> list[Message]:
    """The messages that are chosen."""
    return [message for message in messages if choose(message)]


def _write_mcap(path: Path, messages: Sequence[Message], maker: MessageMaker, *, indexed: bool) -> None:
    with path.open("wb") as out:
        writer = Writer(out, chunk_size=20_000, compression=CompressionType.ZSTD, use_statistics=indexed)
        writer.start("ros2")
        channels: dict[str, int] = {}
        for message in messages:
            if message.topic not in channels:
                definition = maker.definition(message.schema).encode()
                schema = writer.register_schema(message.schema, "ros2msg", definition)
                channels[message.topic] = writer.register_channel(message.topic, "cdr", schema)
            writer.add_message(channels[message.topic], message.log_time_ns, bytes(message.data), message.log_time_ns)
        writer.finish()


def _write_ros(writer: BagWriter | Rosbag2Writer, messages: Sequence[Message], maker: MessageMaker) -> None:
    connections = {}
    for message in messages:
        if message.topic not in connections:
            connections[message.topic] = writer.add_connection(message.topic, message.schema, typestore=maker.store)
        writer.write(connections[message.topic], message.log_time_ns, bytes(message.data))
