"""Which form a video has: by the name that its message gives, of a form or of an encoder, and by its first bytes."""

import re
from collections.abc import Callable
from typing import NamedTuple

from auditor.errors import DecodingError
from auditor.recordings.decoding.videos.av1 import Av1
from auditor.recordings.decoding.videos.h264 import H264
from auditor.recordings.decoding.videos.h265 import H265
from auditor.recordings.decoding.videos.heads import Heads
from auditor.recordings.decoding.videos.vpx import Vp8, Vp9


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
