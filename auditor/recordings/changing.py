"""One message with other pixels or points, everything else as it was."""

from collections.abc import Callable
from typing import Any, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.errors import DecodingError
from auditor.frames import CameraImage, Message, PointCloud
from auditor.recordings import schemas
from auditor.recordings.decoding.clouds import finite, points_of, xyz_of
from auditor.recordings.decoding.images import CompressedImageDecoder, RawImageDecoder
from auditor.recordings.decoding.pictures import encode_picture, look_at_picture
from auditor.recordings.decoding.ros import RosTypes
from auditor.recordings.interface import Definition
from auditor.recordings.writers.messages import MessageMaker

Change = Callable[[CameraImage], CameraImage] | Callable[[PointCloud], PointCloud]

_GREY_ENCODINGS = {"mono8", "8UC1"}
_COLOUR_ENCODINGS = {"bgr8", "8UC3"}


class Changing:
    """Changes ROS 2 messages, given where their definitions are found."""

    def __init__(self, maker: MessageMaker, definition: Callable[[str], Definition | None]) -> None:
        self._maker = maker
        self._types = RosTypes(definition)
        self._makers: dict[str, Callable[[Message, Any], bytes]] = {
            schemas.IMAGE: self._raw_image,
            schemas.COMPRESSED_IMAGE: self._compressed_image,
            schemas.POINT_CLOUD: self._point_cloud,
        }

    def change(self, message: Message, change: Change) -> Message:
        """The changed message; the same one where it cannot be decoded: what is damaged stays so."""
        make = self._makers.get(message.schema)
        if make is None or message.encoding != "cdr":
            raise DecodingError(f"{message.schema} cannot be changed", where=message.topic)
        try:
            data = make(message, change)
        except DecodingError:
            return message
        return Message(message.topic, message.schema, message.encoding, message.log_time_ns, data)

    def _raw_image(self, message: Message, change: Callable[[CameraImage], CameraImage]) -> bytes:
        decoder = RawImageDecoder(self._types)
        header = decoder.header(message)
        pixels = change(CameraImage(0, header.stamp_ns, decoder.pixels(message, colour=True))).pixels
        encoding = self._types.decode(message).encoding
        if pixels.ndim == 2:
            encoding = encoding if encoding in _GREY_ENCODINGS else "mono8"
        elif encoding == "rgb8":
            pixels = cast("NDArray[np.uint8]", cv2.cvtColor(pixels, cv2.COLOR_BGR2RGB))
        else:
            encoding = encoding if encoding in _COLOUR_ENCODINGS else "bgr8"
        return self._maker.raw_image(pixels, encoding, self._maker.header(header.stamp_ns, header.frame_id))

    def _compressed_image(self, message: Message, change: Callable[[CameraImage], CameraImage]) -> bytes:
        decoder = CompressedImageDecoder(self._types)
        header = decoder.header(message)
        form = look_at_picture(decoder.picture(message)).form
        pixels = change(CameraImage(0, header.stamp_ns, decoder.pixels(message, colour=True))).pixels
        data = encode_picture(pixels, form)
        # The format is free text that may tell of colours; it stays.
        return self._maker.compressed_image(data, self._types.decode(message).format, header.stamp_ns, header.frame_id)

    def _point_cloud(self, message: Message, change: Callable[[PointCloud], PointCloud]) -> bytes:
        cloud = self._types.decode(message)
        stamp = cloud.header.stamp.sec * 10**9 + cloud.header.stamp.nanosec
        before = finite(xyz_of(points_of(cloud)))
        after = change(PointCloud(stamp, before)).xyz_m
        # Which old point a new one was is not known: intensities are not carried over.
        points = np.zeros((len(after), 4), np.float32)
        points[:, :3] = after
        return self._maker.point_cloud(points, stamp, cloud.header.frame_id)
