"""What the headers of a video message say before it is decoded: size, key picture, and the picture's number.

FFmpeg (the package `av`) would give the same after it has opened a decoder for the stream. It is not used because by
then it has allocated pictures of the size that the stream declares. Here the size is read from a few bits and compared
with the camera's, before any native code sees the stream; FFmpeg then decodes.
"""

import re
from typing import NamedTuple, Protocol

from auditor.errors import DecodingError
from auditor.recordings.decoding.interface import SizePx

START = re.compile(rb"\x00\x00\x01")
"""The start code of a unit of H.264 and H.265 (annex B of both)."""

_MAX_UNIT_BYTES = 4096
_MAX_UNITS = 1000


class VideoHead(NamedTuple):
    """The sizes that a message declares, and the number of its picture modulo `period`, where pictures have numbers.

    The number is that of the picture before, plus one; with `may_repeat` it may also be that of the picture before.
    `period` is 0 where the message holds a picture without a number.
    """

    sizes_px: tuple[SizePx, ...] = ()
    is_key: bool = False
    number: int | None = None
    period: int = 0
    may_repeat: bool = False

    def follows(self, last: int) -> bool:
        """True where no numbered picture is missing between this one and the one with the last number."""
        return self.number is not None and self.number in {(last + 1) % self.period, last if self.may_repeat else -1}


class Heads(Protocol):
    """Reads the headers of one topic's messages, in their order, and remembers what later ones refer to."""

    def head(self, data: bytes) -> VideoHead:
        """The head of a message. Raises DecodingError for a damaged one."""


class Bits:
    """Reads a header bit by bit. Raises DecodingError behind its end."""

    def __init__(self, data: bytes) -> None:
        self._value = int.from_bytes(data, "big")
        self._left = 8 * len(data)

    def take(self, count: int) -> int:
        """The next bits as a number, the first one the highest."""
        self._left -= count
        if self._left < 0:
            raise DecodingError("the video's parameters are cut")
        return (self._value >> self._left) & ((1 << count) - 1)

    def unsigned(self) -> int:
        """An unsigned Exp-Golomb number."""
        zeros = 0
        while not self.take(1):
            zeros += 1
            if zeros > 31:
                raise DecodingError("the video's parameters make no sense")
        return (1 << zeros) - 1 + self.take(zeros)

    def signed(self) -> int:
        """A signed Exp-Golomb number."""
        number = self.unsigned()
        return (number + 1) // 2 if number % 2 else -(number // 2)


def units(data: bytes) -> list[int]:
    """Where the units of H.264 or H.265 begin, behind their start codes."""
    begins = [start.end() for start in START.finditer(data) if start.end() < len(data)]
    if len(begins) > _MAX_UNITS:
        raise DecodingError("the video message has too many units")
    return begins


def payload(data: bytes, start: int, most_bytes: int = _MAX_UNIT_BYTES) -> bytes:
    """A unit behind its header, which ends at `start`, without its emulation prevention bytes."""
    unit = data[start : start + most_bytes]
    end = START.search(unit)
    return (unit[: end.start()] if end else unit).replace(b"\x00\x00\x03", b"\x00\x00")
