"""Records of ROS 1 bags, read without trusting their sizes (format: the rosbag format, version 2.0)."""

import struct
from collections.abc import Iterator
from typing import NamedTuple

from auditor.recordings.forward_stream import ForwardStream

MAGIC = b"#ROSBAG V2.0\n"
_UINT32 = struct.Struct("<I")
_TIME = struct.Struct("<II")
_MAX_HEADER_BYTES = 2**20
_MAX_FIELDS = 64

Fields = dict[bytes, bytes]


class Op:
    """The kinds of records."""

    MESSAGE = 2
    INDEX = 4
    CHUNK = 5
    CHUNK_INFO = 6
    CONNECTION = 7


class NoRecordError(Exception):
    """What stands where a record should begin is none; caught by the reading loop."""


class Head(NamedTuple):
    """A record's header, and the length of the data after it."""

    op: int
    fields: Fields
    length: int


def read_head(stream: ForwardStream) -> Head:
    """The header of the record that begins here. Raises NoRecordError and CutError."""
    (length,) = _UINT32.unpack(stream.read(4))
    if not 0 < length <= _MAX_HEADER_BYTES:
        raise NoRecordError(f"a header of {length} bytes")
    fields = parse_fields(stream.read(length))
    return Head(op_of(fields), fields, _UINT32.unpack(stream.read(4))[0])


def parse_fields(header: bytes | memoryview) -> Fields:
    """The fields of a header by name. Raises NoRecordError."""
    fields: Fields = {}
    position, header = 0, bytes(header)
    while position < len(header):
        if position + 4 > len(header) or len(fields) > _MAX_FIELDS:
            raise NoRecordError("a header that is none")
        (length,) = _UINT32.unpack_from(header, position)
        position += 4
        name, equals, value = header[position : position + length].partition(b"=")
        position += length
        if position > len(header) or not equals:
            raise NoRecordError("a header that is none")
        fields[name] = value
    return fields


def op_of(fields: Fields) -> int:
    """What kind of record a header announces. Raises NoRecordError."""
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


def time_ns(fields: Fields) -> int:
    """The time of a message. Raises NoRecordError."""
    value = fields.get(b"time", b"")
    if len(value) != _TIME.size:
        raise NoRecordError("a message without its time")
    seconds, nanoseconds = _TIME.unpack(value)
    return int(seconds * 10**9 + nanoseconds)


class Inner(NamedTuple):
    """A record inside a chunk; `end` is where the next one begins."""

    op: int
    fields: Fields
    data: memoryview
    end: int


def inner_records(inside: memoryview) -> Iterator[Inner]:
    """The whole records of an unpacked chunk. Raises NoRecordError where something else stands between them."""
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
