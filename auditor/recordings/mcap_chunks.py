"""Opening one MCAP chunk without trusting it (format: the MCAP specification, version 0, record 0x06 Chunk)."""

import struct
import zlib

import lz4.frame
import zstandard

MAX_BYTES = 256 * 2**20
"""No record, chunk or unpacked chunk may be larger: a scan has 400 MB, and real chunks have 1 to 10 MB."""

_TIMES_SIZE_CRC = struct.Struct("<QQQI")
_UINT32 = struct.Struct("<I")
_UINT64 = struct.Struct("<Q")


class BadChunkError(Exception):
    """Why a chunk is left out; caught by the reading loop, which notes it with its offset and goes on."""


def unpack_chunk(body: bytes) -> memoryview:
    """The records inside a chunk. Raises BadChunkError where it is ill-formed, oversized or fails its checksum."""
    try:
        _, _, size, crc = _TIMES_SIZE_CRC.unpack_from(body, 0)
        (name_length,) = _UINT32.unpack_from(body, 28)
        compression = bytes(body[32 : 32 + name_length])
        (packed_length,) = _UINT64.unpack_from(body, 32 + name_length)
    except struct.error as error:
        raise BadChunkError("its header is cut") from error
    packed = memoryview(body)[40 + name_length :]
    if len(packed) != packed_length:
        raise BadChunkError(f"it declares {packed_length} bytes and holds {len(packed)}")
    if size > MAX_BYTES:
        raise BadChunkError(f"it declares {size} unpacked bytes; at most {MAX_BYTES} are accepted")
    records = _unpack(compression, packed, size)
    if len(records) != size:
        raise BadChunkError(f"it declares {size} unpacked bytes and holds {len(records)}")
    if crc and zlib.crc32(records) != crc:
        raise BadChunkError("its checksum is wrong")
    return records


def _unpack(compression: bytes, packed: memoryview, size: int) -> memoryview:
    if compression == b"":
        return packed
    if compression == b"zstd":
        return memoryview(_unpack_zstd(packed, size))
    if compression == b"lz4":
        return memoryview(_unpack_lz4(packed, size))
    raise BadChunkError(f"its compression {compression[:20]!r} is unknown")


def _unpack_zstd(packed: memoryview, size: int) -> bytes:
    try:
        # -1: the frame does not say; the output limit below then holds it.
        if zstandard.frame_content_size(packed) not in {-1, size}:
            raise BadChunkError("its zstd frame declares another size than the chunk")
        unpacker = zstandard.ZstdDecompressor(max_window_size=MAX_BYTES)
        return unpacker.decompress(packed, max_output_size=size, allow_extra_data=False)
    except zstandard.ZstdError as error:
        raise BadChunkError(f"its zstd data are damaged ({error})") from error


def _unpack_lz4(packed: memoryview, size: int) -> bytes:
    unpacker = lz4.frame.LZ4FrameDecompressor()
    try:
        # One byte more than declared, so that a frame that holds more is seen.
        records: bytes = unpacker.decompress(packed, max_length=size + 1)
    except RuntimeError as error:
        raise BadChunkError(f"its lz4 data are damaged ({error})") from error
    if not unpacker.eof:
        raise BadChunkError("its lz4 data are cut or longer than declared")
    return records
