"""MCAP recordings, read forward within bounds: chunked or not, whole or cut, with an index or without."""

import struct
import zlib
from collections.abc import Collection, Iterator, Mapping
from functools import cached_property
from io import BytesIO
from pathlib import Path
from types import TracebackType
from typing import Self, cast

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.records import Attachment, Channel, Metadata, Schema

from auditor.errors import RecordingError
from auditor.frames import Message
from auditor.recordings.content import content_id
from auditor.recordings.damage_log import DamageLog
from auditor.recordings.interface import CLOCKS, EARLIEST_UTC_NS, Clock, Damage, Definition, Topic
from auditor.recordings.labels import LABELS_NAME, METADATA_NAME, labels_from_json
from auditor.recordings.mcap_chunks import BadChunkError, unpack_chunk
from auditor.recordings.mcap_stream import (
    HEAD,
    MAGIC,
    CutError,
    ForwardStream,
    Opcode,
    Record,
    read_body,
    read_ending,
    records,
)
from auditor.recordings.schemas import schema_name
from auditor.results import AttackLabel

_MESSAGE_HEAD = struct.Struct("<HIQQ")
_PEEK_BYTES = 32 * 2**20
_MAX_LOG_TIME_NS = 2**63 - 1


class McapReader:
    """Recognises .mcap files."""

    def detects(self, path: Path) -> bool:
        """True for a file that is named so."""
        return path.suffix.lower() == ".mcap" and path.is_file()

    def open(self, path: Path) -> "McapRecording":
        """Open it. Raises RecordingError where it does not begin as an MCAP file does."""
        return McapRecording(path, (path,))


class _Channel:
    """One channel of one file during one read."""

    __slots__ = ("count", "topic", "wanted")

    def __init__(self, topic: Topic, *, wanted: bool) -> None:
        self.topic = topic
        self.wanted = wanted
        self.count = 0


class _Names:
    """Topics and schema definitions, gathered from summaries and from reading."""

    def __init__(self) -> None:
        self.topics: dict[str, Topic] = {}
        self.definitions: dict[str, Definition] = {}


class _FileRead:
    """One forward read of one file: yields messages, counts all of them, notes damage."""

    def __init__(self, path: Path, wanted: Collection[str] | None, names: _Names, damage: DamageLog) -> None:
        self._path = path
        self._wanted = None if wanted is None else frozenset(wanted)
        self._names = names
        self._damage = damage
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, _Channel] = {}
        self._spare_channels: dict[int, _Channel] = {}
        self._without_channel: dict[int, int] = {}

    @property
    def channels(self) -> Collection[_Channel]:
        return self._channels.values()

    def messages(self) -> Iterator[Message]:
        with self._path.open("rb", buffering=1 << 18) as file:
            size = self._path.stat().st_size
            ending = read_ending(file, size)
            file.seek(0)
            if ending:
                # Channels are told in the chunk that first needs them: where that one is damaged, the summary helps.
                spare = _FileRead(self._path, self._wanted, self._names, DamageLog())
                spare.learn_summary(ending.summary)
                self._spare_channels = spare._channels  # of its own class
            stream = ForwardStream(file, size, checksum=bool(ending and ending.data_crc))
            crc = 0
            try:
                for record in records(stream, self._damage):
                    if record.opcode == Opcode.DATA_END:
                        if ending and ending.data_crc and crc != ending.data_crc:
                            self._damage.add("the checksum over all its data is wrong", record.offset)
                        break
                    yield from self._record(stream, record)
                    stream.skip_to(record.offset + HEAD.size + record.length)
                    crc = stream.crc
            except CutError:
                self._damage.add("the file became shorter while it was read", stream.offset)
            if ending is None and not self._damage.entries:
                self._damage.add("its end is damaged (footer or summary)", stream.offset)
        for channel_id, count in self._without_channel.items():
            self._damage.add(f"{count} messages belong to no channel ({channel_id})")

    def _record(self, stream: ForwardStream, record: Record) -> Iterator[Message]:
        if record.opcode == Opcode.CHUNK:
            body = read_body(stream, record, self._damage)
            if body is not None:
                yield from self._chunk(body, record.offset)
        elif record.opcode == Opcode.MESSAGE:
            yield from self._message(stream, record)
        elif record.opcode in {Opcode.SCHEMA, Opcode.CHANNEL}:
            body = read_body(stream, record, self._damage)
            if body is not None:
                self.learn(record.opcode, body, record.offset)

    def _message(self, stream: ForwardStream, record: Record) -> Iterator[Message]:
        if record.length < _MESSAGE_HEAD.size:
            self._damage.add("a message is too short", record.offset)
            return
        head = stream.read(_MESSAGE_HEAD.size)
        channel = self._channel_of(head, 0)
        if channel is None or not channel.wanted:
            return
        body = read_body(stream, record._replace(length=record.length - len(head)), self._damage)
        if body is not None:
            yield self._made(channel, head, 0, body, record.offset)

    def _chunk(self, body: bytes, offset: int) -> Iterator[Message]:
        try:
            inside = unpack_chunk(body)
        except BadChunkError as error:
            self._damage.add(f"a chunk is left out: {error}", offset)
            return
        position, end = 0, len(inside)
        while position + HEAD.size <= end:
            opcode, length = HEAD.unpack_from(inside, position)
            start = position + HEAD.size
            position = start + length
            if position > end or opcode == 0:
                break
            if opcode == Opcode.MESSAGE and length >= _MESSAGE_HEAD.size:
                channel = self._channel_of(inside, start)
                if channel is not None and channel.wanted:
                    data = bytes(inside[start + _MESSAGE_HEAD.size : position])
                    yield self._made(channel, inside, start, data, offset)
            elif opcode in {Opcode.SCHEMA, Opcode.CHANNEL}:
                self.learn(opcode, inside[start:position], offset)
        if position != end:
            self._damage.add("a chunk ends inside a record", offset)

    def _channel_of(self, head: bytes | memoryview, start: int) -> _Channel | None:
        channel_id = head[start] | head[start + 1] << 8
        channel = self._channels.get(channel_id)
        if channel is None and (channel := self._spare_channels.get(channel_id)) is not None:
            self._channels[channel_id] = channel
        if channel is None:
            self._without_channel[channel_id] = self._without_channel.get(channel_id, 0) + 1
            return None
        channel.count += 1
        return channel

    def _made(self, channel: _Channel, head: bytes | memoryview, start: int, data: bytes, offset: int) -> Message:
        log_time_ns = _MESSAGE_HEAD.unpack_from(head, start)[2]
        if log_time_ns > _MAX_LOG_TIME_NS:
            self._damage.add(f"a log time of {log_time_ns} ns cannot be: taken as 0", offset)
            log_time_ns = 0
        topic = channel.topic
        return Message(topic.name, topic.schema, topic.encoding, log_time_ns, data)

    def learn_summary(self, summary: bytes) -> None:
        """Take in the schemas and channels of a summary section."""
        position = 0
        while position + HEAD.size <= len(summary):
            opcode, length = HEAD.unpack_from(summary, position)
            start = position + HEAD.size
            position = start + length
            if opcode in {Opcode.SCHEMA, Opcode.CHANNEL} and position <= len(summary):
                self.learn(opcode, summary[start:position], position)

    def learn(self, opcode: int, body: bytes | memoryview, offset: int) -> None:
        """Take in a schema or channel record."""
        stream = ReadDataStream(BytesIO(body))
        try:
            if opcode == Opcode.SCHEMA:
                self._learn_schema(Schema.read(stream), offset)
            else:
                self._learn_channel(Channel.read(stream))
        except (EndOfFile, struct.error, UnicodeDecodeError) as error:
            self._damage.add(f"a schema or channel record is damaged ({error or 'cut'})", offset)

    def _learn_schema(self, schema: Schema, offset: int) -> None:
        name = schema_name(schema.name)
        self._schemas[schema.id] = name
        definition = Definition(schema.encoding, schema.data)
        if self._names.definitions.setdefault(name, definition) != definition:
            self._damage.add(f"a second, different definition of {name!r} is ignored", offset)

    def _learn_channel(self, channel: Channel) -> None:
        if channel.id in self._channels:
            return
        topic = Topic(channel.topic, self._schemas.get(channel.schema_id, ""), channel.message_encoding)
        self._names.topics.setdefault(topic.name, topic)
        self._channels[channel.id] = _Channel(topic, wanted=self._wanted is None or topic.name in self._wanted)


class McapRecording:
    """One MCAP file, or the files of a rosbag2 folder in their order. See interface.Recording."""

    def __init__(self, path: Path, files: tuple[Path, ...]) -> None:
        self.path = path
        self.files = files
        self._names = _Names()
        self._damage = DamageLog()
        self._reads: list[_FileRead] = []
        for file in files:
            with file.open("rb") as stream:
                if stream.read(len(MAGIC)) != MAGIC:
                    raise RecordingError("this is no MCAP file, or one cut at its very start", where=file)
        self._look()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Nothing stays open between reads."""

    @cached_property
    def recording_id(self) -> str:
        """sha256 (hex) of the content."""
        return content_id(self.path, self.files)

    @cached_property
    def clock(self) -> Clock:
        """What the file says of its own clock, else a guess from its first log time."""
        said = self.metadata().get("clock")
        if said in CLOCKS:
            return cast("Clock", said)
        first = next(self._read(None, DamageLog())[1], None)
        if first is None:
            return "unknown"
        return "utc" if first.log_time_ns >= EARLIEST_UTC_NS else "relative"

    @property
    def counts(self) -> Mapping[str, int]:
        """Messages met by the last read, by topic."""
        counts = dict.fromkeys(self._names.topics, 0)
        for read in self._reads:
            for channel in read.channels:
                counts[channel.topic.name] += channel.count
        return counts

    @property
    def damage(self) -> tuple[Damage, ...]:
        """What the last read could not read."""
        return self._damage.entries

    def topics(self) -> tuple[Topic, ...]:
        """Those of the summaries, those at the beginning, and those met while reading."""
        return tuple(topic for _, topic in sorted(self._names.topics.items()))

    def definition(self, schema: str) -> Definition | None:
        """The first definition met under that name."""
        return self._names.definitions.get(schema)

    def messages(self, topics: Collection[str] | None = None) -> Iterator[Message]:
        """Every message in file order, CRCs checked, at most one chunk in memory."""
        self._damage = DamageLog()
        self._reads, stream = self._read(topics, self._damage)
        return stream

    def _read(self, topics: Collection[str] | None, damage: DamageLog) -> tuple[list[_FileRead], Iterator[Message]]:
        reads = [_FileRead(file, topics, self._names, damage) for file in self.files]
        return reads, (message for read in reads for message in read.messages())

    def _look(self) -> None:
        """Learn topics: from the summaries where there are any, else from the beginning."""
        for file in self.files:
            with file.open("rb") as stream:
                ending = read_ending(stream, file.stat().st_size)
            if ending:
                _FileRead(file, None, self._names, DamageLog()).learn_summary(ending.summary)
        if not self._names.topics:
            seen = 0
            for message in self._read(None, DamageLog())[1]:
                seen += len(message.data) + _MESSAGE_HEAD.size
                if seen > _PEEK_BYTES:
                    break

    def labels(self) -> tuple[AttackLabel, ...]:
        """Ground truth from the attachments named auditor-labels.json. Raises RecordingError where ill-formed."""
        return self._extras[0]

    def metadata(self) -> Mapping[str, str]:
        """The metadata record named 'auditor'."""
        return self._extras[1]

    @cached_property
    def _extras(self) -> tuple[tuple[AttackLabel, ...], Mapping[str, str]]:
        labels: list[AttackLabel] = []
        metadata: dict[str, str] = {}
        for file in self.files:
            for attached in _attached(file):
                if isinstance(attached, Metadata):
                    metadata.update(attached.metadata if attached.name == METADATA_NAME else {})
                elif attached.name == LABELS_NAME:
                    labels.extend(labels_from_json(attached.data, file))
        return tuple(labels), metadata


def _attached(path: Path) -> Iterator[Attachment | Metadata]:
    """Attachments and metadata records of a file, passing over everything else unread."""
    damage = DamageLog()
    with path.open("rb", buffering=1 << 16) as file:
        stream = ForwardStream(file, path.stat().st_size, checksum=False)
        for record in records(stream, damage):
            if record.opcode in {Opcode.ATTACHMENT, Opcode.METADATA}:
                body = read_body(stream, record, damage)
                attached = _parse_attached(record.opcode, body) if body is not None else None
                if attached is not None:
                    yield attached


def _parse_attached(opcode: int, body: bytes) -> Attachment | Metadata | None:
    stream = ReadDataStream(BytesIO(body))
    try:
        attached: Attachment | Metadata = (Metadata if opcode == Opcode.METADATA else Attachment).read(stream)
    except (EndOfFile, struct.error, UnicodeDecodeError):
        return None
    crc = int.from_bytes(body[-4:], "little") if isinstance(attached, Attachment) else 0
    return attached if crc in {0, zlib.crc32(body[:-4])} else None
