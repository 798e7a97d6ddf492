"""PNG and JPEG files: their headers are read before they are decoded, and they are checked for completeness.

Formats: PNG specification (ISO/IEC 15948), sections 5 and 11; JPEG, ITU-T T.81, annex B.

Of values of more than 8 bits 8 are kept. A camera of 12 bits writes values of 0 to 4095 into 16 bits, or these times
16; no message says which. The depth is learnt once a topic, from its first pictures, and then holds for all: a scale of
each picture's own would hide an attack.
"""

import re
import struct
import zlib
from collections.abc import Iterator
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.errors import DecodingError
from auditor.model.rig import MOST_BITS, PIXEL_BITS
from auditor.recordings.decoding.interface import SizePx
from auditor.recordings.parameters import PICTURE_DEPTH
from auditor.safety.budget import MAX_PIXELS

PNG_MAGIC = b"\x89PNG\r\n\x1a\n"
JPEG_MAGIC = b"\xff\xd8"

_PNG_GREY = {0, 4}
_JPEG_SIZE = struct.Struct(">BHHB")
_JPEG_NO_SIZE = {0xC4, 0xC8, 0xCC}
_JPEG_WITHOUT_LENGTH = {0x01, 0xFF, *range(0xD0, 0xD8)}  # 0xFF fills
_JPEG_END_SEARCH_BYTES = 1024
_JPEG_SCAN = 0xDA
_JPEG_END = b"\xff\xd9"
_JPEG_NEXT_MARKER = re.compile(rb"\xff[^\x00\xd0-\xd7\xff]")
"""What ends the image data of a scan: any marker but the restarts within it."""

Values = NDArray[np.unsignedinteger[Any]]
"""(H, W) or (H, W, channels), of 8 bits or of 16 in the machine's byte order."""


class Picture(NamedTuple):
    """Size and colour as the header of a picture file declares them; `deep` are values of 16 bits."""

    form: str
    size_px: SizePx
    grey: bool
    deep: bool = False


def inspect_picture(data: memoryview) -> Picture:
    """Read size and colour from a PNG's or JPEG's header. Raises DecodingError."""
    if data[:8] == PNG_MAGIC:
        return _inspect_png(data)
    if data[:2] == JPEG_MAGIC:
        return _inspect_jpeg(data)
    raise DecodingError("the compressed image is neither PNG nor JPEG")


def decode_picture(
    data: memoryview, *, colour: bool, size_px: SizePx | None, bits: int = MOST_BITS
) -> NDArray[np.uint8]:
    """Pixels of a whole PNG or JPEG file; `bits` are those of 16-bit values.

    Raises DecodingError where it is cut, damaged, or of another size.
    """
    picture = inspect_picture(data)
    check_size(picture.size_px, size_px)
    # The grey of a PNG is computed as for all other lossless forms; a JPEG holds a grey image of its own.
    in_colour = not picture.grey and (colour or picture.form == "png")
    pixels: cv2.typing.MatLike = upper_8_bits(_decode(data, picture, in_colour=in_colour), bits)
    if in_colour and not colour:
        pixels = cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY)
    return np.asarray(pixels, dtype=np.uint8)


def largest_picture_value(data: memoryview) -> int | None:
    """The largest value of a PNG of 16 bits; None of any other file. Raises DecodingError as `decode_picture`."""
    picture = inspect_picture(data)
    if not picture.deep:
        return None
    check_size(picture.size_px, None)
    return int(_decode(data, picture, in_colour=not picture.grey).max())


def _decode(data: memoryview, picture: Picture, *, in_colour: bool) -> Values:
    """All values, (H, W) or (H, W, 3) BGR."""
    if picture.form == "png":
        _check_png_chunks(data)
    elif data[-_JPEG_END_SEARCH_BYTES:].tobytes().rfind(_JPEG_END) < 0 and not _ends_within(data):
        # Inside the image data 0xFF is always followed by 0: this pair can only be the end.
        raise DecodingError("the JPEG is cut: it has no end")
    flag = cv2.IMREAD_COLOR if in_colour else cv2.IMREAD_GRAYSCALE
    depth = cv2.IMREAD_ANYDEPTH if picture.deep else 0
    try:
        # A rotation by the camera's orientation mark would not agree with its projection matrix.
        values = cv2.imdecode(np.frombuffer(data, np.uint8), flag | depth | cv2.IMREAD_IGNORE_ORIENTATION)
    except cv2.error as error:
        raise DecodingError(f"the image cannot be decoded ({error.err})") from error
    if values is None or values.shape[1::-1] != picture.size_px:
        raise DecodingError("the image cannot be decoded whole")
    return np.asarray(values, dtype=np.uint16 if picture.deep else np.uint8)


def depth_of(largest: int) -> int:
    """The bits of a camera of whose values this is the largest. Those at the upper end of 16 bits have 16."""
    return next((bits for bits in PICTURE_DEPTH.bits if largest < 1 << bits), MOST_BITS)


def upper_8_bits(values: Values, bits: int) -> NDArray[np.uint8]:
    """Of values of 16 bits the upper 8 of so many: the full scale becomes 255, and so does what lies above it."""
    shift = bits - PIXEL_BITS if values.dtype == np.uint16 else 0
    if not shift:
        return np.asarray(values, dtype=np.uint8)
    kept = np.empty(values.shape, np.uint8)
    for row, into in zip(values, kept, strict=True):  # whole pictures of 16 bits would take twice their memory
        np.minimum(row >> shift, 255, out=into, casting="unsafe")
    return kept


def encode_picture(pixels: NDArray[np.uint8], form: str) -> bytes:
    """A PNG (lossless) or JPEG (quality 95) file of (H, W) grey or (H, W, 3) BGR pixels."""
    if form == "png":
        done, data = cv2.imencode(".png", pixels, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    else:
        done, data = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, 95])
    assert done
    return data.tobytes()


def check_size(found: SizePx, expected: SizePx | None) -> None:
    """Raises DecodingError where a declared size is absurd, or not the camera's."""
    if not 0 < found[0] * found[1] <= MAX_PIXELS:
        raise DecodingError(f"an image of {found[0]} x {found[1]} px is not accepted")
    if expected is not None and found != expected:
        raise DecodingError(f"the image has {found[0]} x {found[1]} px instead of {expected[0]} x {expected[1]}")


def _inspect_png(data: memoryview) -> Picture:
    if len(data) < 33 or bytes(data[12:16]) != b"IHDR":
        raise DecodingError("the PNG is cut in its header")
    width, height, bits, colour_type = struct.unpack_from(">IIBB", data, 16)
    return Picture("png", (width, height), grey=colour_type in _PNG_GREY, deep=bits == MOST_BITS)


def _check_png_chunks(data: memoryview) -> None:
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


def _ends_within(data: memoryview) -> bool:
    """Whether a JPEG ends somewhere before the end of the message: drivers send whole buffers, filled with anything."""
    for marker, position, length in _jpeg_segments(data):
        if marker != _JPEG_SCAN:
            continue
        found = _JPEG_NEXT_MARKER.search(data, position + 2 + length)
        if found and found.group() == _JPEG_END:
            return True
    return False


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
            found = _JPEG_NEXT_MARKER.search(data, position)
            position = found.start() if found else len(data)


def _inspect_jpeg(data: memoryview) -> Picture:
    for marker, position, _ in _jpeg_segments(data):
        if 0xC0 <= marker <= 0xCF and marker not in _JPEG_NO_SIZE:
            if position + 4 + _JPEG_SIZE.size > len(data):
                break
            _, height, width, components = _JPEG_SIZE.unpack_from(data, position + 4)
            return Picture("jpeg", (width, height), grey=components == 1)
    raise DecodingError("the JPEG is cut or damaged in its header")
