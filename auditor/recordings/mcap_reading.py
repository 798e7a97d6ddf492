"""Messages, topics, definitions and attachments of one MCAP file, read forward."""

import struct
import zlib
from collections.abc import Collection, Iterator
from io import BytesIO
from pathlib import Path

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.records import Attachment, Channel, Metadata, Schema

from auditor.frames import Message
from auditor.recordings.damage_log import DamageLog
from auditor.recordings.interface import Definition, Topic
from auditor.recordings.mcap_chunks import BadChunkError, unpack_chunk
from auditor.recordings.mcap_stream import (
    HEAD,
    CutError,
    ForwardStream,
    Opcode,
    Record,
    read_body,
    read_ending,
    records,
)
from auditor.recordings.schemas import schema_name

_MESSAGE_HEAD = struct.Struct("<HIQQ")
_MAX_LOG_TIME_NS = 2**63 - 1


class _Channel:
    """One channel of one file during one read."""

    __slots__ = ("count", "topic", "wanted")

    def __init__(self, topic: Topic, *, wanted: bool) -> None:
        self.topic = topic
        self.wanted = wanted
        self.count = 0


class Names:
    """Topics and schema definitions, gathered from summaries and from reading."""

    def __init__(self) -> None:
        self.topics: dict[str, Topic] = {}
        self.definitions: dict[str, Definition] = {}


class FileRead:
    """One forward read of one file: yields messages, counts all of them, notes damage."""

    def __init__(self, path: Path, wanted: Collection[str] | None, names: Names, damage: DamageLog) -> None:
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
        """The channels met so far, with their counts."""
        return self._channels.values()

    def messages(self) -> Iterator[Message]:
        """Every message of the topics wanted, in file order."""
        with self._path.open("rb", buffering=1 << 18) as file:
            size = self._path.stat().st_size
            ending = read_ending(file, size)
            file.seek(0)
            if ending:
                # Channels are told in the chunk that first needs them: where that one is damaged, the summary helps.
                spare = FileRead(self._path, self._wanted, self._names, DamageLog())
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
            except OSError as error:
                self._damage.add(f"it cannot be read further ({error.strerror or error})", stream.offset)
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


def attached_to(path: Path) -> Iterator[Attachment | Metadata]:
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
