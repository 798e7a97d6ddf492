"""sensor_msgs/Image and sensor_msgs/CompressedImage."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any, ClassVar, Literal, NamedTuple

import cv2
import numpy as np

from auditor.errors import DecodingError
from auditor.model.arrays import Image
from auditor.model.frames import Message
from auditor.model.rig import MOST_BITS
from auditor.recordings.decoding.interface import Header, SizePx
from auditor.recordings.decoding.picture_heads import inspect_picture, is_picture
from auditor.recordings.decoding.pictures import (
    Values,
    check_size,
    decode_picture,
    largest_picture_value,
    roughness,
    upper_8_bits,
)
from auditor.recordings.decoding.ros import RosTypes, read_header
from auditor.recordings.decoding.videos.tracks import VideoData, Videos, form_of
from auditor.recordings.parameters import PICTURE_ORDER

_ROWS_APART = 8  # rows from one that is looked at to the next: it bounds the work

_PASSTHROUGH = {1: "mono8", 3: "bgr8", 4: "bgra8"}
"""Encodings, by bytes a pixel, of images without one: OpenCV's order, which cv_bridge passes through."""

_OTHER_ORDER = "its bytes do not lie as declared: in the other order of each two they give a far smoother picture"

DEPTH_PICTURE = "compressedDepth"
"""In the format of a compressed image: depths, by the transport of that name."""


class Encoding(NamedTuple):
    """How the pixels of a raw image lie in memory.

    `to_grey` and `to_bgr` name OpenCV's colour conversions, None for no conversion. `planar` images have their chroma
    rows below the picture (height * 3 / 2 rows).
    """

    channels: int
    to_grey: str | None
    to_bgr: str | None
    bytes_a_value: int = 1
    planar: bool = False


def _bayer(order: str, bytes_a_value: int = 1) -> Encoding:
    # ROS names the order by the image's first four pixels, as the later OpenCV names do.
    return Encoding(1, f"COLOR_Bayer{order}2GRAY", f"COLOR_Bayer{order}2BGR", bytes_a_value)


_GREY = Encoding(1, None, None)
_GREY_16 = Encoding(1, None, None, bytes_a_value=2)
_UYVY = Encoding(2, "COLOR_YUV2GRAY_UYVY", "COLOR_YUV2BGR_UYVY")
_YUYV = Encoding(2, "COLOR_YUV2GRAY_YUY2", "COLOR_YUV2BGR_YUY2")
_I420 = Encoding(1, "COLOR_YUV2GRAY_I420", "COLOR_YUV2BGR_I420", planar=True)


_SWAPPED_BYTES = {_UYVY: _YUYV, _YUYV: _UYVY}


def _colours(order: str, bytes_a_value: int = 1) -> Encoding:
    to_bgr = None if order == "BGR" else f"COLOR_{order}2BGR"
    return Encoding(len(order), f"COLOR_{order}2GRAY", to_bgr, bytes_a_value)


def _mosaics() -> Iterator[tuple[str, Encoding]]:
    """Mosaics by their names in ROS, in GenICam, which names the first two pixels alone, and in V4L2."""
    for order in ("RGGB", "BGGR", "GBRG", "GRBG"):
        for name in (f"bayer{order}", f"bayer{order[:2]}", f"s{order}"):
            yield f"{name}8".lower(), _bayer(order)
            yield from ((f"{name}{bits}".lower(), _bayer(order, 2)) for bits in (10, 12, 14, 16))


ENCODINGS: Mapping[str, Encoding] = {
    **dict.fromkeys(("mono8", "8uc1", "gray8", "grey8", "gray", "grey", "y8", "y800"), _GREY),
    **dict.fromkeys(
        ("mono10", "mono12", "mono14", "mono16", "16uc1", "gray16", "grey16", "y10", "y12", "y16"), _GREY_16
    ),
    **dict.fromkeys(("bgr8", "8uc3", "bgr24", "bgr8packed"), _colours("BGR")),
    **dict.fromkeys(("rgb8", "rgb24", "rgb8packed"), _colours("RGB")),
    **dict.fromkeys(("bgra8", "8uc4", "bgra8packed"), _colours("BGRA")),
    **dict.fromkeys(("rgba8", "rgba8packed"), _colours("RGBA")),
    **dict.fromkeys(("bgr10", "bgr12", "bgr16", "16uc3"), _colours("BGR", 2)),
    **dict.fromkeys(("rgb10", "rgb12", "rgb16"), _colours("RGB", 2)),
    **dict.fromkeys(("bgra16", "16uc4"), _colours("BGRA", 2)),
    "rgba16": _colours("RGBA", 2),
    **dict(_mosaics()),
    **dict.fromkeys(("yuv422", "uyvy", "yuv422packed", "yuv4228uyvy", "ycbcr4228cbycry"), _UYVY),
    **dict.fromkeys(("yuv422yuy2", "yuyv", "yuy2", "yuv4228", "ycbcr4228"), _YUYV),
    "yvyu": Encoding(2, "COLOR_YUV2GRAY_YVYU", "COLOR_YUV2BGR_YVYU"),
    "nv12": Encoding(1, "COLOR_YUV2GRAY_NV12", "COLOR_YUV2BGR_NV12", planar=True),
    "nv21": Encoding(1, "COLOR_YUV2GRAY_NV21", "COLOR_YUV2BGR_NV21", planar=True),
    **dict.fromkeys(("i420", "iyuv", "yu12"), _I420),
    "yv12": Encoding(1, "COLOR_YUV2GRAY_YV12", "COLOR_YUV2BGR_YV12", planar=True),
}
"""Encodings by their names in small letters without underscores; of 16-bit values see `pictures`.

The names are those of sensor_msgs/image_encodings.hpp, of GenICam's pixel formats (PFNC; values that are not packed),
which drivers of its cameras pass on, and of V4L2 and OpenCV.
"""


class _Depths:
    """Of what depth the values of a topic's pictures are where they have more than 8 bits; 16 bits until it is told."""

    kind: ClassVar[Literal["image"]] = "image"

    def __init__(self) -> None:
        self._bits: dict[str, int] = {}
        self.repairs: dict[str, None] = {}

    def use_depth(self, topic: str, bits: int) -> None:
        """Take the values of a topic's pictures as of so many bits, from here on."""
        self._bits[topic] = bits

    def bits(self, message: Message) -> int:
        """The bits of the values of a message's topic."""
        return self._bits.get(message.topic, MOST_BITS)


class RawDecoder(_Depths, ABC):
    """Decodes images that lie in a message value by value. See interface.ImageDecoder and DeepImageDecoder."""

    @abstractmethod
    def image(self, message: Message) -> Any:  # noqa: ANN401  # a class that rosbags generates, or one like it
        """The image as an object with the fields of sensor_msgs/Image. Raises DecodingError."""

    def size_px(self, message: Message) -> SizePx:
        """The declared width and height."""
        image = self.image(message)
        return image.width, image.height

    def pixels(self, message: Message, *, colour: bool, size_px: SizePx | None = None) -> Image:
        """The pixels, a view of the message where nothing had to be converted."""
        image = self.image(message)
        check_size((image.width, image.height), size_px)
        rows, encoding = self._values(image, message.topic)
        return _convert(upper_8_bits(rows, self.bits(message)), encoding, colour=colour)

    def largest_value(self, message: Message) -> int | None:
        """The largest value of 16 bits; None where there are 8."""
        image = self.image(message)
        check_size((image.width, image.height), None)
        if _encoding_of(image, message.topic).bytes_a_value == 1:
            return None
        return int(self._values(image, message.topic)[0].max())

    def _values(self, image: Any, topic: str) -> tuple[Values, Encoding]:  # noqa: ANN401
        """The values of a picture, and how they lie: in the other order of bytes where only so they are a picture."""
        encoding = _encoding_of(image, topic)
        step, repair = _step_of(image, encoding)
        rows = _rows(image, encoding, step)
        repairs = [repair] if repair else []
        swapped = f"{topic}: {_OTHER_ORDER}"
        if swapped in self.repairs or _is_swapped(rows, encoding):
            repairs.append(_OTHER_ORDER)
            rows, encoding = (
                (rows.byteswap(), encoding) if encoding.bytes_a_value > 1 else (rows, _SWAPPED_BYTES[encoding])
            )
        self.repairs.update(dict.fromkeys(f"{topic}: {one}" for one in repairs))
        return rows, encoding


class PictureDecoder(_Depths, ABC):
    """Decodes images that are files, PNG and JPEG mostly. See interface.ImageDecoder and DeepImageDecoder."""

    @abstractmethod
    def picture(self, message: Message) -> memoryview:
        """The file inside the message. Raises DecodingError."""

    def size_px(self, message: Message) -> SizePx:
        """The size that the file's header declares."""
        return inspect_picture(self.picture(message)).size_px

    def pixels(self, message: Message, *, colour: bool, size_px: SizePx | None = None) -> Image:
        """The pixels of the whole file."""
        return decode_picture(self.picture(message), colour=colour, size_px=size_px, bits=self.bits(message))

    def largest_value(self, message: Message) -> int | None:
        """The largest value of a file of 16 bits a value; None of any other."""
        return largest_picture_value(self.picture(message))


_AS_CAPTURED = "passthrough"
_NO_PIXELS = {
    b"\0\0\0\1": "a video, H.264 or H.265",
    b"\0\0\1": "a video, H.264 or H.265",
    b"\xff\xd8\xff": "a JPEG",
    b"\x89PNG": "a PNG",
}
"""What drivers put into images of raw pixels, with no size or with an encoding of their own."""


class RawImageDecoder(RawDecoder):
    """sensor_msgs/Image."""

    def __init__(self, types: RosTypes) -> None:
        super().__init__()
        self._types = types

    def header(self, message: Message) -> Header:
        """The header, without decoding the rest."""
        return read_header(message)

    def image(self, message: Message) -> Any:  # noqa: ANN401  # the class is generated
        """The message, decoded. Raises DecodingError where it holds no pixels by its first bytes."""
        image = self._types.decode(message)
        readable = image.encoding == _AS_CAPTURED or _known_encoding(image.encoding) is not None
        if not (readable and image.width * image.height):
            begins = image.data[:4].tobytes()
            other = next((what for head, what in _NO_PIXELS.items() if begins.startswith(head)), None)
            if other is not None:
                raise DecodingError(
                    f"its data are no pixels but {other}: convert its messages to sensor_msgs/CompressedImage",
                    where=message.topic,
                )
        return image


def _known_encoding(name: str) -> Encoding | None:
    return ENCODINGS.get(name.lower().replace("_", "").removeprefix("cv"))


def _encoding_of(image: Any, topic: str) -> Encoding:  # noqa: ANN401  # the class is generated
    name = image.encoding
    if name == _AS_CAPTURED:
        name = _PASSTHROUGH.get(image.step // image.width, name)
    encoding = _known_encoding(name)
    if not name:
        raise DecodingError("the image does not say its encoding: its field is empty", where=topic)
    if encoding is None:
        raise DecodingError(f"the image encoding {image.encoding[:40]!r} is not supported", where=topic)
    return encoding


def _rows(image: Any, encoding: Encoding, step: int) -> Values:  # noqa: ANN401  # the class is generated
    """The values as (rows, width) or (rows, width, channels), uint8 or uint16; rows begin `step` bytes apart."""
    rows = _row_count(image, encoding)
    size = rows, _row_bytes(image, encoding)
    values = np.ascontiguousarray(np.ndarray(size, np.uint8, np.ascontiguousarray(image.data), strides=(step, 1)))
    shape = (rows, image.width, encoding.channels) if encoding.channels > 1 else (rows, image.width)
    if encoding.bytes_a_value > 1:
        values = values.view(">u2" if image.is_bigendian else "<u2").astype(np.uint16)
    result: Values = values.reshape(shape)
    return result


def _is_swapped(rows: Values, encoding: Encoding) -> bool:
    """Whether each two bytes are the other way round than declared: only so neighbours in a row are much alike."""
    few = rows[::_ROWS_APART]
    if encoding.bytes_a_value > 1:  # in a mosaic every second value has the same colour
        return roughness(few.byteswap(), 2) * PICTURE_ORDER.smoother < roughness(few, 2)
    if encoding in _SWAPPED_BYTES:
        grey = int(encoding == _UYVY)
        return roughness(few[..., 1 - grey], 1) * PICTURE_ORDER.smoother < roughness(few[..., grey], 1)
    return False


def _row_count(image: Any, encoding: Encoding) -> int:  # noqa: ANN401
    if encoding.planar and image.height % 2:
        raise DecodingError("a planar image needs an even height")
    return int(image.height * 3 // 2 if encoding.planar else image.height)


def _row_bytes(image: Any, encoding: Encoding) -> int:  # noqa: ANN401
    return int(image.width * encoding.channels * encoding.bytes_a_value)


def _step_of(image: Any, encoding: Encoding) -> tuple[int, str]:  # noqa: ANN401
    """How many bytes lie from row to row, and what of it had to be put right. Raises DecodingError.

    Drivers leave `step` at 0 or write that of other rows, and others send the whole of a larger buffer. Those that crop
    leave out what lies behind the last row. Rows are at most twice as long as their pixels, else the encoding may be
    wrong; whole rows too many may be a wrong height.
    """
    rows, row_bytes, held = _row_count(image, encoding), _row_bytes(image, encoding), len(image.data)
    if image.step >= row_bytes and held in {rows * image.step, (rows - 1) * image.step + row_bytes}:
        return image.step, ""
    filling = held // rows if rows and held % rows == 0 else 0
    readings = []
    if row_bytes <= filling < 2 * row_bytes:
        readings.append((filling, "its step does not fit the data: rows that fill them were taken"))
    surplus = held - rows * image.step
    if image.step >= row_bytes > 0 and surplus > 0 and surplus % image.step and filling < 2 * row_bytes:
        readings.append((image.step, "more data than its rows need: what lies behind them was left out"))
    if len(readings) != 1:
        raise DecodingError(
            f"the image declares {rows} rows of {image.step} bytes for {image.width} px, and holds {held} bytes"
        )
    return readings[0]


def _convert(values: Image, encoding: Encoding, *, colour: bool) -> Image:
    conversion = encoding.to_bgr if colour else encoding.to_grey
    if conversion is None:
        return values
    try:
        return np.asarray(cv2.cvtColor(values, getattr(cv2, conversion)), dtype=np.uint8)
    except cv2.error as error:
        raise DecodingError(f"the image cannot be converted ({error.err})") from error


class CompressedImageDecoder(PictureDecoder):
    """sensor_msgs/CompressedImage: a picture file or a video, by its first bytes.

    Where these do not tell the form of a video, its `format` does, which is free text. All messages of a topic have the
    form of its first one.
    """

    def __init__(self, types: RosTypes) -> None:
        super().__init__()
        self._types = types
        self._videos = Videos(self._video)
        self._is_video: dict[str, bool] = {}

    def header(self, message: Message) -> Header:
        """The header, without decoding the rest."""
        return read_header(message)

    def follow(self, message: Message) -> None:
        """Note a message, in the order of the recording."""
        with suppress(DecodingError):  # an unreadable message raises when its pixels are decoded
            if self._of_video(message):
                self._videos.follow(message)

    def size_px(self, message: Message) -> SizePx:
        """The size that the header of the compressed image declares."""
        return self._videos.size_px(message) if self._of_video(message) else super().size_px(message)

    def pixels(self, message: Message, *, colour: bool, size_px: SizePx | None = None) -> Image:
        """The pixels of the picture, or of the video at it."""
        if self._of_video(message):
            return self._videos.pixels(message, colour=colour, size_px=size_px)
        return super().pixels(message, colour=colour, size_px=size_px)

    def largest_value(self, message: Message) -> int | None:
        """The largest value of a file of 16 bits a value; None of anything else."""
        return None if self._of_video(message) else super().largest_value(message)

    def picture(self, message: Message) -> memoryview:
        """The file inside the message."""
        return self._declared(message)[1]

    def _video(self, message: Message) -> VideoData:
        declared, data = self._declared(message)
        return VideoData(declared, bytes(data), read_header(message).stamp_ns or message.log_time_ns)

    def _declared(self, message: Message) -> tuple[str, memoryview]:
        """The format of a message, and its data."""
        image = self._types.decode(message)
        if DEPTH_PICTURE in image.format:
            raise DecodingError(f"the format {image.format[:40]!r} is of depths", where=message.topic)
        return image.format, memoryview(image.data)

    def _of_video(self, message: Message) -> bool:
        if message.topic not in self._is_video:
            declared, data = self._declared(message)
            self._is_video[message.topic] = not is_picture(data) and form_of(declared, data) is not None
        return self._is_video[message.topic]
