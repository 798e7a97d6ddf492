"""H.264 as foxglove.CompressedVideo wants it: one picture a message, parameters with every key picture."""

import cv2
import numpy as np
from numpy.typing import NDArray

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
