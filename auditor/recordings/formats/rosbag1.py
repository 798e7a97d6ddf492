"""ROS 1 bags: their records, and one forward read of a bag, indexed or not, whole, cut or still active.

Format: the rosbag format, version 2.0. The index is used for the names of topics and to find the next chunk behind a
damaged place, never to find messages. A bag has no checksums: its messages are checked when they are decoded.

The package `rosbags` would read a bag that was closed properly. Its reader is not used because it needs the index at
the end, which a cut or active bag does not have, and trusts the sizes of chunks. This module needs no index and
compares every size with the bytes that are there. rosbags still decodes the messages.
"""

import struct
from bisect import bisect_right
from collections.abc import Collection, Iterator
from contextlib import suppress
from itertools import islice
from typing import IO, NamedTuple

from auditor.errors import RecordingError
from auditor.model.frames import Message
from auditor.recordings.formats.files import CutError, FileRead, ForwardStream
from auditor.recordings.formats.found import DamageLog, Names, Span, is_trusted, span_over
from auditor.recordings.formats.unpacking import BadChunkError, Source, allow, unpack, unpack_beginning
from auditor.recordings.recording import Definition, Topic
from auditor.recordings.schemas import schema_name
from auditor.safety.budget import MAX_BYTES

MAGIC = b"#ROSBAG V2.0\n"
_UINT32 = struct.Struct("<I")
_TIME = struct.Struct("<II")
_INDEX_ENTRY = struct.Struct("<III")
_MAX_HEADER_BYTES = 2**20
_MAX_FIELDS = 64
Fields = dict[bytes, bytes]
_MAX_INDEX_RECORDS = 1_000_000


class Op:
    """The kinds of records."""

    MESSAGE = 2
    INDEX = 4
    CHUNK = 5
    CHUNK_INFO = 6
    CONNECTION = 7


class NoRecordError(Exception):
    """The bytes where a record should begin are not a record; caught by the reading loop."""


class RecordHead(NamedTuple):
    """A record's header, and the length of the data after it."""

    op: int
    fields: Fields
    length: int


def read_head(stream: ForwardStream) -> RecordHead:
    """The header of the record that begins here. Raises NoRecordError and CutError."""
    (length,) = _UINT32.unpack(stream.read(4))
    if not 0 < length <= _MAX_HEADER_BYTES:
        raise NoRecordError(f"a header of {length} bytes")
    fields = parse_fields(stream.read(length))
    return RecordHead(op_of(fields), fields, _UINT32.unpack(stream.read(4))[0])


def parse_fields(header: bytes | memoryview) -> Fields:
    """The fields of a header by name. Raises NoRecordError."""
    fields: Fields = {}
    position, header = 0, bytes(header)
    while position < len(header):
        if position + 4 > len(header) or len(fields) > _MAX_FIELDS:
            raise NoRecordError("an ill-formed header")
        (length,) = _UINT32.unpack_from(header, position)
        position += 4
        name, equals, value = header[position : position + length].partition(b"=")
        position += length
        if position > len(header) or not equals:
            raise NoRecordError("an ill-formed header")
        fields[name] = value
    return fields


def op_of(fields: Fields) -> int:
    """The kind of record that a header declares. Raises NoRecordError."""
    op = fields.get(b"op", b"")
    if len(op) != 1:
        raise NoRecordError("a header without its kind")
    return op[0]


def number(fields: Fields, name: bytes) -> int:
    """An unsigned number of 4 or 8 bytes. Raises NoRecordError."""
    value = fields.get(name, b"")
    if len(value) not in {4, 8}:
        raise NoRecordError(f"a header without {name.decode()}")
    return int.from_bytes(value, "little")


def time_ns(fields: Fields, name: bytes = b"time") -> int:
    """The time of a message or chunk. Raises NoRecordError."""
    value = fields.get(name, b"")
    if len(value) != _TIME.size:
        raise NoRecordError(f"a header without its {name.decode()}")
    seconds, nanoseconds = _TIME.unpack(value)
    return int(seconds * 10**9 + nanoseconds)


class Inner(NamedTuple):
    """A record inside a chunk; `end` is where the next one begins."""

    op: int
    fields: Fields
    data: memoryview
    end: int


def inner_records(inside: memoryview) -> Iterator[Inner]:
    """The whole records of an unpacked chunk. Raises NoRecordError where there are other bytes between them."""
    position = 0
    while position + 4 <= len(inside):
        (length,) = _UINT32.unpack_from(inside, position)
        start = position + 4 + length
        if length == 0:
            raise NoRecordError("a header of 0 bytes")
        if start + 4 > len(inside):
            return
        end = start + 4 + _UINT32.unpack_from(inside, start)[0]
        if end > len(inside):
            return
        fields = parse_fields(inside[position + 4 : start])
        yield Inner(op_of(fields), fields, inside[start + 4 : end], end)
        position = end


class BagRead(FileRead):
    """One forward read of one bag: yields messages, counts all of them, notes damage."""

    encoding = "ros1"

    def __init__(self, source: Source, wanted: Collection[str] | None, names: Names, damage: DamageLog) -> None:
        super().__init__(source, wanted, names, damage)
        self._chunk_offsets: list[int] = []
        self._chunk_times_ns: list[int] = []
        self._index_offset: int | None = None

    def learn_topics(self) -> None:
        """Learn topics from the index. Raises RecordingError where the file is not a bag, or is encrypted."""
        with self._source.open() as file:
            self._learn_index(file, self._source.size)

    def span_ns(self) -> Span | None:
        """The first and last time: by the index where there is one, else by what stands behind each chunk.

        Raises RecordingError where the file is not a bag.
        """
        with self._source.open() as file:
            size = self._source.size
            self._learn_index(file, size)
            if not self._chunk_times_ns:
                file.seek(0)
                stream = ForwardStream(file, size)
                stream.read(len(MAGIC))
                return span_over(_times(stream))
        return span_over(self._chunk_times_ns)

    def messages(self) -> Iterator[Message]:
        """Every message of the requested topics, in file order. Raises RecordingError where the file is not a bag."""
        with self._source.open() as file:
            size = self._source.size
            self._learn_index(file, size)
            file.seek(0)
            stream = ForwardStream(file, size)
            try:
                stream.read(len(MAGIC))
                yield from self._walk(stream)
            except CutError:
                self._damage.add("the file became shorter while it was read", stream.offset)
            except OSError as error:
                self._damage.add(f"it cannot be read further ({error.strerror or error})", stream.offset)
        self.channels.note_unknown()

    def _walk(self, stream: ForwardStream) -> Iterator[Message]:
        while stream.offset < stream.size:
            start = stream.offset
            head = None
            try:
                head = read_head(stream)
                problem = "a record longer than the file"
            except NoRecordError as error:
                problem = str(error)
            except CutError:
                problem = "a record that is cut"
            if head and self._is_open_chunk(head):
                yield from self._cut_chunk(stream, head, MAX_BYTES, start)
                return
            if head and stream.offset + head.length <= stream.size:
                end = stream.offset + head.length
                yield from self._record(stream, head, start)
                stream.skip_to(end)
            elif (following := self._next_chunk(start)) is not None:
                self._damage.add(f"{following - start} bytes are left out ({problem})", start)
                stream.skip_to(following)
            elif head and head.op == Op.CHUNK:
                yield from self._cut_chunk(stream, head, _size(head), start)
                return
            else:
                self._damage.add(
                    f"no records from here on ({problem}): {stream.size - start} bytes are not read", start
                )
                return
        if not self._index_offset:
            self._damage.add("the recording was not closed: it has no index")
        elif stream.size <= self._index_offset:
            self._damage.add("the recording is cut before its index", stream.size)

    def _is_open_chunk(self, head: RecordHead) -> bool:
        """True for the last chunk of an active bag: its sizes are written when it is complete.

        Where it is not compressed, its records follow the header as if there were no chunk.
        """
        compressed = head.fields.get(b"compression") not in {b"none", None}
        return head.op == Op.CHUNK and head.length == 0 and not self._index_offset and compressed

    def _next_chunk(self, offset: int) -> int | None:
        """The start of the next chunk behind an offset by the index; None where there is none."""
        place = bisect_right(self._chunk_offsets, offset)
        return self._chunk_offsets[place] if place < len(self._chunk_offsets) else None

    def _record(self, stream: ForwardStream, head: RecordHead, start: int) -> Iterator[Message]:
        if head.op not in {Op.CHUNK, Op.CONNECTION, Op.MESSAGE}:
            return
        if head.length > MAX_BYTES:
            self._damage.add(f"a record of {head.length} bytes is left out; at most {MAX_BYTES} are accepted", start)
            return
        data = stream.read(head.length)
        try:
            if head.op == Op.CHUNK:
                yield from self._chunk(head, data, start)
            else:
                # In an active bag the last chunk's header is written last: until then its records stand alone.
                yield from self._inner(head.op, head.fields, memoryview(data), start)
        except NoRecordError as error:
            self._damage.add(f"a record is left out ({error})", start)

    def _chunk(self, head: RecordHead, data: bytes, start: int) -> Iterator[Message]:
        try:
            size = number(head.fields, b"size")
            allow(self._spending, len(data), size)
            inside = unpack(head.fields.get(b"compression", b""), memoryview(data), size)
        except BadChunkError as error:
            self._damage.add(f"a chunk is left out: {error}", start)
            return
        end = 0
        for op, fields, content, after in inner_records(inside):
            yield from self._inner(op, fields, content, start)
            end = after
        if end != len(inside):
            self._damage.add("a chunk ends inside a record", start)

    def _cut_chunk(self, stream: ForwardStream, head: RecordHead, size: int, start: int) -> Iterator[Message]:
        """The messages that are left of the chunk that the file's end cuts."""
        recovered = 0
        packed = memoryview(stream.read(min(stream.size - stream.offset, MAX_BYTES)))
        inside = unpack_beginning(head.fields.get(b"compression", b""), packed, min(size, MAX_BYTES))
        try:
            for op, fields, content, _ in inner_records(inside):
                if not is_trusted(content):
                    break
                recovered += op == Op.MESSAGE
                yield from self._inner(op, fields, content, start)
        except NoRecordError:
            pass  # the damage noted below says that the chunk is cut
        self._damage.add(f"the recording is cut inside this chunk; {recovered} messages before the cut are kept", start)

    def _inner(self, op: int, fields: Fields, data: memoryview, offset: int) -> Iterator[Message]:
        if op == Op.CONNECTION:
            self._learn(fields, data)
        elif op == Op.MESSAGE:
            log_time_ns = time_ns(fields)
            channel = self.channels.count_message(number(fields, b"conn"), len(data))
            if channel is not None and channel.wanted:
                topic = channel.topic
                yield Message(topic.name, topic.schema, topic.encoding, log_time_ns, bytes(data))
        elif op != Op.INDEX:
            self._damage.add(f"a record of kind {op} lies inside a chunk", offset)

    def _learn(self, fields: Fields, data: memoryview, *, spare: bool = False) -> None:
        """Learn a connection record."""
        declared = parse_fields(data)
        schema = schema_name(declared.get(b"type", b"").decode("utf-8", "replace"))
        topic = Topic(fields.get(b"topic", b"").decode("utf-8", "replace"), schema, self.encoding)
        self.channels.learn(number(fields, b"conn"), topic, spare=spare)
        definition = Definition("ros1msg", declared.get(b"message_definition", b""))
        self._names.add_definition(schema, definition, self._damage)

    def _learn_index(self, file: IO[bytes], size: int) -> None:
        if file.read(len(MAGIC)) != MAGIC:
            raise RecordingError(
                "this is not a ROS 1 bag of version 2.0, or its beginning is cut", where=self._source.path
            )
        stream = ForwardStream(file, size)
        stream.offset = len(MAGIC)
        try:
            head = read_head(stream)
            if head.fields.get(b"encryptor"):
                raise RecordingError("the bag is encrypted", where=self._source.path, remedy="decrypt it first")
            self._index_offset = number(head.fields, b"index_pos")
            if not len(MAGIC) < self._index_offset < size:
                return
            stream.skip_to(self._index_offset)
            for op, fields, content in islice(_index_records(stream), _MAX_INDEX_RECORDS):
                if op == Op.CONNECTION:
                    self._learn(fields, memoryview(content), spare=True)
                elif op == Op.CHUNK_INFO:
                    self._chunk_offsets.append(number(fields, b"chunk_pos"))
                    with suppress(NoRecordError):
                        self._chunk_times_ns += (time_ns(fields, b"start_time"), time_ns(fields, b"end_time"))
        except (CutError, NoRecordError):
            pass  # the walk over the data notes the damage
        self._chunk_offsets.sort()


def _index_records(stream: ForwardStream) -> Iterator[tuple[int, Fields, bytes]]:
    while stream.offset < stream.size:
        head = read_head(stream)
        if head.length > MAX_BYTES:
            raise NoRecordError("an index record that is too long")
        yield head.op, head.fields, stream.read(head.length)


def _times(stream: ForwardStream) -> Iterator[int]:
    """The times of the messages of a bag without an index, as far as it is whole; chunks are not unpacked."""
    with suppress(CutError, NoRecordError):
        while stream.offset < stream.size:
            head = read_head(stream)
            end = stream.offset + head.length
            if head.op == Op.MESSAGE:
                yield time_ns(head.fields)
            elif head.op == Op.INDEX and head.length <= MAX_BYTES:
                data = stream.read(head.length)
                whole = len(data) - len(data) % _INDEX_ENTRY.size
                yield from (sec * 10**9 + nsec for sec, nsec, _ in _INDEX_ENTRY.iter_unpack(data[:whole]))
            stream.skip_to(end)


def _size(head: RecordHead) -> int:
    try:
        return number(head.fields, b"size")
    except NoRecordError:
        return 0
