"""The size and the values of picture files, by their headers, before they are decoded; and whether they are whole.

Formats: PNG (ISO/IEC 15948), sections 5 and 11; JPEG (ITU-T T.81), annex B; WebP (RFC 9649); Windows BMP; TIFF 6.0,
sections 2 and 15; JPEG 2000 (ITU-T T.800), annexes A and I; AVIF: ISO/IEC 23008-12 (HEIF), 14496-12 (boxes, iloc), and
AV1 Image File Format, 2. An AVIF's size stands in `ispe`; the sizes that its AV1 data declare, for which decoders
allocate, must not exceed it.
"""

import re
import struct
import zlib
from collections.abc import Callable, Iterator
from typing import NamedTuple

from auditor.errors import DecodingError
from auditor.model.rig import MOST_BITS
from auditor.recordings.decoding.interface import SizePx
from auditor.recordings.decoding.videos.av1 import Av1
from auditor.safety.budget import MAX_PIXELS, MAX_WAVELET_PIXELS

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


PNG_MAGIC = b"\x89PNG\r\n\x1a\n"
JPEG_MAGIC = b"\xff\xd8"
_JP2_MAGIC = b"\x00\x00\x00\x0cjP  \r\n\x87\n"
_CODESTREAM_MAGIC = b"\xff\x4f\xff\x51"
_AVIF_MAGICS = tuple(b"\0\0\0" + bytes([size]) + b"ftypavif" for size in range(16, 68, 4))

_PNG_GREY = {0, 4}
_JPEG_SIZE = struct.Struct(">BHHB")
_JPEG_NO_SIZE = {0xC4, 0xC8, 0xCC}
_JPEG_WITHOUT_LENGTH = {0x01, 0xFF, *range(0xD0, 0xD8)}  # 0xFF fills
_JPEG_END_SEARCH_BYTES = 1024
_JPEG_SCAN = 0xDA
_END = b"\xff\xd9"
"""The end of a JPEG, and of the codestream of a JPEG 2000."""

_JPEG_NEXT_MARKER = re.compile(rb"\xff[^\x00\xd0-\xd7\xff]")
"""What ends the image data of a scan: any marker but the restarts within it."""

_BMP = struct.Struct("<I4xIIiiHHI")
_WEBP_ANIMATED = 2
_TIFF_MOST_FIELDS = 200
_TIFF_MOST_STRIPS = 100_000
_CODESTREAM_SIZE = struct.Struct(">4x2xIIII16xHB")


class PictureHead(NamedTuple):
    """Size and colour as the header of a picture file declares them; `deep` are values of 16 bits."""

    form: str
    size_px: SizePx
    grey: bool
    deep: bool = False
    most_pixels: int = MAX_PIXELS


def inspect_picture(data: memoryview) -> PictureHead:
    """Read size and colour from the header of a picture file. Raises DecodingError."""
    for magics, _, inspect, _ in _FORMS:
        if bytes(data[: len(magics[0])]) in magics:
            return _checked(inspect, data)
    other = next((name for place, mark, name in _OTHERS if data[place : place + len(mark)] == mark), "")
    formats = "neither PNG nor JPEG, WebP, BMP, TIFF, JPEG 2000 or AVIF"
    raise DecodingError(f"the compressed image is {other}, which is not read" if other else f"the image is {formats}")


def is_picture(data: memoryview) -> bool:
    """True for a file of a form that is read, by its first bytes."""
    return any(bytes(data[: len(magics[0])]) in magics for magics, *_ in _FORMS)


def check_whole(data: memoryview, form: str) -> None:
    """Raises DecodingError where a file of a form is cut, or damaged as far as it says so itself."""
    for _, name, _, check in _FORMS:
        if name == form:
            try:
                check(data)
            except (struct.error, IndexError) as error:
                raise DecodingError(f"the {form} is cut") from error


def _checked(inspect: Callable[[memoryview], PictureHead], data: memoryview) -> PictureHead:
    try:
        return inspect(data)
    except (struct.error, IndexError) as error:
        raise DecodingError("the image is cut in its header") from error


def _inspect_png(data: memoryview) -> PictureHead:
    if len(data) < 33 or bytes(data[12:16]) != b"IHDR":
        raise DecodingError("the PNG is cut in its header")
    width, height, bits, colour_type = struct.unpack_from(">IIBB", data, 16)
    return PictureHead("png", (width, height), grey=colour_type in _PNG_GREY, deep=bits == MOST_BITS)


def _check_png(data: memoryview) -> None:
    position, kind = len(PNG_MAGIC), b""
    while kind != b"IEND":
        if position + 12 > len(data):
            raise DecodingError("the PNG is cut")
        (length,) = struct.unpack_from(">I", data, position)
        kind = bytes(data[position + 4 : position + 8])
        end = position + 8 + length
        if end + 4 > len(data):
            raise DecodingError("the PNG is cut")
        # Decoders ignore a wrong checksum, and a flipped bit would look like an attack.
        if zlib.crc32(data[position + 4 : end]) != int.from_bytes(data[end : end + 4], "big"):
            raise DecodingError(f"the checksum of the PNG's {kind.decode('latin-1')!r} part is wrong")
        position = end + 4


def _inspect_jpeg(data: memoryview) -> PictureHead:
    for marker, position, _ in _jpeg_segments(data):
        if 0xC0 <= marker <= 0xCF and marker not in _JPEG_NO_SIZE:
            if position + 4 + _JPEG_SIZE.size > len(data):
                break
            _, height, width, components = _JPEG_SIZE.unpack_from(data, position + 4)
            return PictureHead("jpeg", (width, height), grey=components == 1)
    raise DecodingError("the JPEG is cut or damaged in its header")


def _check_jpeg(data: memoryview) -> None:
    """Inside the image data 0xFF is always followed by 0: the pair of the end can only be the end.

    It may lie before the end of the message: drivers send whole buffers, filled with anything.
    """
    if data[-_JPEG_END_SEARCH_BYTES:].tobytes().rfind(_END) >= 0:
        return
    for marker, position, length in _jpeg_segments(data):
        next_marker = _JPEG_NEXT_MARKER.search(data, position + 2 + length) if marker == _JPEG_SCAN else None
        if next_marker and next_marker.group() == _END:
            return
    raise DecodingError("the JPEG is cut: it has no end")


def _jpeg_segments(data: memoryview) -> Iterator[tuple[int, int, int]]:
    """The marker of each segment, where it begins, and its length without the marker."""
    position = 2
    while position + 4 <= len(data) and data[position] == 0xFF:
        marker = data[position + 1]
        if marker in _JPEG_WITHOUT_LENGTH:
            position += 1 if marker == 0xFF else 2
            continue
        length = int.from_bytes(data[position + 2 : position + 4], "big")
        yield marker, position, length
        if length < 2:
            return
        position += 2 + length
        if marker == _JPEG_SCAN:
            next_marker = _JPEG_NEXT_MARKER.search(data, position)
            position = next_marker.start() if next_marker else len(data)


def _inspect_webp(data: memoryview) -> PictureHead:
    kind = bytes(data[12:16])
    if kind == b"VP8 " and bytes(data[23:26]) == b"\x9d\x01\x2a":
        width, height = struct.unpack_from("<HH", data, 26)
        return PictureHead("webp", (width & 0x3FFF, height & 0x3FFF), grey=False)
    if kind == b"VP8L" and data[20] == 0x2F:
        (packed,) = struct.unpack_from("<I", data, 21)
        return PictureHead("webp", ((packed & 0x3FFF) + 1, (packed >> 14 & 0x3FFF) + 1), grey=False)
    if kind == b"VP8X" and bytes(data[8:12]) == b"WEBP":
        if data[20] & _WEBP_ANIMATED:
            raise DecodingError("the WebP has several pictures")
        width, height = (int.from_bytes(data[place : place + 3], "little") + 1 for place in (24, 27))
        return PictureHead("webp", (width, height), grey=False)
    raise DecodingError("the WebP is cut or damaged in its header")


def _check_webp(data: memoryview) -> None:
    if len(data) < 8 + int.from_bytes(data[4:8], "little"):
        raise DecodingError("the WebP is cut")


def _inspect_bmp(data: memoryview) -> PictureHead:
    _, _, header, width, height, _, bits, compression = _BMP.unpack_from(data, 2)
    if header < 40 or bits not in {8, 24, 32} or compression not in {0, 3}:
        raise DecodingError("the BMP is not of 8, 24 or 32 bits without compression")
    return PictureHead("bmp", (width, abs(height)), grey=bits == 8)


def _check_bmp(data: memoryview) -> None:
    _, start, _, width, height, _, bits, _ = _BMP.unpack_from(data, 2)
    if len(data) < start + (bits * width + 31) // 32 * 4 * abs(height):
        raise DecodingError("the BMP is cut")


def _inspect_tiff(data: memoryview) -> PictureHead:
    fields = _tiff_fields(data)
    width, height, samples = (fields.get(tag, [absent])[0] for tag, absent in ((256, 0), (257, 0), (277, 1)))
    bits = set(fields.get(258, [1]))
    if bits not in ({8}, {MOST_BITS}) or samples not in {1, 3, 4}:
        raise DecodingError("the TIFF is not of one, three or four values of 8 or 16 bits")
    return PictureHead("tiff", (width, height), grey=samples == 1, deep=bits == {MOST_BITS})


def _check_tiff(data: memoryview) -> None:
    fields = _tiff_fields(data)
    starts, counts = fields.get(273) or fields.get(324) or [], fields.get(279) or fields.get(325) or []
    if not starts or len(starts) != len(counts):
        raise DecodingError("the TIFF does not say where its pixels are")
    if max(start + count for start, count in zip(starts, counts, strict=True)) > len(data):
        raise DecodingError("the TIFF is cut")


def _tiff_fields(data: memoryview) -> dict[int, list[int]]:
    """The fields of the first picture that are whole numbers of 16 or 32 bits, by their tags."""
    order = "<" if bytes(data[:2]) == b"II" else ">"
    (start,) = struct.unpack_from(f"{order}I", data, 4)
    (entries,) = struct.unpack_from(f"{order}H", data, start)
    fields: dict[int, list[int]] = {}
    for place in range(min(entries, _TIFF_MOST_FIELDS)):
        at = start + 2 + 12 * place
        tag, kind, count = struct.unpack_from(f"{order}HHI", data, at)
        letter = {3: "H", 4: "I"}.get(kind)
        if letter is None or not 0 < count <= _TIFF_MOST_STRIPS:
            continue
        layout = struct.Struct(f"{order}{count}{letter}")
        where = at + 8 if layout.size <= 4 else struct.unpack_from(f"{order}I", data, at + 8)[0]
        fields[tag] = list(layout.unpack_from(data, where))
    return fields


def _inspect_jpeg_2000(data: memoryview) -> PictureHead:
    start = 0 if data[:4] == _CODESTREAM_MAGIC else bytes(data[:_JPEG_END_SEARCH_BYTES]).find(_CODESTREAM_MAGIC)
    if start < 0:
        raise DecodingError("the JPEG 2000 is damaged in its header")
    right, below, left, top, components, precision = _CODESTREAM_SIZE.unpack_from(data, start + 2)
    bits = (precision & 0x7F) + 1
    if components not in {1, 3, 4} or precision & 0x80 or bits > MOST_BITS:
        raise DecodingError("the JPEG 2000 is not of one, three or four values of up to 16 bits")
    size_px = (right - left, below - top)
    return PictureHead("jp2", size_px, grey=components == 1, deep=bits > 8, most_pixels=MAX_WAVELET_PIXELS)


def _check_jpeg_2000(data: memoryview) -> None:
    if data[-_JPEG_END_SEARCH_BYTES:].tobytes().rfind(_END) < 0:
        raise DecodingError("the JPEG 2000 is cut: it has no end")


def _inspect_avif(data: memoryview) -> PictureHead:
    return PictureHead("avif", *avif_head(data))


_Form = tuple[tuple[bytes, ...], str, Callable[[memoryview], PictureHead], Callable[[memoryview], None]]

_FORMS: tuple[_Form, ...] = (
    ((PNG_MAGIC,), "png", _inspect_png, _check_png),
    ((JPEG_MAGIC,), "jpeg", _inspect_jpeg, _check_jpeg),
    ((b"RIFF",), "webp", _inspect_webp, _check_webp),
    ((b"BM",), "bmp", _inspect_bmp, _check_bmp),
    ((b"II*\0", b"MM\0*"), "tiff", _inspect_tiff, _check_tiff),
    ((_JP2_MAGIC,), "jp2", _inspect_jpeg_2000, _check_jpeg_2000),
    ((_CODESTREAM_MAGIC,), "jp2", _inspect_jpeg_2000, _check_jpeg_2000),
    (_AVIF_MAGICS, "avif", _inspect_avif, check_avif),
)
"""The forms that are read: how a file begins, its name, and what reads its header and says whether it is whole."""

_OTHERS = (
    (4, b"ftypavis", "an AVIF of several pictures"),
    (4, b"ftypmif1", "AVIF or HEIF"),
    (4, b"ftyphei", "HEIF"),
    (0, b"\xff\x0a", "JPEG XL"),
    (0, b"\x00\x00\x00\x0cJXL ", "JPEG XL"),
    (0, b"GIF8", "GIF"),
)
"""Forms that are told by name: at which byte what stands, and what it says."""
