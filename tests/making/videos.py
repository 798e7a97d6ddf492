"""Messages of foxglove.CompressedVideo: one picture a message, parameters with every key picture."""

import os
from fractions import Fraction
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.model.frames import Message
from tests.making.foxglove_messages import protobuf_message, stamp

VIDEO = "foxglove.CompressedVideo"
KEY_EVERY = 8


ENCODERS: dict[str, tuple[str, dict[str, str]]] = {
    "h264": (
        "libx264",
        {
            "tune": "zerolatency",
            "bf": "0",
            "x264-params": f"keyint={KEY_EVERY}:min-keyint={KEY_EVERY}:scenecut=0:repeat-headers=1:annexb=1:slices=2",
        },
    ),
    "h265": (
        "libx265",
        {
            "tune": "zerolatency",
            "x265-params": f"keyint={KEY_EVERY}:min-keyint={KEY_EVERY}:scenecut=0:repeat-headers=1:annexb=1:bframes=0"
            ":pools=none:frame-threads=1:log-level=none",
        },
    ),
    "av1": (
        "libsvtav1",
        {"preset": "10", "g": str(KEY_EVERY), "svtav1-params": "pred-struct=1:lookahead=0:rtc=1:lp=1:scd=0"},
    ),
    "vp9": ("libvpx-vp9", {"deadline": "realtime", "lag-in-frames": "0", "g": str(KEY_EVERY), "b": "0"}),
    "vp8": ("libvpx", {"deadline": "realtime", "lag-in-frames": "0", "g": str(KEY_EVERY), "b": "9000000"}),
}
"""By form an encoder and its options: one picture a packet, parameters with every key picture."""


WITH_B_FRAMES: dict[str, tuple[str, dict[str, str]]] = {
    "h264": (
        "libx264",
        {"x264-params": f"keyint={KEY_EVERY}:scenecut=0:repeat-headers=1:annexb=1:bframes=2:b-adapt=0"},
    ),
    "h265": (
        "libx265",
        {
            "x265-params": f"keyint={KEY_EVERY}:scenecut=0:repeat-headers=1:annexb=1:bframes=2:b-adapt=0"
            ":pools=none:frame-threads=1:log-level=none"
        },
    ),
}
"""The same where pictures depend on later ones: packets stand in the order of decoding."""


def encoded(
    pictures: list[NDArray[np.uint8]], quality: int = 12, form: str = "h264", *, b_frames: bool = False
) -> list[bytes]:
    """One packet a picture, grey or BGR; needs the package `av`.

    Where it may, svtav1 gives this process real-time priority, which all that it starts later would inherit.
    """
    policy, priority = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        return _encoded(pictures, quality, WITH_B_FRAMES[form] if b_frames else ENCODERS[form])
    finally:
        os.sched_setscheduler(0, policy, priority)


def _encoded(pictures: list[NDArray[np.uint8]], quality: int, encoder: tuple[str, dict[str, str]]) -> list[bytes]:
    import av  # noqa: PLC0415 - an extra

    os.environ.setdefault("SVT_LOG", "-1")  # svtav1 prints by itself
    name, options = encoder
    codec = av.CodecContext.create(name, "w")
    height, width = pictures[0].shape[:2]
    codec.width, codec.height, codec.pix_fmt, codec.time_base = width, height, "yuv420p", Fraction(1, 10)
    codec.thread_count = 1
    codec.options = {"crf": str(quality), **options}
    av.logging.set_level(None)
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


def video_fields(data: bytes, number: int = 0, **other: Any) -> dict[str, Any]:
    return {"timestamp": stamp(5 * 10**9 + number * 10**8), "frame_id": "cam", "data": data, "format": "h264", **other}


def video_messages(packets: list[bytes], **other: Any) -> list[Message]:
    made = [video_fields(data, number, **other) for number, data in enumerate(packets) if data]
    return [Message("/a", VIDEO, "protobuf", 5, protobuf_message(VIDEO, one).SerializeToString()) for one in made]
