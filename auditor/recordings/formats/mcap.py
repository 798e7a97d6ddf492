"""MCAP recordings: one file or several, chunked or not, whole or cut, with an index or without."""

import struct
import zlib
from collections.abc import Collection, Generator, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from io import BytesIO
from pathlib import Path

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.records import Attachment, Metadata, Schema

from auditor.model.frames import Message
from auditor.model.verdict import AttackLabel
from auditor.recordings.formats.files import CutError, FileRead, FilesRecording, ForwardStream, Streams
from auditor.recordings.formats.found import Channel, DamageLog, Names, Span, is_trusted
from auditor.recordings.formats.mcap_records import (
    HEAD,
    MAGIC,
    Opcode,
    Record,
    read_body,
    read_ending,
    records,
    span_of_records,
    span_of_summary,
    summary_records,
    unpack_chunk,
    unpack_cut_chunk,
)
from auditor.recordings.formats.unpacking import BadChunkError, Source, unpack_message
from auditor.recordings.recording import LABELS_NAME, METADATA_NAME, Definition, Topic, labels_from_json
from auditor.recordings.schemas import schema_name
from auditor.safety.budget import CHUNKS, MAX_BYTES, Spending

_MESSAGE_HEAD = struct.Struct("<HIQQ")
_CHUNK_INDEX_HEAD = struct.Struct("<QQQ")
_MAX_LOG_TIME_NS = 2**63 - 1
_MAX_CHUNK_RECORDS = 2**20
_MAX_ATTACHED_BYTES = 16 * 2**20
_MAX_METADATA_BYTES = 2**20
_MOST_NOTED = 2**10
"""Attachments and metadata whose places are kept; of a file that has more they are looked for again."""

_PLACE = struct.Struct("<QQ")
"""Offset and length of a record, with which its index begins."""

_INDEXES = {Opcode.ATTACHMENT_INDEX: Opcode.ATTACHMENT, Opcode.METADATA_INDEX: Opcode.METADATA}
_ATTACHED = frozenset({Opcode.ATTACHMENT, Opcode.METADATA})


class McapRead(FileRead):
    """One forward read of one file: yields messages, counts all of them, notes damage.

    Behind a read without damage `attached` has the places of the file's attachments and metadata.
    """

    def __init__(
        self,
        source: Source,
        wanted: Collection[str] | None,
        names: Names,
        damage: DamageLog,
        attached: dict[Source, Sequence[Record]] | None = None,
    ) -> None:
        super().__init__(source, wanted, names, damage)
        self._attached = attached
        self._messages_spending = Spending(CHUNKS)
        self._schemas: dict[int, str] = {}
        self._chunk_offsets: list[int] = []

    def messages(self) -> Iterator[Message]:
        """Every message of the requested topics, in file order."""
        with self._source.open() as file:
            size = self._source.size
            ending = read_ending(file, size)
            file.seek(0)
            damage_before = self._damage.count
            if ending:
                # A channel stands in the first chunk that uses it: where that chunk is damaged, the summary has it.
                self.learn_summary(ending.summary)
            stream = ForwardStream(file, size, checksum=bool(ending and ending.data_crc))
            crc, attached = 0, list[Record]()
            try:
                for record in records(stream, self._damage, self._chunk_offsets):
                    if record.opcode == Opcode.DATA_END:
                        if ending and ending.data_crc and crc != ending.data_crc:
                            self._damage.add("the checksum over all its data is wrong", record.offset)
                        self._note(attached, whole=self._damage.count == damage_before)
                        break
                    if record.opcode in _ATTACHED:
                        attached.append(record)
                    yield from self._record(stream, record)
                    stream.skip_to(record.offset + HEAD.size + record.length)
                    crc = stream.crc
            except CutError:
                self._damage.add("the file became shorter while it was read", stream.offset)
            except OSError as error:
                self._damage.add(f"it cannot be read further ({error.strerror or error})", stream.offset)
            if ending is None and self._damage.count == damage_before:
                self._damage.add("its end is damaged (footer or summary)", stream.offset)
        self.channels.note_unknown()

    def _note(self, attached: Sequence[Record], *, whole: bool) -> None:
        if self._attached is not None and whole and len(attached) <= _MOST_NOTED:
            self._attached[self._source] = attached

    def span_ns(self) -> Span | None:
        """The first and last log time: by the summary where there is one, else by the heads of chunks and messages."""
        with self._source.open() as file:
            size = self._source.size
            ending = read_ending(file, size)
            if ending and (span := span_of_summary(ending.summary)):
                return span
            file.seek(0)
            with suppress(CutError):
                return span_of_records(ForwardStream(file, size))
        return None

    def learn_ending(self) -> None:
        """Learn what the summary has, where there is one."""
        with self._source.open() as file:
            ending = read_ending(file, self._source.size)
        if ending:
            self.learn_summary(ending.summary)

    def _record(self, stream: ForwardStream, record: Record) -> Iterator[Message]:
        if record.opcode == Opcode.CHUNK:
            body = read_body(stream, record, self._damage)
            if body is not None:
                yield from self._chunk(body, record.offset)
        elif record.opcode == Opcode.CUT_CHUNK:
            yield from self._cut_chunk(stream.read(min(record.length, MAX_BYTES)), record.offset)
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
        channel = self.channels.count_message(head[0] | head[1] << 8, record.length - len(head))
        if channel is None or not channel.wanted:
            return
        body = read_body(stream, record._replace(length=record.length - len(head)), self._damage)
        if body is not None and (message := self._made(channel, head, 0, body, record.offset)) is not None:
            yield message

    def _chunk(self, body: bytes, offset: int) -> Iterator[Message]:
        try:
            inside = unpack_chunk(body, self._spending)
        except BadChunkError as error:
            self._damage.add(f"a chunk is left out: {error}", offset)
            return
        end = yield from self._inside(inside, offset, cut=False)
        if end != len(inside):
            self._damage.add("a chunk ends inside a record, or has too many records", offset)

    def _cut_chunk(self, body: bytes, offset: int) -> Iterator[Message]:
        """The messages that are left of the chunk that the file's end cuts."""
        before = self.channels.total
        yield from self._inside(unpack_cut_chunk(body), offset, cut=True)
        kept = self.channels.total - before
        self._damage.add(f"this chunk is cut; {kept} messages before the cut are kept, their checksum unknown", offset)

    def _inside(self, inside: memoryview, offset: int, *, cut: bool) -> Generator[Message, None, int]:
        """The messages of an unpacked chunk; returns where its last whole record ends."""
        position, end, left = 0, len(inside), _MAX_CHUNK_RECORDS
        while position + HEAD.size <= end and left:
            left -= 1
            opcode, length = HEAD.unpack_from(inside, position)
            start = position + HEAD.size
            if start + length > end or opcode == 0 or (cut and not is_trusted(inside[start : start + length])):
                break
            position = start + length
            if opcode == Opcode.MESSAGE and length >= _MESSAGE_HEAD.size:
                number = inside[start] | inside[start + 1] << 8
                channel = self.channels.count_message(number, length - _MESSAGE_HEAD.size)
                if channel is not None and channel.wanted:
                    data = bytes(inside[start + _MESSAGE_HEAD.size : position])
                    message = self._made(channel, inside, start, data, offset)
                    if message is not None:
                        yield message
            elif opcode in {Opcode.SCHEMA, Opcode.CHANNEL}:
                self.learn(opcode, inside[start:position], offset)
        return position

    def _made(self, channel: Channel, head: bytes | memoryview, start: int, data: bytes, offset: int) -> Message | None:
        log_time_ns = _MESSAGE_HEAD.unpack_from(head, start)[2]
        if log_time_ns > _MAX_LOG_TIME_NS:
            self._damage.add(f"a log time of {log_time_ns} ns is out of range: taken as 0", offset)
            log_time_ns = 0
        topic = channel.topic
        if topic.encoding == "cdr":
            try:
                data = unpack_message(data, self._messages_spending)
            except BadChunkError as error:
                self._damage.add(f"a message of {topic.name!r} is left out: {error}", offset)
                return None
        return Message(topic.name, topic.schema, topic.encoding, log_time_ns, data)

    def learn_summary(self, summary: bytes) -> None:
        """Learn the schemas, the channels and the starts of chunks from a summary section."""
        for opcode, body, end in summary_records(summary):
            if opcode in {Opcode.SCHEMA, Opcode.CHANNEL}:
                self.learn(opcode, body, end, spare=True)
            elif opcode == Opcode.CHUNK_INDEX and len(body) >= _CHUNK_INDEX_HEAD.size:
                self._chunk_offsets.append(_CHUNK_INDEX_HEAD.unpack_from(body)[2])
        self._chunk_offsets.sort()

    def learn(self, opcode: int, body: bytes | memoryview, offset: int, *, spare: bool = False) -> None:
        """Learn a schema or channel record; those of a summary are spare."""
        stream = ReadDataStream(BytesIO(body))
        try:
            if opcode == Opcode.SCHEMA:
                self._learn_schema(Schema.read(stream), offset)
            else:
                # Not by mcap: its map of metadata, which is not needed, may hold millions of entries.
                channel_id, schema_id = stream.read2(), stream.read2()
                topic = Topic(
                    stream.read_prefixed_string(), self._schemas.get(schema_id, ""), stream.read_prefixed_string()
                )
                self.channels.learn(channel_id, topic, spare=spare)
        except (EndOfFile, struct.error, UnicodeDecodeError) as error:
            self._damage.add(f"a schema or channel record is damaged ({error or 'cut'})", offset)

    def _learn_schema(self, schema: Schema, offset: int) -> None:
        name = schema_name(schema.name)
        self._schemas[schema.id] = name
        self._names.add_definition(name, Definition(schema.encoding, schema.data), self._damage, offset)


def attached_in_summary(summary: bytes) -> list[Record]:
    """Where a summary says that attachments and metadata lie."""
    places: list[Record] = []
    for opcode, body, _ in summary_records(summary):
        if opcode in _INDEXES and len(body) >= _PLACE.size and len(places) < _MOST_NOTED:
            offset, length = _PLACE.unpack_from(body)
            if length >= HEAD.size:
                places.append(Record(_INDEXES[opcode], offset, length - HEAD.size))
    return sorted(places, key=lambda record: record.offset)


def attached_to(source: Source, noted: Sequence[Record] | None = None) -> Iterator[Attachment | Metadata]:
    """Attachments and metadata records of a file, at the places that a read has noted; else all others are skipped."""
    damage = DamageLog()
    with source.open() as file:
        stream = ForwardStream(file, source.size, checksum=False)
        for record in records(stream, damage) if noted is None else noted:
            if record.opcode in _ATTACHED:
                stream.skip_to(record.offset + HEAD.size)
                most = _MAX_METADATA_BYTES if record.opcode == Opcode.METADATA else _MAX_ATTACHED_BYTES
                body = read_body(stream, record, damage) if record.length <= most else None
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


class McapReader:
    """Recognises .mcap files."""

    def detects(self, path: Path) -> bool:
        """True for a file with that extension."""
        return path.suffix.lower() == ".mcap" and path.is_file()

    def open(self, path: Path) -> "McapRecording":
        """Open it. Raises RecordingError where it does not begin as an MCAP file does."""
        return McapRecording(path, ((path,),))


class McapRecording(FilesRecording):
    """One MCAP file or several; CRCs are checked, one chunk of a stream is in memory."""

    def __init__(self, path: Path, streams: Streams) -> None:
        super().__init__(path, streams)
        self._attached: dict[Source, Sequence[Record]] = {}
        self._listed: dict[Source, Sequence[Record]] = {}
        for source in self._sources:
            with source.open() as stream:
                if stream.read(len(MAGIC)) != MAGIC:
                    self._unreadable[source] = source.problem or "this is not an MCAP file, or its beginning is cut"
        self._refuse_unreadable("check how it was copied, or give the file its correct extension")
        self._learn_topics()

    def _file_read(self, source: Source, topics: Collection[str] | None, damage: DamageLog) -> McapRead:
        return McapRead(source, topics, self._names, damage, self._attached)

    def _learn_topics(self) -> None:
        """Learn topics from the summaries where there are any, else from the beginning."""
        for source in self._sources:
            with source.open() as stream:
                ending = read_ending(stream, source.size)
            if ending:
                McapRead(source, None, self._names, DamageLog()).learn_summary(ending.summary)
                self._listed[source] = attached_in_summary(ending.summary)
        if not self._names.topics:
            self._learn_from_beginning()

    def labels(self) -> tuple[AttackLabel, ...]:
        """Ground truth from the attachments named auditor-labels.json. Raises RecordingError where ill-formed."""
        return self._extras[0]

    def metadata(self) -> Mapping[str, str]:
        """The metadata record named 'auditor'."""
        return self._extras[1]

    def calibrations(self) -> Mapping[str, str]:
        """Attachments of YAML and JSON, and metadata's values of several lines, that its files' summaries list."""
        calibrations: dict[str, str] = {}
        for source in self._sources:
            for attached in attached_to(source, self._listed.get(source, ())):
                if isinstance(attached, Metadata):
                    texts = {f"{attached.name} {key}": text for key, text in attached.metadata.items() if "\n" in text}
                    calibrations.update(texts)
                elif attached.name.lower().endswith((".yaml", ".yml", ".json")):
                    calibrations[attached.name] = attached.data.decode("utf-8", "replace")
        return calibrations

    @cached_property
    def _extras(self) -> tuple[tuple[AttackLabel, ...], Mapping[str, str]]:
        labels: list[AttackLabel] = []
        metadata: dict[str, str] = {}
        for source in self._sources:
            if source in self._unreadable:
                continue
            for attached in attached_to(source, self._attached.get(source)):
                if isinstance(attached, Metadata):
                    metadata.update(attached.metadata if attached.name == METADATA_NAME else {})
                elif attached.name == LABELS_NAME:
                    labels.extend(labels_from_json(attached.data, self.path))
        return tuple(labels), metadata
