"""The heads of VP9 and VP8 messages, whose pictures have no numbers.

Formats: VP9 Bitstream & Decoding Process, 6.2 and annex B (several frames in one message); VP8 (RFC 6386), 9.1.
"""

import struct

from auditor.errors import DecodingError
from auditor.recordings.decoding.interface import SizePx
from auditor.recordings.decoding.videos.heads import Bits, VideoHead

_VP9_SYNC, _VP8_SYNC = 0x498342, b"\x9d\x01\x2a"
_SRGB = 7
_MAX_HEADER_BYTES = 16


class Vp9:
    """See heads.Heads."""

    def head(self, data: bytes) -> VideoHead:
        """The head of a frame, or of several of which one is shown."""
        sizes_px = [_vp9_size(Bits(frame[:_MAX_HEADER_BYTES])) for frame in _frames(data)]
        return VideoHead(tuple(size for size in sizes_px if size is not None), sizes_px[0] is not None)


class Vp8:
    """See heads.Heads."""

    def head(self, data: bytes) -> VideoHead:
        """The head of a frame."""
        if not data:
            raise DecodingError("the video message is empty")
        if data[0] & 1:
            return VideoHead()
        if data[3:6] != _VP8_SYNC or len(data) < 10:
            raise DecodingError("the video message is damaged: its key picture lacks its mark")
        width, height = struct.unpack_from("<HH", data, 6)
        return VideoHead(((width & 0x3FFF, height & 0x3FFF),), is_key=True)


def _frames(data: bytes) -> list[bytes]:
    """The frames of a message by the index at its end; the message where there is none."""
    last = data[-1:]
    if last and last[0] & 0xE0 == 0xC0:
        count, width = (last[0] & 7) + 1, (last[0] >> 3 & 3) + 1
        start = len(data) - 2 - count * width
        if start >= 0 and data[start : start + 1] == last:
            sizes = [int.from_bytes(data[start + 1 + width * n :][:width], "little") for n in range(count)]
            if sum(sizes) > start:
                raise DecodingError("the video message is cut")
            begins = [sum(sizes[:place]) for place in range(count)]
            return [data[begin : begin + size] for begin, size in zip(begins, sizes, strict=True)]
    return [data]


def _vp9_size(bits: Bits) -> SizePx | None:
    """The size that a key frame declares; None of any other."""
    if bits.take(2) != 2:
        raise DecodingError("the video message is damaged: it is no frame of VP9")
    profile = bits.take(1) + 2 * bits.take(1)
    bits.take(1 if profile == 3 else 0)
    if bits.take(1) or bits.take(1):
        return None
    bits.take(2)
    if bits.take(24) != _VP9_SYNC:
        raise DecodingError("the video message is damaged: its key picture lacks its mark")
    bits.take(1 if profile > 1 else 0)
    colours = bits.take(3)
    bits.take((0 if colours == _SRGB else 1) + (profile % 2) * (1 if colours == _SRGB else 3))
    return bits.take(16) + 1, bits.take(16) + 1
