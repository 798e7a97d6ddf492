"""Messages of foxglove.CompressedVideo: one H.264 picture a message, parameters with every key picture."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.model.frames import Message
from tests.making.foxglove_messages import protobuf_message, stamp

VIDEO = "foxglove.CompressedVideo"
KEY_EVERY = 8


def encoded(pictures: list[NDArray[np.uint8]], quality: int = 12) -> list[bytes]:
    """One packet a picture, grey or BGR; needs the package `av`."""
    import av  # noqa: PLC0415 - an extra

    codec = av.CodecContext.create("libx264", "w")
    height, width = pictures[0].shape[:2]
    codec.width, codec.height, codec.pix_fmt, codec.time_base = width, height, "yuv420p", 1
    codec.options = {
        "tune": "zerolatency",
        "crf": str(quality),
        "bf": "0",
        "x264-params": f"keyint={KEY_EVERY}:min-keyint={KEY_EVERY}:scenecut=0:repeat-headers=1:annexb=1",
    }
    packets = []
    for number, pixels in enumerate(pictures):
        bgr = cv2.cvtColor(pixels, cv2.COLOR_GRAY2BGR) if pixels.ndim == 2 else pixels
        frame = av.VideoFrame.from_ndarray(bgr, format="bgr24")
        frame.pts = number
        packets += codec.encode(frame)
    return [bytes(packet) for packet in (*packets, *codec.encode(None))]


def moving_picture(number: int, width: int = 64, height: int = 48) -> NDArray[np.uint8]:
    """A smooth picture that moves to the left."""
    x, y = np.meshgrid(np.arange(width) + 2 * number, np.arange(height))
    return (128 + 60 * np.sin(x / 7) + 50 * np.cos(y / 5 + x / 31)).astype(np.uint8)


def video_fields(data: bytes, **other: Any) -> dict[str, Any]:
    return {"timestamp": stamp(5), "frame_id": "cam", "data": data, "format": "h264", **other}


def video_messages(packets: list[bytes], **other: Any) -> list[Message]:
    return [
        Message("/a", VIDEO, "protobuf", 5, protobuf_message(VIDEO, video_fields(data, **other)).SerializeToString())
        for data in packets
    ]
