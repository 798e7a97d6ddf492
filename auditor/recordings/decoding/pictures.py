"""Picture files: their headers are read before they are decoded, and they are checked for completeness.

Of values of more than 8 bits 8 are kept. A camera of 12 bits writes values of 0 to 4095 into 16 bits, or these times
16; no message says which. The depth is learnt once a topic, from its first pictures, and then holds for all: a scale of
each picture's own would hide an attack.
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.errors import DecodingError
from auditor.model.rig import MOST_BITS, PIXEL_BITS
from auditor.recordings.decoding.interface import SizePx
from auditor.recordings.decoding.picture_heads import PictureHead, check_whole, inspect_picture
from auditor.recordings.parameters import ODD_PICTURES
from auditor.safety.budget import MAX_PIXELS

_ROWS_APART = 16  # rows from one that is looked at first to the next: it bounds the work
_BITS = (10, 12, 14, 16)  # of a value: those of sensors that are sold


cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # what it says of damaged files is said here

Values = NDArray[np.unsignedinteger[Any]]
"""(H, W) or (H, W, channels), of 8 bits or of 16 in the machine's byte order."""


def decode_picture(
    data: memoryview, *, colour: bool, size_px: SizePx | None, bits: int = MOST_BITS
) -> NDArray[np.uint8]:
    """Pixels of a whole picture file; `bits` are those of 16-bit values.

    Raises DecodingError where it is cut, damaged, or of another size.
    """
    picture = inspect_picture(data)
    check_size(picture.size_px, size_px, picture.most_pixels)
    # The grey of a PNG is computed as for all other lossless forms; a JPEG holds a grey image of its own.
    in_colour = not picture.grey and (colour or picture.form != "jpeg")
    pixels: cv2.typing.MatLike = upper_8_bits(_decode(data, picture, in_colour=in_colour), bits)
    if in_colour and not colour:
        pixels = cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY)
    return np.asarray(pixels, dtype=np.uint8)


def largest_picture_value(data: memoryview) -> int | None:
    """The largest value of a file of 16 bits a value; None of any other. Raises DecodingError as `decode_picture`."""
    picture = inspect_picture(data)
    if not picture.deep:
        return None
    check_size(picture.size_px, None, picture.most_pixels)
    return int(_decode(data, picture, in_colour=not picture.grey).max())


def _decode(data: memoryview, picture: PictureHead, *, in_colour: bool) -> Values:
    """All values, (H, W) or (H, W, 3) BGR."""
    check_whole(data, picture.form)
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


_SATURATED = 255


def depth_of(largest: int) -> int:
    """The bits of a camera of whose values this is the largest. Those at the upper end of 16 bits have 16."""
    return next((bits for bits in _BITS if largest < 1 << bits), MOST_BITS)


def upper_8_bits(values: Values, bits: int) -> NDArray[np.uint8]:
    """Of values of 16 bits the upper 8 of so many: the full scale becomes 255, and so does what lies above it."""
    shift = bits - PIXEL_BITS if values.dtype == np.uint16 else 0
    if not shift:
        return np.asarray(values, dtype=np.uint8)
    kept = np.empty(values.shape, np.uint8)
    for row, into in zip(values, kept, strict=True):  # whole pictures of 16 bits would take twice their memory
        np.minimum(row >> shift, 255, out=into, casting="unsafe")
    return kept


def check_received(pixels: NDArray[np.uint8]) -> None:
    """Raises DecodingError for a picture without any content, or whose last rows were filled in by a decoder.

    What a sensor gives has noise, or saturates. Drivers give zeros before the first exposure, and decoders one level
    where a picture was cut; black rows may be the bars of an encoder.
    """
    last = pixels[-1, 0]
    if not (pixels[-1] == last).all() or (last == _SATURATED).all():
        return
    filled = int(np.argmin((pixels == last).reshape(len(pixels), -1).all(axis=1)[::-1])) or len(pixels)
    if filled == len(pixels):
        raise DecodingError("it shows nothing: all of its pixels are the same")
    if last.any() and filled >= ODD_PICTURES.least_filled * len(pixels):
        raise DecodingError(f"its last {filled} rows were never received: all of their pixels are the same")


def grey_if_grey(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(H, W) of a picture (H, W, 3) that has no colour anywhere, as many grey cameras are recorded; else as it is."""
    if pixels.ndim == 2 or _coloured(pixels[::_ROWS_APART]) or _coloured(pixels):
        return pixels
    return np.asarray(cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY), dtype=np.uint8)


def _coloured(pixels: NDArray[np.uint8]) -> bool:
    blue, green, red = cv2.split(pixels)
    return any(_has_colour(one, green) for one in (blue, red))


def _has_colour(channel: cv2.typing.MatLike, green: cv2.typing.MatLike) -> bool:
    """Whether a channel differs from green by more than a tint that is the same all over.

    Where a level is clipped, so is its tint.
    """
    most = cv2.norm(green, channel, cv2.NORM_INF)
    if most <= ODD_PICTURES.most_apart or most > ODD_PICTURES.most_apart + ODD_PICTURES.most_tint:
        return most > ODD_PICTURES.most_apart
    difference = cv2.subtract(channel, green, dtype=cv2.CV_16S)
    apart = np.abs(difference - np.median(difference)) > ODD_PICTURES.most_apart
    return bool(apart[(green > ODD_PICTURES.most_tint) & (green < _SATURATED - ODD_PICTURES.most_tint)].any())


def roughness(values: Values, step: int) -> float:
    """How much values `step` apart in a row differ, of the deviation of all; NaN where all are the same."""
    values = values.astype(np.float32)
    deviation = float(values.std())
    if not deviation or values.shape[1] <= step:
        return float("nan")
    return float(np.abs(values[:, step:] - values[:, :-step]).mean()) / deviation


def encode_picture(pixels: NDArray[np.uint8], form: str) -> bytes:
    """A JPEG (quality 95), or for any other form a PNG (lossless), of (H, W) grey or (H, W, 3) BGR pixels."""
    if form != "jpeg":
        done, data = cv2.imencode(".png", pixels, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    else:
        done, data = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, 95])
    assert done
    return data.tobytes()


def check_size(size: SizePx, expected: SizePx | None, most_pixels: int = MAX_PIXELS) -> None:
    """Raises DecodingError where a declared size is absurd, or not the camera's."""
    if min(size) <= 0 or size[0] * size[1] > most_pixels:
        raise DecodingError(f"an image of {size[0]} x {size[1]} px is not accepted")
    if expected is not None and size != expected:
        raise DecodingError(f"the image has {size[0]} x {size[1]} px instead of {expected[0]} x {expected[1]}")
