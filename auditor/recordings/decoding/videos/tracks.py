"""Messages of videos, decoded by FFmpeg through the package `av` (the extra `video`).

A picture of a video holds the differences to those before it: every message of a topic is noted as it is read
(`follow`), and decoded in that order once the pixels of one are requested. Each message must hold one picture, which
depends on no later one, and parameters with every key picture, as Foxglove's documentation requires.
"""

import re
from collections import deque
from collections.abc import Callable
from statistics import median
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from auditor.errors import DecodingError
from auditor.model.frames import Message
from auditor.recordings.decoding.interface import Header, SizePx
from auditor.recordings.decoding.pictures import check_size
from auditor.recordings.decoding.ros import RosTypes, read_header
from auditor.recordings.decoding.videos.av1 import Av1
from auditor.recordings.decoding.videos.h264 import H264
from auditor.recordings.decoding.videos.h265 import H265
from auditor.recordings.decoding.videos.heads import Heads, VideoHead
from auditor.recordings.decoding.videos.vpx import Vp8, Vp9
from auditor.safety.budget import MAX_PIXELS


class VideoForm(NamedTuple):
    """A form that is read: how it is named, who reads its headers, and FFmpeg's decoder of it."""

    name: str
    named: re.Pattern[str]
    heads: Callable[[], Heads]
    decoder: str


H264_FORM = VideoForm("H.264", re.compile(r"[hx]\.?264|avc", re.IGNORECASE), H264, "h264")
H265_FORM = VideoForm("H.265", re.compile(r"[hx]\.?265|hevc", re.IGNORECASE), H265, "hevc")
AV1_FORM = VideoForm("AV1", re.compile(r"av1|libaom", re.IGNORECASE), Av1, "libdav1d")
_FORMS = (
    H265_FORM,
    AV1_FORM,
    VideoForm("VP9", re.compile(r"vp0?9", re.IGNORECASE), Vp9, "vp9"),
    VideoForm("VP8", re.compile(r"vp0?8|libvpx\b(?!-)", re.IGNORECASE), Vp8, "vp8"),
    H264_FORM,
)
_OTHERS = {
    "MPEG-4": re.compile(r"mpeg-?4|mp4v", re.IGNORECASE),
    "Theora": re.compile(r"theora", re.IGNORECASE),
}

_UNITS_BEGIN = re.compile(rb"\x00?\x00\x00\x01")
_H265_BEGINS = re.compile(rb"\x00?\x00\x00\x01[\x40\x42\x44\x46\x4e]\x01")
"""A start code and a unit of parameters or a delimiter (ITU-T H.265, 7.3.1.2 and table 7-1), no unit of H.264."""

_AV1_BEGINS = b"\x12\x00"
"""An empty temporal delimiter (AV1 Bitstream & Decoding Process, 5.6), with which every temporal unit begins."""


def form_of(declared: str, data: bytes | memoryview) -> VideoForm | None:
    """The form of a video; None of anything else. Raises DecodingError, with its name, for a video that is not read.

    What is named H.264 and begins as H.265 is H.265: drivers leave a name from before.
    """
    begins = bytes(data[:8])
    for name, word in _OTHERS.items():
        if word.search(declared):
            raise DecodingError(f"the video {declared[:40]!r} is {name}, which is not decoded")
    named = next((form for form in _FORMS if form.named.search(declared)), None)
    if named in {None, H264_FORM, H265_FORM} and _UNITS_BEGIN.match(begins):
        return H265_FORM if named is H265_FORM or _H265_BEGINS.match(begins) else H264_FORM
    return AV1_FORM if named is None and begins.startswith(_AV1_BEGINS) else named


MAX_PENDING_BYTES = 32 * 2**20
MAX_PENDING = 600
_KEPT = 4

_GAPS_KEPT = 9
_FEWEST_GAPS = 3
_LONGEST_GAP = 1.5
"""Usual distances of two pictures without numbers: behind a longer one a picture may be missing."""


class VideoData(NamedTuple):
    """What a message says of its video's form, its bytes, and when its picture was taken (ns)."""

    declared: str
    data: bytes
    stamp_ns: int


class _Track:
    """One topic's video: messages not yet decoded, the decoder's state, and the pictures last decoded."""

    def __init__(self) -> None:
        self.pending: deque[Message] = deque()
        self.pending_bytes = 0
        self.done: deque[tuple[Message, Any]] = deque(maxlen=_KEPT)
        self.form: VideoForm | None = None
        self.gaps_ns: deque[int] = deque(maxlen=_GAPS_KEPT)
        self.stamp_ns = 0
        self.forget()

    def forget(self) -> None:
        """From here on only a key picture with its parameters can be decoded."""
        self.codec: Any = None
        self.heads: Heads | None = None
        self.size_px: SizePx | None = None
        self.number = 0

    def is_late(self, stamp_ns: int) -> bool:
        """True behind an unusually long time without a picture; notes the time of this one."""
        gap_ns, self.stamp_ns = stamp_ns - self.stamp_ns, stamp_ns
        late = len(self.gaps_ns) >= _FEWEST_GAPS and not 0 < gap_ns <= _LONGEST_GAP * median(self.gaps_ns)
        self.gaps_ns.append(gap_ns)
        return late


class Videos:
    """The videos of a recording's topics; pictures from a lost or damaged message to the next key picture are damaged.

    `data_of` gives what is inside a message, or raises DecodingError.
    """

    def __init__(self, data_of: Callable[[Message], VideoData]) -> None:
        self._data = data_of
        self._tracks: dict[str, _Track] = {}

    def size_px(self, message: Message) -> SizePx:
        """The size that a key picture's parameters declare. Raises DecodingError for other messages."""
        _av()  # without the extra a size is of no use
        video = self._data(message)
        form = _form(video)
        sizes_px = _head(form, form.heads(), video.data).sizes_px
        if not sizes_px:
            raise DecodingError("the video's parameters come with a later message", where=message.topic)
        return sizes_px[0]

    def follow(self, message: Message) -> None:
        """Note a message, in the order of the recording."""
        track = self._tracks.setdefault(message.topic, _Track())
        track.pending.append(message)
        track.pending_bytes += len(message.data)
        while len(track.pending) > MAX_PENDING or track.pending_bytes > MAX_PENDING_BYTES:
            # No pixels were requested for so long: all pictures up to the next key picture are damaged.
            track.pending_bytes -= len(track.pending.popleft().data)
            track.forget()

    def pixels(self, message: Message, *, colour: bool, size_px: SizePx | None = None) -> NDArray[np.uint8]:
        """See interface.ImageDecoder."""
        av = _av()
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
        try:
            pixels: NDArray[np.uint8] = picture.to_ndarray(format="bgr24" if colour else "gray")
        except (av.FFmpegError, ValueError, MemoryError) as error:  # as of a space of colours that nobody knows
            raise DecodingError(
                "the video picture has colours that cannot be converted", where=message.topic
            ) from error
        return pixels

    def _decode(self, track: _Track, message: Message, size_px: SizePx | None) -> Any:  # noqa: ANN401  # av's frame
        """The decoded picture, or the reason why there is none."""
        av = _av()
        try:
            video = self._data(message)
            if not _follows(track, video, size_px):
                track.forget()
                return "the video picture follows one that is missing or damaged"
            track.codec = track.codec or _new_codec(_form(video), track.size_px)
            pictures = track.codec.decode(av.Packet(video.data))
        except DecodingError as error:
            track.forget()
            return error.what
        except (av.FFmpegError, ValueError, MemoryError):
            track.forget()
            return "the video picture is damaged"
        if not pictures and track.codec.has_b_frames:
            track.forget()
            return (
                "its pictures depend on later ones (B-frames), which is not read: record or convert it without (bf=0)"
            )
        size = track.size_px
        if len(pictures) != 1 or pictures[0].is_corrupt or (pictures[0].width, pictures[0].height) != size:
            track.forget()
            return "the video picture is damaged"
        return pictures[0]


def _form(video: VideoData) -> VideoForm:
    form = form_of(video.declared, video.data)
    if form is None:
        raise DecodingError(f"the video format {video.declared[:20]!r} is not supported")
    return form


def _head(form: VideoForm, heads: Heads, data: bytes) -> VideoHead:
    """The head of a message. Raises DecodingError, with the name of the form, for a damaged one."""
    try:
        return heads.head(data)
    except DecodingError as error:
        raise DecodingError(error.what.replace("the video", f"the {form.name} video", 1)) from error


def _follows(track: _Track, video: VideoData, size_px: SizePx | None) -> bool:
    """True where this message can be decoded: a key picture, or the one after the last decoded. Raises DecodingError.

    Where pictures have no numbers, one that comes late may follow one that is missing.
    """
    form, late = _form(video), track.is_late(video.stamp_ns)
    if form != track.form:
        track.forget()
        track.form = form
    track.heads = track.heads or form.heads()
    head = _head(form, track.heads, video.data)
    for declared in head.sizes_px:
        check_size(declared, size_px)
        track.size_px = declared
    follows = track.codec is not None and (head.follows(track.number) if head.period else not late)
    track.number = track.number + 1 if head.number is None else head.number
    return track.size_px is not None and (head.is_key or follows)


def _av() -> Any:  # noqa: ANN401  # a module without types
    try:
        import av  # noqa: PLC0415  # an extra
    except ImportError as error:
        raise DecodingError("video needs the package av: install auditor[video]") from error
    return av


def _new_codec(form: VideoForm, size_px: SizePx | None) -> Any:  # noqa: ANN401  # av's class
    av = _av()
    av.logging.set_level(None)
    try:
        codec = av.CodecContext.create(form.decoder, "r")
    except ValueError as error:
        raise DecodingError(f"the installed package av has no decoder of {form.name}") from error
    # One picture in, one out; damaged bits are an error. What FFmpeg guesses in place of slices that are missing is
    # marked as corrupt; without guessing (ec 0) it also marks whole pictures of several slices.
    codec.thread_count = 1
    width, height = size_px or (0, 0)
    # Frames may declare another size than their sequence; decoders allocate whole blocks of 128 px.
    most_pixels = min((width + 128) * (height + 128), 2 * MAX_PIXELS)
    codec.options = {"flags": "low_delay", "err_detect": "explode+crccheck", "max_pixels": str(most_pixels)}
    return codec


class RosVideoDecoder(Videos):
    """A topic of a video; both messages begin as one with a std_msgs/Header does."""

    kind: ClassVar[Literal["image"]] = "image"

    def __init__(self, types: RosTypes) -> None:
        super().__init__(self._video)
        self._types = types

    def header(self, message: Message) -> Header:
        """The header, without decoding the rest."""
        return read_header(message)

    def _video(self, message: Message) -> VideoData:
        packet = self._types.decode(message)
        declared = packet.encoding if hasattr(packet, "encoding") else packet.format
        return VideoData(declared, bytes(packet.data), read_header(message).stamp_ns or message.log_time_ns)
