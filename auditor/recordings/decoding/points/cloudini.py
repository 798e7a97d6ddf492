"""Points compressed by cloudini (github.com/facontidavide/cloudini, versions 2 to 5 of its form).

Behind a header lie chunks of points, packed by LZ4, zstd or not at all. In a chunk a point's fields follow each other,
and are what changed from the point before: a number of as many bytes as it needs, where a field has a resolution or
holds whole numbers; the difference of bits, or the value as it is, where it has none. From version 5 on whole numbers
lie behind all points, in sections that are not read. Only x, y and z are kept.
"""

import struct
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import lz4.block
import numpy as np
import zstandard
from numpy.typing import NDArray

from auditor.errors import DecodingError
from auditor.safety.budget import CHUNKS, OverBudgetError, Spending

MAGIC = b"CLOUDINI_V"
_VERSIONS = range(2, 6)
_CHUNKS_SINCE, _GORILLA_SINCE, _SECTIONS_SINCE = 3, 4, 5
_MOST_HEADER, _MOST_FIELDS, _MOST_POINTS, _MOST_WALKED = 1 << 16, 64, 2 * 10**6, 500_000
_CHUNK_POINTS = 1 << 15
_MOST_VARINT = 10
_XYZ_BYTES = 24
_NAN = np.int64(np.iinfo(np.int64).min)
_TYPES = ("", "i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8", "i8", "u8")
_NAMES = ("", "INT8", "UINT8", "INT16", "UINT16", "INT32", "UINT32", "FLOAT32", "FLOAT64", "INT64", "UINT64")
_AS_IT_IS, _LOSSY, _LOSSLESS = range(3)
_ENCODINGS = {"NONE": _AS_IT_IS, "LOSSY": _LOSSY, "LOSSLESS": _LOSSLESS}
_PACKINGS = {"NONE": 0, "LZ4": 1, "ZSTD": 2}
_VARINT, _COPY, _XOR, _GORILLA = range(4)


class _Field(NamedTuple):
    name: str
    kind: str
    resolution: float | None

    @property
    def size(self) -> int:
        return int(self.kind[1])


class _Head(NamedTuple):
    version: int
    points: int
    encoding: int
    packing: int
    fields: Sequence[_Field]


def of_cloudini(packed: bytes, most_points: int, topic: str) -> NDArray[np.floating[Any]]:
    """(N, 3) x, y and z, of float32 or float64. Raises DecodingError."""
    try:
        version = int(packed[len(MAGIC) : len(MAGIC) + 2])
        if version not in _VERSIONS:
            raise DecodingError(f"version {version} of cloudini is not read; those from 2 to 5 are", where=topic)
        head, start = (_head_of_text if version >= _CHUNKS_SINCE else _head_of_bytes)(packed, version)
        if head.points > min(most_points, _MOST_POINTS):
            raise DecodingError(f"its cloudini data hold {head.points} points, and {most_points} are said", where=topic)
        if [field.kind[0] for field in head.fields if field.name in {"x", "y", "z"}] != ["f"] * 3:
            raise DecodingError("its cloudini data have no x, y and z that are floats", where=topic)
        Spending(CHUNKS).allow(len(packed), _XYZ_BYTES * head.points)
        parts = [_points(chunk, count, head) for chunk, count in _chunks(packed[start:], head)]
    except (
        ValueError,
        IndexError,
        KeyError,
        OverflowError,
        struct.error,
        zstandard.ZstdError,
        lz4.block.LZ4BlockError,
    ) as error:
        raise DecodingError(f"its cloudini data are damaged ({str(error)[:60]})", where=topic) from error
    except OverBudgetError as error:
        raise DecodingError(f"its cloudini data hold points that {error}", where=topic) from error
    xyz: NDArray[np.floating[Any]] = np.concatenate(parts) if parts else np.empty((0, 3), np.float32)
    return xyz


def _head_of_bytes(packed: bytes, version: int) -> tuple[_Head, int]:
    """The header, and where it ends."""
    place = len(MAGIC) + 2
    width, height, _, encoding, packing, count = struct.unpack_from("<IIIBBH", packed, place)
    place += 16
    fields = []
    for _ in range(_few(count)):
        (length,) = struct.unpack_from("<H", packed, place)
        name = packed[place + 2 : place + 2 + length].decode("utf-8", "replace")
        _, kind, resolution = struct.unpack_from("<IBf", packed, place + 2 + length)
        fields.append(_Field(name, _kind(kind), resolution if resolution > 0 else None))
        place += 11 + length
    return _Head(version, width * height, encoding, packing, fields), place


def _head_of_text(packed: bytes, version: int) -> tuple[_Head, int]:
    """That of versions from 3 on: lines of YAML, and a zero."""
    end = packed.index(b"\0", 0, _MOST_HEADER)
    values: dict[str, str] = {}
    fields: list[dict[str, str]] = []
    for line in packed[:end].decode("utf-8", "replace").splitlines()[1:]:
        key, _, value = line.strip().removeprefix("- ").partition(":")
        if line.lstrip().startswith("- "):
            fields.append({})
        (fields[-1] if fields and line[:1] in " -" else values)[key] = value.strip()
    made = [
        _Field(one["name"], _TYPES[_NAMES.index(one["type"])], _resolution(one.get("resolution", "null")))
        for one in fields[: _few(len(fields))]
    ]
    points = int(values["width"]) * int(values["height"])
    if points < 0:
        raise ValueError("fewer than no points")
    return _Head(
        version, points, _ENCODINGS[values["encoding_opt"]], _PACKINGS[values["compression_opt"]], made
    ), end + 1


def _kind(number: int) -> str:
    if not 0 < number < len(_TYPES):
        raise ValueError(f"a field of the type {number}")
    return _TYPES[number]


def _few(count: int) -> int:
    if not 0 < count <= _MOST_FIELDS:
        raise ValueError(f"{count} fields")
    return count


def _resolution(text: str) -> float | None:
    value = 0.0 if text in {"null", "~", ""} else float(text)
    return value if value > 0 else None


def _chunks(data: bytes, head: _Head) -> Iterator[tuple[bytes, int]]:
    """The chunks as they were before they were packed, and how many points each has."""
    left, place = head.points, 0
    while left > 0:
        count, chunk = left, data
        if head.version >= _CHUNKS_SINCE:
            count = min(left, _CHUNK_POINTS)
            (length,) = struct.unpack_from("<I", data, place)
            chunk = data[place + 4 : place + 4 + length]
            if len(chunk) < length:
                raise ValueError("a chunk is cut")
            place += 4 + length
        yield _unpacked(chunk, head.packing, count * sum(_most_bytes(field) for field in head.fields) + 64), count
        left -= count


def _unpacked(chunk: bytes, packing: int, most: int) -> bytes:
    if packing == _PACKINGS["LZ4"]:
        unpacked: bytes = lz4.block.decompress(chunk, uncompressed_size=most)
        return unpacked
    if packing == _PACKINGS["ZSTD"]:
        with zstandard.ZstdDecompressor(max_window_size=CHUNKS.most_bytes).stream_reader(chunk) as reader:
            return bytes(reader.read(most))
    if packing != _PACKINGS["NONE"]:
        raise ValueError(f"packed in the way {packing}")
    return chunk


def _most_bytes(field: _Field) -> int:
    """Bytes that a value may take: a palette of a section holds it once, and its place in it."""
    return _MOST_VARINT + 1 + field.size


def _way(field: _Field, head: _Head) -> int | None:
    """How a field lies among the others of its point; None where it is in a section behind them."""
    if head.encoding == _AS_IT_IS or field.size == 1:
        return _COPY
    if field.kind[0] != "f":
        return None if head.version >= _SECTIONS_SINCE and head.encoding == _LOSSY else _VARINT
    if field.resolution is not None and head.encoding == _LOSSY:
        return _VARINT
    if field.kind == "f4":
        return _XOR if head.encoding == _LOSSLESS else _COPY
    return _GORILLA if head.version >= _GORILLA_SINCE and field.resolution is None else _XOR


def _points(chunk: bytes, count: int, head: _Head) -> NDArray[np.floating[Any]]:
    """(count, 3) x, y and z of a chunk."""
    ways = [(field, way) for field in head.fields if (way := _way(field, head)) is not None]
    kinds = {way for _, way in ways}
    if kinds <= {_COPY, _XOR}:
        raw = _of_fixed(chunk, count, [field for field, _ in ways])
    elif kinds == {_VARINT}:
        raw = dict(enumerate(_varints(np.frombuffer(chunk, np.uint8), count, len(ways)).T))
    else:
        if head.points > _MOST_WALKED:
            raise ValueError(f"{head.points} points whose fields differ in their bytes")
        raw = _walked(chunk, count, ways)
    places = {field.name: place for place, (field, _) in enumerate(ways)}
    return np.column_stack([_values(raw[places[axis]], *ways[places[axis]]) for axis in "xyz"])


def _of_fixed(chunk: bytes, count: int, fields: Sequence[_Field]) -> dict[int, NDArray[Any]]:
    """The bits of fields that take the same bytes in every point."""
    dtype = np.dtype([(f"{place}", f"<u{field.size}") for place, field in enumerate(fields)])
    points = np.frombuffer(chunk, dtype, count)
    return {place: points[f"{place}"] for place in range(len(fields))}


def _varints(data: NDArray[np.uint8], count: int, fields: int) -> NDArray[np.int64]:
    """(count, fields) signed numbers of seven bits a byte, the lowest first; _NAN stands for no number."""
    ends = np.flatnonzero(data < 0x80)[: count * fields]
    if len(ends) < count * fields:
        raise ValueError("it is cut")
    starts = np.concatenate([[0], ends[:-1] + 1])
    lengths = ends - starts + 1
    if lengths.max(initial=0) > _MOST_VARINT:
        raise ValueError("a number has too many bytes")
    of_byte = np.arange(ends[-1] + 1) - np.repeat(starts, lengths)
    parts = (data[: ends[-1] + 1] & 0x7F).astype(np.uint64) << (7 * of_byte).astype(np.uint64)
    return _signed(np.add.reduceat(parts, starts)).reshape(count, fields)


def _signed(numbers: NDArray[np.uint64]) -> NDArray[np.int64]:
    unit = np.uint64(1)
    zigzag = numbers - unit
    signed = (zigzag >> unit).view(np.int64) ^ -(zigzag & unit).view(np.int64)
    return np.where(numbers == 0, _NAN, signed)


def _walked(data: bytes, count: int, ways: Sequence[tuple[_Field, int]]) -> dict[int, NDArray[Any]]:
    """The same of fields of which some take as many bytes as they need, point by point."""
    kept = {place: np.zeros(count, np.uint64) for place, (field, _) in enumerate(ways) if field.name in {"x", "y", "z"}}
    bits = {place: _Bits() for place, (_, way) in enumerate(ways) if way == _GORILLA}
    steps = [(place, way, field.size, place in kept) for place, (field, way) in enumerate(ways)]
    at = 0
    for point in range(count):
        for place, way, size, keep in steps:
            if way == _VARINT:
                begins = at
                while data[at] >= 0x80:
                    at += 1
                at += 1
                if at - begins > _MOST_VARINT:
                    raise ValueError("a number has too many bytes")
                value = _number(data, begins, at) if keep else 0
            elif way == _GORILLA:
                value, at = bits[place].read(data, at)
            else:
                value, at = int.from_bytes(data[at : at + size], "little"), at + size
            if keep:
                kept[place][point] = value
    if at > len(data):
        raise ValueError("it is cut")
    return {place: _signed(raw) if ways[place][1] == _VARINT else raw for place, raw in kept.items()}


def _number(data: bytes, begins: int, ends: int) -> int:
    value = 0
    for place, byte in enumerate(data[begins:ends]):
        value |= (byte & 0x7F) << 7 * place
    return value & 0xFFFF_FFFF_FFFF_FFFF


class _Bits:
    """A float64 by the bits in which it differs from the one before; each value ends with a whole byte."""

    def __init__(self) -> None:
        self._before: int | None = None
        self._meaningful = 64
        self._trailing = 0

    def read(self, data: bytes, at: int) -> tuple[int, int]:
        """The bits of the next value, and where it ends."""
        if at >= len(data):
            raise ValueError("it is cut")
        if self._before is None:
            self._before = int.from_bytes(data[at : at + 8], "little")
            return self._before, at + 8
        bits = int.from_bytes(data[at : at + 10], "little")
        if not bits & 1:
            return self._before, at + 1
        used = 2
        if bits & 2:
            leading, self._meaningful = bits >> 2 & 31, (bits >> 7 & 63) + 1
            self._trailing = max(64 - leading - self._meaningful, 0)
            used += 11
        changed = (bits >> used & (1 << self._meaningful) - 1) << self._trailing
        self._before ^= changed & 0xFFFF_FFFF_FFFF_FFFF
        return self._before, at + (used + self._meaningful + 7) // 8


def _values(raw: NDArray[Any], field: _Field, way: int) -> NDArray[np.floating[Any]]:
    """The values of a field that is a float."""
    if way != _VARINT:
        bits = np.ascontiguousarray(raw).astype(f"u{field.size}")
        values: NDArray[np.floating[Any]] = (np.bitwise_xor.accumulate(bits) if way == _XOR else bits).view(field.kind)
        return values
    missing = raw == _NAN
    sums = np.cumsum(np.where(missing, 0, raw))
    # Behind a point without a number differences begin anew.
    last = np.maximum.accumulate(np.where(missing, np.arange(len(raw)), -1))
    sums = np.where(last >= 0, sums - sums[last], sums)
    scaled: NDArray[np.floating[Any]] = sums.astype(field.kind) * np.dtype(field.kind).type(field.resolution)
    scaled[missing] = np.nan
    return scaled
