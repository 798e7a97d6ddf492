"""ROS 1 .bag files, and ROS 2 recordings (.db3 files and rosbag2 folders), through rosbags' readers."""

import json
import struct
from collections.abc import Collection, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Any, Self, cast

import apsw
from rosbags.interfaces import Connection, MessageDefinitionFormat
from rosbags.rosbag1 import Reader as BagReader
from rosbags.rosbag1 import ReaderError as BagError
from rosbags.rosbag2 import Reader as Rosbag2Reader
from rosbags.rosbag2 import ReaderError as Rosbag2Error

from auditor.errors import RecordingError
from auditor.frames import Message
from auditor.recordings.content import content_id
from auditor.recordings.damage_log import DamageLog
from auditor.recordings.interface import CLOCKS, EARLIEST_UTC_NS, Clock, Damage, Definition, Recording, Topic
from auditor.recordings.labels import METADATA_TOPIC, label_from_dict
from auditor.recordings.mcap import McapRecording
from auditor.recordings.schemas import STRING, schema_name
from auditor.results import AttackLabel

ROSBAGS_ERRORS = (
    BagError,
    Rosbag2Error,
    apsw.Error,
    AssertionError,
    AttributeError,
    EOFError,
    LookupError,
    MemoryError,
    OSError,
    RuntimeError,
    TypeError,
    ValueError,
    struct.error,
)
"""What rosbags' readers let through from damaged files: their checks are partly asserts, and sizes are believed."""

_MAX_METADATA_BYTES = 64 * 2**20


class Ros1Reader:
    """Recognises .bag files."""

    def detects(self, path: Path) -> bool:
        """True for a file that is named so."""
        return path.suffix.lower() == ".bag" and path.is_file()

    def open(self, path: Path) -> "RosbagRecording":
        """Open it. Raises RecordingError."""
        return RosbagRecording(path, (path,), (BagReader(path),), encoding="ros1")


class Ros2Reader:
    """Recognises .db3 files and rosbag2 folders."""

    def detects(self, path: Path) -> bool:
        """True for a .db3 file, and for a folder with metadata.yaml or .db3 files."""
        if path.is_dir():
            return bool(_storage_files(path)) and ((path / "metadata.yaml").is_file() or bool(_files(path, ".db3")))
        return path.suffix.lower() == ".db3" and path.is_file()

    def open(self, path: Path) -> Recording:
        """Open it; the order of a folder's files is that of their names. Raises RecordingError."""
        files = _storage_files(path) if path.is_dir() else (path,)
        if files[0].suffix.lower() == ".mcap":
            return McapRecording(path, files)
        for file in files:
            if file.stat().st_size == 0:
                raise RecordingError("the file is empty", where=file, remedy="record or copy it again")
        # The files are opened one by one: metadata.yaml may be missing, or tell of files that are gone.
        return RosbagRecording(path, files, tuple(Rosbag2Reader(file) for file in files), encoding="cdr")


def _files(folder: Path, suffix: str) -> tuple[Path, ...]:
    # "_10" comes after "_9": recorders number the files of a folder without leading zeros.
    found = (file for file in folder.iterdir() if file.suffix.lower() == suffix and file.is_file())
    return tuple(sorted(found, key=lambda file: (len(file.name), file.name)))


def _storage_files(folder: Path) -> tuple[Path, ...]:
    return _files(folder, ".db3") or _files(folder, ".mcap")


class RosbagRecording:
    """The files of one ROS recording, read one after the other. See interface.Recording."""

    def __init__(
        self,
        path: Path,
        files: tuple[Path, ...],
        readers: tuple[BagReader | Rosbag2Reader, ...],
        *,
        encoding: str,
    ) -> None:
        self.path = path
        self.files = files
        self._encoding = encoding
        self._readers: list[BagReader | Rosbag2Reader] = []
        self._damage = DamageLog()
        self._counts: dict[str, int] = {}
        for reader, file in zip(readers, files, strict=True):
            self._open(reader, file)
        if not self._readers:
            self.close()
            first = self._damage.entries[0]
            raise RecordingError(first.what, where=path, remedy="repair it with its recorder's own tools")
        self._opening_damage = self._damage.entries

    def _open(self, reader: BagReader | Rosbag2Reader, file: Path) -> None:
        try:
            reader.open()
        except ROSBAGS_ERRORS as error:
            self._damage.add(f"it cannot be read ({_one_line(error)})", file=file.name)
        else:
            self._readers.append(reader)
            if not all(isinstance(name, str) for c in reader.connections for name in (c.topic, c.msgtype)):
                self._readers.pop().close()
                self._damage.add("it cannot be read (its list of topics is damaged)", file=file.name)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the files."""
        while self._readers:
            self._readers.pop().close()

    @cached_property
    def recording_id(self) -> str:
        """sha256 (hex) of the content."""
        return content_id(self.path, self.files)

    @cached_property
    def clock(self) -> Clock:
        """What the recording says of its own clock, else a guess from its first log time."""
        said = self.metadata().get("clock")
        if said in CLOCKS:
            return cast("Clock", said)
        starts = [reader.start_time for reader in self._readers if reader.message_count]
        if not starts:
            return "unknown"
        return "utc" if min(starts) >= EARLIEST_UTC_NS else "relative"

    @property
    def counts(self) -> Mapping[str, int]:
        """Messages met by the last read, by topic; those not asked for as the index counts them."""
        return self._counts

    @property
    def damage(self) -> tuple[Damage, ...]:
        """What could not be read at opening and by the last read."""
        return self._damage.entries

    def topics(self) -> tuple[Topic, ...]:
        """All topics of the index."""
        topics = {
            connection.topic: Topic(connection.topic, schema_name(connection.msgtype), self._encoding)
            for connection in self._connections()
        }
        return tuple(topic for _, topic in sorted(topics.items()))

    def definition(self, schema: str) -> Definition | None:
        """The first definition found under that name."""
        for connection in self._connections():
            if schema_name(connection.msgtype) == schema and connection.msgdef.format != MessageDefinitionFormat.NONE:
                ros2 = "ros2idl" if connection.msgdef.format == MessageDefinitionFormat.IDL else "ros2msg"
                return Definition("ros1msg" if self._encoding == "ros1" else ros2, connection.msgdef.data.encode())
        return None

    def _connections(self) -> Iterator[Connection]:
        for reader in self._readers:
            yield from reader.connections

    def messages(self, topics: Collection[str] | None = None) -> Iterator[Message]:
        """Every message in the order of the index, which is that of log times."""
        self._damage = DamageLog()
        for damage in self._opening_damage:
            self._damage.add(damage.what, damage.offset, file=damage.file)
        self._counts = {topic.name: 0 for topic in self.topics()}
        return self._read(topics, self._counts, self._damage)

    def _read(self, topics: Collection[str] | None, counts: dict[str, int], damage: DamageLog) -> Iterator[Message]:
        for reader in self._readers:
            wanted = []
            for connection in reader.connections:
                if topics is None or connection.topic in topics:
                    wanted.append(connection)
                else:
                    counts[connection.topic] += connection.msgcount
            if wanted:
                names = {connection.topic for connection in wanted}
                for message in self._read_file(reader, wanted, damage):
                    counts[message.topic] = counts.get(message.topic, 0) + 1
                    if message.topic in names:  # a damaged index can lead to others
                        yield message

    def _read_file(
        self, reader: BagReader | Rosbag2Reader, wanted: list[Connection], damage: DamageLog
    ) -> Iterator[Message]:
        stream = reader.messages(wanted)
        while True:
            try:
                connection, log_time_ns, data = next(stream)
            except StopIteration:
                return
            except ROSBAGS_ERRORS as error:
                damage.add(f"it cannot be read further ({_one_line(error)})", file=Path(str(reader.path)).name)
                return
            yield Message(connection.topic, schema_name(connection.msgtype), self._encoding, log_time_ns, data)

    def labels(self) -> tuple[AttackLabel, ...]:
        """Ground truth from the topic /auditor/metadata. Raises RecordingError where it is ill-formed."""
        try:
            return tuple(label_from_dict(entry) for entry in self._said.get("labels", ()))
        except (KeyError, TypeError, ValueError) as error:
            raise RecordingError(f"its ground truth is ill-formed ({error})", where=self.path) from error

    def metadata(self) -> Mapping[str, str]:
        """What the topic /auditor/metadata says."""
        said = self._said.get("metadata", {})
        return {str(name): str(value) for name, value in said.items()} if isinstance(said, dict) else {}

    @cached_property
    def _said(self) -> dict[str, Any]:
        said: dict[str, Any] = {}
        counts = {METADATA_TOPIC: 0} | {topic.name: 0 for topic in self.topics()}
        if METADATA_TOPIC not in {topic.name for topic in self.topics() if topic.schema == STRING}:
            return said
        for message in self._read([METADATA_TOPIC], counts, DamageLog()):
            # A std_msgs/String: its length, then its text; CDR has 4 bytes before it and a zero at its end.
            start = 4 if self._encoding == "ros1" else 8
            if len(message.data) <= _MAX_METADATA_BYTES:
                try:
                    part = json.loads(bytes(message.data[start:]).rstrip(b"\0"))
                except (ValueError, RecursionError) as error:
                    raise RecordingError(f"its {METADATA_TOPIC} is ill-formed ({error})", where=self.path) from error
                said.update(part if isinstance(part, dict) else {})
        return said


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
