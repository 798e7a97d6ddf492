"""Records and chunks of an MCAP file, read forward within bounds (format: the MCAP specification, version 0).

The readers of the package `mcap` would give the same messages of a whole file. They are not used because they end at
the first record that is cut or damaged, and unpack a chunk to whatever size it declares. This module compares every
length with a limit and with the bytes that are there, and goes on behind a damaged place. The package still decodes
schemas, attachments and metadata.
"""

import struct
import zlib
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from typing import IO, NamedTuple

from auditor.recordings.formats.files import CutError, ForwardStream
from auditor.recordings.formats.found import DamageLog, Span, span_over
from auditor.recordings.formats.unpacking import BadChunkError, allow, unpack, unpack_beginning
from auditor.safety.budget import MAX_BYTES, Spending

MAGIC = b"\x89MCAP0\r\n"
HEAD = struct.Struct("<BQ")
_FOOTER = struct.Struct("<BQQQI")
_DATA_END = struct.Struct("<BQI")

_MAX_SUMMARY_BYTES = 16 * 2**20
"""The summary of 64 GB of chunks; every read parses it."""

_TIMES_SIZE_CRC = struct.Struct("<QQQI")
_STATISTICS_HEAD = struct.Struct("<QHIIII")
_TIMES = struct.Struct("<QQ")
_MESSAGE_TIME = struct.Struct("<6xQ")
_UINT32 = struct.Struct("<I")
_UINT64 = struct.Struct("<Q")


class Opcode:
    """The records that are parsed (mcap.opcode has them as an IntEnum, which is slow to compare with)."""

    FOOTER = 0x02
    SCHEMA = 0x03
    CHANNEL = 0x04
    MESSAGE = 0x05
    CHUNK = 0x06
    ATTACHMENT = 0x09
    ATTACHMENT_INDEX = 0x0A
    METADATA = 0x0C
    METADATA_INDEX = 0x0D
    DATA_END = 0x0F
    CHUNK_INDEX = 0x08
    STATISTICS = 0x0B
    CUT_CHUNK = 0x100
    """Not an opcode of the format: the last chunk, where the file ends inside it."""


class Record(NamedTuple):
    """A record's kind, where it starts in the file, and the length of its body."""

    opcode: int
    offset: int
    length: int


def records(stream: ForwardStream, damage: DamageLog, resume_at: Sequence[int] = ()) -> Iterator[Record]:
    """Every top-level record up to the footer; the caller may read its body; the rest is skipped.

    `resume_at` holds offsets, in order, at which the file's index says that records begin: behind a damaged place
    reading goes on at the next of them. Without one it stops, noting the damage, where the file is cut or filled with
    zeros, or where a length is impossible. The last chunk of a cut file is given with the bytes that are left of it.
    Raises CutError where the file became shorter while it was read.
    """
    stream.read(len(MAGIC))
    start = stream.offset
    while start < stream.size:
        try:
            opcode, length = HEAD.unpack(stream.read(HEAD.size))
        except CutError:
            break
        end = start + HEAD.size + length
        if opcode == 0 or end > stream.size:
            place = bisect_right(resume_at, start)
            if place < len(resume_at):
                damage.add(f"{resume_at[place] - start} bytes are left out: they are not records", start)
                end = resume_at[place]
            elif opcode == 0:
                damage.add(f"no records from here on: {stream.size - start} bytes are not read", start)
                return
            else:
                if opcode == Opcode.CHUNK:
                    yield Record(Opcode.CUT_CHUNK, start, stream.size - start - HEAD.size)
                break
        else:
            yield Record(opcode, start, length)
            if opcode == Opcode.FOOTER:
                return
        stream.skip_to(end)
        start = end
    damage.add("the recording is cut, or still being written: it ends without its footer", start)


def read_body(stream: ForwardStream, record: Record, damage: DamageLog) -> bytes | None:
    """The body of a record, or None, noting the damage, where it is larger than is accepted. Raises CutError."""
    if record.length > MAX_BYTES:
        damage.add(f"a record of {record.length} bytes is left out; at most {MAX_BYTES} are accepted", record.offset)
        return None
    return stream.read(record.length)


class Ending(NamedTuple):
    """The end of a whole file: its summary section, and the CRC of the data section (0: none)."""

    summary: bytes
    data_crc: int


def read_ending(file: IO[bytes], size: int) -> Ending | None:
    """Read the footer, the record before the summary and the summary; None where they are not whole.

    A summary gives names and the starts of chunks; no message is found through it.
    """
    tail = len(MAGIC) + _FOOTER.size
    if size < len(MAGIC) + _DATA_END.size + tail:
        return None
    file.seek(size - tail)
    footer = file.read(tail)
    opcode, length, summary_start, _, summary_crc = _FOOTER.unpack_from(footer)
    if (opcode, length, footer[-len(MAGIC) :]) != (Opcode.FOOTER, _FOOTER.size - HEAD.size, MAGIC):
        return None
    end = size - tail
    summary_start = summary_start or end
    if not len(MAGIC) + _DATA_END.size <= summary_start <= end or end - summary_start > _MAX_SUMMARY_BYTES:
        return None
    file.seek(summary_start - _DATA_END.size)
    opcode, length, data_crc = _DATA_END.unpack(file.read(_DATA_END.size))
    if (opcode, length) != (Opcode.DATA_END, _DATA_END.size - HEAD.size):
        return None
    summary = file.read(end - summary_start)
    if summary_crc and zlib.crc32(footer[: _FOOTER.size - 4], zlib.crc32(summary)) != summary_crc:
        return None
    return Ending(summary, data_crc)


def span_of_summary(summary: bytes) -> Span | None:
    """The first and last log time by a summary's statistics; None where it has none, or counts no messages."""
    for opcode, body, _ in summary_records(summary):
        if opcode == Opcode.STATISTICS and len(body) >= _STATISTICS_HEAD.size + _TIMES.size:
            counted = _STATISTICS_HEAD.unpack_from(body)[0]
            return _TIMES.unpack_from(body, _STATISTICS_HEAD.size) if counted else None
    return None


def summary_records(summary: bytes) -> Iterator[tuple[int, memoryview, int]]:
    """Kind and body of each record of a summary, and where in it the record ends, as far as it is whole."""
    position, inside = 0, memoryview(summary)
    while position + HEAD.size <= len(summary):
        opcode, length = HEAD.unpack_from(summary, position)
        start, position = position + HEAD.size, position + HEAD.size + length
        if position > len(summary):
            return
        yield opcode, inside[start:position], position


def span_of_records(stream: ForwardStream) -> Span | None:
    """The first and last log time by the heads of chunks and messages; their bodies are skipped. Raises CutError."""
    return span_over(_times(stream))


def _times(stream: ForwardStream) -> Iterator[int]:
    for record in records(stream, DamageLog()):
        if record.opcode in {Opcode.CHUNK, Opcode.CUT_CHUNK} and record.length >= _TIMES.size:
            times = _TIMES.unpack(stream.read(_TIMES.size))
            yield from times if times != (0, 0) else ()  # a chunk without messages
        elif record.opcode == Opcode.MESSAGE and record.length >= _MESSAGE_TIME.size:
            yield _MESSAGE_TIME.unpack(stream.read(_MESSAGE_TIME.size))[0]


class _Parts(NamedTuple):
    """The header of a chunk, and the packed bytes that are there."""

    size: int
    crc: int
    compression: bytes
    packed_length: int
    packed: memoryview


def unpack_chunk(body: bytes, spending: Spending) -> memoryview:
    """The records inside a chunk. Raises BadChunkError where it is ill-formed, oversized or fails its checksum."""
    parts = _parts(body)
    if len(parts.packed) != parts.packed_length:
        raise BadChunkError(f"it declares {parts.packed_length} bytes and holds {len(parts.packed)}")
    allow(spending, parts.packed_length, parts.size)
    records = unpack(parts.compression, parts.packed, parts.size)
    if parts.crc and zlib.crc32(records) != parts.crc:
        raise BadChunkError("its checksum is wrong")
    return records


def unpack_cut_chunk(body: bytes) -> memoryview:
    """The records that a cut chunk still holds; its checksum, which is over the whole chunk, cannot be checked."""
    try:
        parts = _parts(body)
    except BadChunkError:
        return memoryview(b"")
    return unpack_beginning(parts.compression, parts.packed, min(parts.size, MAX_BYTES))


def _parts(body: bytes) -> _Parts:
    try:
        _, _, size, crc = _TIMES_SIZE_CRC.unpack_from(body, 0)
        (name_length,) = _UINT32.unpack_from(body, 28)
        compression = bytes(body[32 : 32 + name_length])
        (packed_length,) = _UINT64.unpack_from(body, 32 + name_length)
    except struct.error as error:
        raise BadChunkError("its header is cut") from error
    return _Parts(size, crc, compression, packed_length, memoryview(body)[40 + name_length :])
