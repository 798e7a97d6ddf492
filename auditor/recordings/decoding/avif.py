"""The head of an AVIF file. Format: ISO/IEC 23008-12 (HEIF), 14496-12 (boxes, iloc), and AV1 Image File Format, 2.

The size stands in `ispe`. The sizes that the AV1 data declare themselves, for which decoders allocate, must not exceed
it.
"""

import struct
from collections.abc import Iterator

from auditor.errors import DecodingError
from auditor.recordings.decoding.interface import SizePx
from auditor.recordings.decoding.videos.av1 import Av1

_CONTAINERS = {b"iprp": 0, b"ipco": 0, b"meta": 4}
"""Boxes that hold boxes, behind so many bytes."""

_MOST_BOXES = 200
_HIGH_DEPTH, _NO_COLOUR = 0x40, 0x10
_NOT_AV1 = (0x00, 0x3C)
"""How Exif and XMP begin, in which a decoder of AV1 finds no picture."""

AvifHead = tuple[SizePx, bool, bool]
"""The size, and whether it is grey, and deep."""


def avif_head(data: memoryview) -> AvifHead:
    """Raises DecodingError, struct.error or IndexError for what is cut or is no single picture."""
    boxes = list(_boxes(data, 0, len(data)))
    sizes = [struct.unpack_from(">II", data, start + 4) for kind, start, _ in boxes if kind == b"ispe"]
    codecs = [data[start + 2] for kind, start, _ in boxes if kind == b"av1C"]
    if not sizes or not codecs:
        raise DecodingError("the AVIF does not say its size")
    width, height = max(sizes, key=lambda size: size[0] * size[1])
    grey = all(codec & _NO_COLOUR for codec in codecs)
    return (width, height), grey, any(codec & _HIGH_DEPTH for codec in codecs)


def check_avif(data: memoryview) -> None:
    """Raises as `avif_head` where the file is cut, or its data declare more pixels than the file does."""
    (width, height), *_ = avif_head(data)
    tables = [start for kind, start, _ in _boxes(data, 0, len(data)) if kind == b"iloc"]
    if len(tables) != 1:
        raise DecodingError("the AVIF does not say where its pixels are")
    for start, length in _extents(data, tables[0]):
        if start + length > len(data):
            raise DecodingError("the AVIF is cut")
        item = bytes(data[start : start + length])
        if item and item[0] not in _NOT_AV1:
            for across, down in Av1().head(item).sizes_px:
                if across * down > width * height:
                    raise DecodingError("the AVIF holds more pixels than it declares")


def _boxes(data: memoryview, position: int, end: int) -> Iterator[tuple[bytes, int, int]]:
    """The kind of each box, and where what is in it begins and ends. Raises DecodingError where one is cut."""
    count = 0
    while position < end and count < _MOST_BOXES:
        count += 1
        size, kind = struct.unpack_from(">I4s", data, position)
        start = position + 8
        if size == 1:
            size, start = struct.unpack_from(">Q", data, start)[0], start + 8
        stop = end if size == 0 else position + size
        if stop > end or stop < start:
            raise DecodingError("the AVIF is cut")
        yield kind, start, stop
        if kind in _CONTAINERS:
            yield from _boxes(data, start + _CONTAINERS[kind], stop)
        position = stop


def _extents(data: memoryview, start: int) -> Iterator[tuple[int, int]]:
    """Where the data of each item begin, and their length. Raises DecodingError for items in several pieces."""
    version, sizes, more = data[start], data[start + 4], data[start + 5]
    offset_size, length_size, base_size, index_size = sizes >> 4, sizes & 15, more >> 4, more & 15 if version else 0
    position, wide = start + 6, 4 if version == 2 else 2

    def take(size: int) -> int:
        nonlocal position
        if position + size > len(data):
            raise DecodingError("the AVIF is cut")
        position += size
        return int.from_bytes(data[position - size : position], "big")

    for _ in range(min(take(wide), _MOST_BOXES)):
        take(wide)
        method = take(2) if version else 0
        take(2)
        base, extents = take(base_size), take(2)
        if method or extents != 1:
            raise DecodingError("the AVIF has its pixels in several pieces")
        take(index_size)
        yield base + take(offset_size), take(length_size)
