"""sensor_msgs/Image and sensor_msgs/CompressedImage."""

import re
from contextlib import suppress
from typing import Any, ClassVar, Literal, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.errors import DecodingError
from auditor.model.frames import Message
from auditor.recordings.decoding.depths import Depths, Values, upper_8_bits
from auditor.recordings.decoding.interface import Header, SizePx
from auditor.recordings.decoding.pictures import check_size, decode_picture, inspect_picture, largest_picture_value
from auditor.recordings.decoding.ros import RosTypes, read_header
from auditor.recordings.decoding.video import Videos, is_h264

_PASSTHROUGH = {1: "mono8", 3: "bgr8", 4: "bgra8"}
"""Encodings, by bytes a pixel, of images without one: OpenCV's order, which cv_bridge passes through."""


DEPTH_PICTURE = "compressedDepth"
"""In the format of a compressed image: depths, by the transport of that name."""

_H265 = re.compile(r"h\.?265|hevc", re.IGNORECASE)


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
    has_colour: bool = True


def _bayer(order: str, bytes_a_value: int = 1) -> Encoding:
    # ROS names the order by the image's first four pixels, as the later OpenCV names do.
    return Encoding(1, f"COLOR_Bayer{order}2GRAY", f"COLOR_Bayer{order}2BGR", bytes_a_value)


_GREY = Encoding(1, None, None, has_colour=False)
_UYVY = Encoding(2, "COLOR_YUV2GRAY_UYVY", "COLOR_YUV2BGR_UYVY")
_YUYV = Encoding(2, "COLOR_YUV2GRAY_YUY2", "COLOR_YUV2BGR_YUY2")

ENCODINGS = {
    "mono8": _GREY,
    "8UC1": _GREY,
    "mono16": Encoding(1, None, None, bytes_a_value=2, has_colour=False),
    "16UC1": Encoding(1, None, None, bytes_a_value=2, has_colour=False),
    "bgr8": Encoding(3, "COLOR_BGR2GRAY", None),
    "8UC3": Encoding(3, "COLOR_BGR2GRAY", None),
    "rgb8": Encoding(3, "COLOR_RGB2GRAY", "COLOR_RGB2BGR"),
    "bgra8": Encoding(4, "COLOR_BGRA2GRAY", "COLOR_BGRA2BGR"),
    "8UC4": Encoding(4, "COLOR_BGRA2GRAY", "COLOR_BGRA2BGR"),
    "rgba8": Encoding(4, "COLOR_RGBA2GRAY", "COLOR_RGBA2BGR"),
    "bayer_rggb8": _bayer("RGGB"),
    "bayer_bggr8": _bayer("BGGR"),
    "bayer_gbrg8": _bayer("GBRG"),
    "bayer_grbg8": _bayer("GRBG"),
    "bayer_rggb16": _bayer("RGGB", 2),
    "bayer_bggr16": _bayer("BGGR", 2),
    "bayer_gbrg16": _bayer("GBRG", 2),
    "bayer_grbg16": _bayer("GRBG", 2),
    "yuv422": _UYVY,
    "uyvy": _UYVY,
    "yuv422_yuy2": _YUYV,
    "yuyv": _YUYV,
    "nv12": Encoding(1, "COLOR_YUV2GRAY_NV12", "COLOR_YUV2BGR_NV12", planar=True),
    "nv21": Encoding(1, "COLOR_YUV2GRAY_NV21", "COLOR_YUV2BGR_NV21", planar=True),
}
"""Encodings of sensor_msgs/image_encodings.hpp that are supported; of 16-bit values see `depths`."""


class RawImageDecoder(Depths):
    """sensor_msgs/Image."""

    kind: ClassVar[Literal["image"]] = "image"

    def __init__(self, types: RosTypes) -> None:
        super().__init__()
        self._types = types

    def header(self, message: Message) -> Header:
        """The header, without decoding the rest."""
        return read_header(message)

    def size_px(self, message: Message) -> SizePx:
        """The declared width and height."""
        image = self._types.decode(message)
        return image.width, image.height

    def pixels(self, message: Message, *, colour: bool, size_px: SizePx | None = None) -> NDArray[np.uint8]:
        """See interface.ImageDecoder. The array is a view of the message where nothing had to be converted."""
        bits = self.bits(message.topic)
        return raw_pixels(self._types.decode(message), message.topic, colour=colour, size_px=size_px, bits=bits)

    def largest_value(self, message: Message) -> int | None:
        """See interface.DeepImageDecoder."""
        return largest_raw_value(self._types.decode(message), message.topic)


def raw_pixels(
    image: Any,  # noqa: ANN401  # the class is generated
    topic: str,
    *,
    colour: bool,
    size_px: SizePx | None,
    bits: int,
) -> NDArray[np.uint8]:
    """Pixels of anything with the fields of sensor_msgs/Image; `bits` are those of 16-bit values.

    See interface.ImageDecoder.
    """
    check_size((image.width, image.height), size_px)
    encoding = _encoding_of(image, topic)
    return _convert(upper_8_bits(_rows(image, encoding), bits), encoding, colour=colour)


def largest_raw_value(image: Any, topic: str) -> int | None:  # noqa: ANN401  # the class is generated
    """The largest value of 16 bits of anything with the fields of sensor_msgs/Image; None where there are 8."""
    check_size((image.width, image.height), None)
    encoding = _encoding_of(image, topic)
    return int(_rows(image, encoding).max()) if encoding.bytes_a_value > 1 else None


def _encoding_of(image: Any, topic: str) -> Encoding:  # noqa: ANN401  # the class is generated
    name = image.encoding
    if name == "passthrough":
        name = _PASSTHROUGH.get(image.step // image.width, name)
    encoding = ENCODINGS.get(name)
    if encoding is None:
        raise DecodingError(f"the image encoding {image.encoding[:40]!r} is not supported", where=topic)
    return encoding


def _rows(image: Any, encoding: Encoding) -> Values:  # noqa: ANN401  # the class is generated
    """The values as (rows, width) or (rows, width, channels), uint8 or uint16."""
    if encoding.planar and image.height % 2:
        raise DecodingError("a planar image needs an even height")
    rows = image.height * 3 // 2 if encoding.planar else image.height
    row_bytes = image.width * encoding.channels * encoding.bytes_a_value
    if image.step < row_bytes or len(image.data) != rows * image.step:
        raise DecodingError(
            f"the image declares {rows} rows of {image.step} bytes for {image.width} px, "
            f"and holds {len(image.data)} bytes"
        )
    values = np.ascontiguousarray(image.data.reshape(rows, image.step)[:, :row_bytes])
    shape = (rows, image.width, encoding.channels) if encoding.channels > 1 else (rows, image.width)
    if encoding.bytes_a_value > 1:
        values = values.view(">u2" if image.is_bigendian else "<u2").astype(np.uint16)
    result: Values = values.reshape(shape)
    return result


def _convert(values: NDArray[np.uint8], encoding: Encoding, *, colour: bool) -> NDArray[np.uint8]:
    conversion = encoding.to_bgr if colour else encoding.to_grey
    if conversion is None:
        return values
    try:
        return np.asarray(cv2.cvtColor(values, getattr(cv2, conversion)), dtype=np.uint8)
    except cv2.error as error:
        raise DecodingError(f"the image cannot be converted ({error.err})") from error


class CompressedImageDecoder(Depths):
    """sensor_msgs/CompressedImage with PNG, JPEG or H.264 inside, recognised by its first bytes: `format` is free text.

    All messages of a topic have the form of its first one.
    """

    kind: ClassVar[Literal["image"]] = "image"

    def __init__(self, types: RosTypes) -> None:
        super().__init__()
        self._types = types
        self._videos = Videos(lambda message: bytes(self.picture(message)))
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
        if self._of_video(message):
            return self._videos.size_px(message)
        return inspect_picture(self.picture(message)).size_px

    def pixels(self, message: Message, *, colour: bool, size_px: SizePx | None = None) -> NDArray[np.uint8]:
        """See interface.ImageDecoder."""
        if self._of_video(message):
            return self._videos.pixels(message, colour=colour, size_px=size_px)
        bits = self.bits(message.topic)
        return decode_picture(self.picture(message), colour=colour, size_px=size_px, bits=bits)

    def largest_value(self, message: Message) -> int | None:
        """See interface.DeepImageDecoder."""
        return None if self._of_video(message) else largest_picture_value(self.picture(message))

    def picture(self, message: Message) -> memoryview:
        """The PNG or JPEG file inside the message."""
        image = self._types.decode(message)
        if DEPTH_PICTURE in image.format:
            raise DecodingError(f"the format {image.format[:40]!r} is of depths", where=message.topic)
        if _H265.search(image.format):
            raise DecodingError(f"the video {image.format[:40]!r} is H.265, which is not decoded", where=message.topic)
        return memoryview(image.data)

    def _of_video(self, message: Message) -> bool:
        if message.topic not in self._is_video:
            self._is_video[message.topic] = is_h264(self.picture(message))
        return self._is_video[message.topic]
