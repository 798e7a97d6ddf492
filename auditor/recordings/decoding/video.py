"""Messages of H.264, decoded by FFmpeg through the package `av` (the extra `video`).

A picture of a video holds the differences to those before it: every message of a topic is noted as it is read
(`follow`), and decoded in that order once the pixels of one are requested. Each message must hold one picture, which
depends on no later one, and parameters with every key picture, as Foxglove's documentation requires.
"""

import re
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auditor.errors import DecodingError
from auditor.model.frames import Message
from auditor.recordings.decoding.h264 import Parameters, has_key_picture, parameter_sets, picture_number
from auditor.recordings.decoding.interface import SizePx
from auditor.recordings.decoding.pictures import check_size

_OTHER_VIDEOS = {
    "H.265": re.compile(r"[hx]\.?265|hevc", re.IGNORECASE),
    "AV1": re.compile(r"av1|svtav1|aom", re.IGNORECASE),
    "VP9": re.compile(r"vp9", re.IGNORECASE),
    "VP8": re.compile(r"vp8", re.IGNORECASE),
    "MPEG-4": re.compile(r"mpeg-?4|mp4v", re.IGNORECASE),
    "Theora": re.compile(r"theora", re.IGNORECASE),
}
_H265_BEGINS = re.compile(rb"\x00?\x00\x00\x01[\x40\x42\x44\x46\x4e]\x01")
"""A start code and a unit of parameters or a delimiter (ITU-T H.265, 7.3.1.2 and table 7-1), no unit of H.264."""

MAX_PENDING_BYTES = 32 * 2**20
MAX_PENDING = 600
_KEPT = 4


class _Track:
    """One topic's video: messages not yet decoded, the decoder's state, and the pictures last decoded."""

    def __init__(self) -> None:
        self.pending: deque[Message] = deque()
        self.pending_bytes = 0
        self.codec: Any = None
        self.parameters: Parameters | None = None
        self.number = 0
        self.done: deque[tuple[Message, Any]] = deque(maxlen=_KEPT)


def is_h264(data: memoryview) -> bool:
    """True for bytes that begin with a start code, as an H.264 stream does (ITU-T H.264, Annex B)."""
    return bytes(data[:3]) == b"\0\0\1" or bytes(data[:4]) == b"\0\0\0\1"


def refuse_other_video(declared: str, data: bytes | memoryview, where: str = "") -> None:
    """Raises DecodingError, with its name, where a video is said to be of another form than H.264, or begins as H.265.

    Transports write the name of the form or of the encoder: `h264`, `libx264`, `hevc_nvenc`.
    """
    other = next((name for name, word in _OTHER_VIDEOS.items() if word.search(declared)), "")
    if not other and _H265_BEGINS.match(data):
        other = "H.265"
    if other:
        raise DecodingError(f"the video {declared[:40]!r} is {other}, which is not decoded", where=where)


class Videos:
    """The videos of a recording's topics; pictures from a lost or damaged message to the next key picture are damaged.

    `data_of` gives the bytes inside a message, or raises DecodingError.
    """

    def __init__(self, data_of: Callable[[Message], bytes]) -> None:
        self._data = data_of
        self._tracks: dict[str, _Track] = {}

    def size_px(self, message: Message) -> SizePx:
        """The size that a key picture's parameters declare. Raises DecodingError for other messages."""
        _av()  # without the extra a size is of no use
        found = parameter_sets(self._data(message))
        if not found:
            raise DecodingError("the video's parameters come with a later message", where=message.topic)
        return found[0].size_px

    def follow(self, message: Message) -> None:
        """Note a message, in the order of the recording."""
        track = self._tracks.setdefault(message.topic, _Track())
        track.pending.append(message)
        track.pending_bytes += len(message.data)
        while len(track.pending) > MAX_PENDING or track.pending_bytes > MAX_PENDING_BYTES:
            # No pixels were requested for so long: all pictures up to the next key picture are damaged.
            track.pending_bytes -= len(track.pending.popleft().data)
            track.codec = None

    def pixels(self, message: Message, *, colour: bool, size_px: SizePx | None = None) -> NDArray[np.uint8]:
        """See interface.ImageDecoder."""
        _av()
        track = self._tracks.setdefault(message.topic, _Track())
        if not any(message is other for other in track.pending) and not any(message is m for m, _ in track.done):
            self.follow(message)
        while track.pending and not any(message is done for done, _ in track.done):
            following = track.pending.popleft()
            track.pending_bytes -= len(following.data)
            track.done.append((following, self._decode(track, following, size_px)))
        picture = next((picture for done, picture in track.done if done is message), None)
        if picture is None or isinstance(picture, str):
            raise DecodingError(picture or "the video cannot be decoded here", where=message.topic)
        pixels: NDArray[np.uint8] = picture.to_ndarray(format="bgr24" if colour else "gray")
        return pixels

    def _decode(self, track: _Track, message: Message, size_px: SizePx | None) -> Any:  # noqa: ANN401  # av's frame
        """The decoded picture, or the reason why there is none."""
        av = _av()
        try:
            data = self._data(message)
            for declared in parameter_sets(data):
                check_size(declared.size_px, size_px)
                track.parameters = declared
            if not _follows(track, data):
                track.codec = None
                return "the video picture follows one that is missing or damaged"
            track.codec = track.codec or _new_codec()
            pictures = track.codec.decode(av.Packet(data))
        except DecodingError as error:
            track.codec = None
            return error.what
        except (av.FFmpegError, ValueError, MemoryError):
            track.codec = None
            return "the video picture is damaged"
        if len(pictures) != 1 or pictures[0].is_corrupt or not _has_size(pictures[0], track):
            track.codec = None
            return "the video picture is damaged"
        return pictures[0]


def _follows(track: _Track, data: bytes) -> bool:
    """True where this access unit can be decoded: a key picture, or the one after the last decoded."""
    if track.parameters is None:
        return False
    number = picture_number(data, track.parameters)
    last, track.number = track.number, number or 0
    if number is None or (track.codec is None and not has_key_picture(data)):
        return False
    return has_key_picture(data) or number in {last, (last + 1) % 2**track.parameters.number_bits}


def _has_size(picture: Any, track: _Track) -> bool:  # noqa: ANN401  # av's frame
    return track.parameters is not None and (picture.width, picture.height) == track.parameters.size_px


def _av() -> Any:  # noqa: ANN401  # a module without types
    try:
        import av  # noqa: PLC0415  # an extra
    except ImportError as error:
        raise DecodingError("video needs the package av: install auditor[video]") from error
    return av


def _new_codec() -> Any:  # noqa: ANN401  # av's class
    av = _av()
    av.logging.set_level(None)
    codec = av.CodecContext.create("h264", "r")
    # One picture in, one out; damaged bits are an error. What FFmpeg guesses in place of slices that are missing is
    # marked as corrupt; without guessing (ec 0) it also marks whole pictures of several slices.
    codec.thread_count = 1
    codec.options = {"flags": "low_delay", "err_detect": "explode"}
    return codec
