"""Opening one MCAP chunk without trusting it (format: the MCAP specification, version 0, record 0x06 Chunk)."""

import struct
import zlib
from typing import NamedTuple

from auditor.recordings.unpacking import MAX_BYTES, BadChunkError, Expansion, unpack, unpack_beginning

_TIMES_SIZE_CRC = struct.Struct("<QQQI")
_UINT32 = struct.Struct("<I")
_UINT64 = struct.Struct("<Q")


class _Parts(NamedTuple):
    """What a chunk declares of itself, and the bytes that are there."""

    size: int
    crc: int
    compression: bytes
    packed_length: int
    packed: memoryview


def unpack_chunk(body: bytes, expansion: Expansion) -> memoryview:
    """The records inside a chunk. Raises BadChunkError where it is ill-formed, oversized or fails its checksum."""
    parts = _parts(body)
    if len(parts.packed) != parts.packed_length:
        raise BadChunkError(f"it declares {parts.packed_length} bytes and holds {len(parts.packed)}")
    expansion.allow(parts.packed_length, parts.size)
    records = unpack(parts.compression, parts.packed, parts.size)
    if parts.crc and zlib.crc32(records) != parts.crc:
        raise BadChunkError("its checksum is wrong")
    return records


def unpack_cut_chunk(body: bytes) -> memoryview:
    """What a cut chunk still holds; its checksum, which is over all of it, cannot be checked."""
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
