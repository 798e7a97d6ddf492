"""The heads of AV1 messages. Format: AV1 Bitstream & Decoding Process, 5.3 (units), 5.5 (sequences), 5.9 (frames).

A message is a temporal unit of one picture that is shown; its order hint is that of the one before, plus one.
"""

from collections.abc import Iterator
from typing import NamedTuple

from auditor.errors import DecodingError
from auditor.recordings.decoding.interface import SizePx
from auditor.recordings.decoding.videos.heads import Bits, VideoHead

_SEQUENCE, _FRAMES = 1, {3, 6, 7}
_KEY, _SWITCH = 0, 3
_CHOSEN_BY_FRAME = 2
_MAX_HEADER_BYTES = 256
_MAX_UNITS = 1000
_MAX_SIZE_BYTES = 8


class _Sequence(NamedTuple):
    size_px: SizePx
    is_still: bool
    time_bits: int
    screen_content: int
    integer_motion: int
    id_bits: int
    number_bits: int


class Av1:
    """See heads.Heads."""

    def __init__(self) -> None:
        self._sequence: _Sequence | None = None

    def head(self, data: bytes) -> VideoHead:
        """The head of a temporal unit."""
        head = VideoHead(period=1)
        sizes_px: tuple[SizePx, ...] = ()
        for kind, unit in _units(data):
            if kind == _SEQUENCE:
                self._sequence = _sequence(Bits(unit))
                sizes_px = (*sizes_px, self._sequence.size_px)
            elif kind in _FRAMES and self._sequence is not None:
                head = _shown(Bits(unit), self._sequence) or head
        return head._replace(sizes_px=sizes_px)


def _units(data: bytes) -> Iterator[tuple[int, bytes]]:
    """The kind of each unit, and its beginning."""
    position = units = 0
    while position < len(data):
        first, units = data[position], units + 1
        if first & 0x80 or units > _MAX_UNITS:
            raise DecodingError("the video message is damaged: it is not made of units of AV1")
        position += 2 if first & 4 else 1
        end = len(data)
        if first & 2:
            size, position = _size(data, position)
            end = position + size
        if end > len(data):
            raise DecodingError("the video message is cut")
        yield first >> 3 & 0xF, data[position : min(end, position + _MAX_HEADER_BYTES)]
        position = end


def _size(data: bytes, position: int) -> tuple[int, int]:
    size = 0
    for place in range(_MAX_SIZE_BYTES):
        if position + place >= len(data):
            break
        size |= (data[position + place] & 0x7F) << 7 * place
        if not data[position + place] & 0x80:
            return size, position + place + 1
    raise DecodingError("the video message is cut")


def _sequence(bits: Bits) -> _Sequence:
    bits.take(4)  # profile, and whether it is a still picture
    still, time_bits = bool(bits.take(1)), 0
    if still:
        bits.take(5)
    else:
        time_bits = _operating_points(bits)
    across, down = bits.take(4) + 1, bits.take(4) + 1
    size_px = (bits.take(across) + 1, bits.take(down) + 1)
    id_bits = 0
    if not still and bits.take(1):
        id_bits = bits.take(4) + 2
        id_bits += bits.take(3) + 1
    bits.take(3)  # tools of intra pictures
    if still:
        return _Sequence(size_px, still, 0, _CHOSEN_BY_FRAME, _CHOSEN_BY_FRAME, 0, 0)
    bits.take(4)
    ordered = bits.take(1)
    bits.take(2 * ordered)
    screen_content = _CHOSEN_BY_FRAME if bits.take(1) else bits.take(1)
    integer_motion = _CHOSEN_BY_FRAME
    if screen_content and not bits.take(1):
        integer_motion = bits.take(1)
    number_bits = bits.take(3) + 1 if ordered else 0
    return _Sequence(size_px, still, time_bits, screen_content, integer_motion, id_bits, number_bits)


def _operating_points(bits: Bits) -> int:
    """How many bits of presentation time a frame has; 0 where it has none."""
    delay_bits = time_bits = 0
    if bits.take(1):
        bits.take(64)
        equal = bits.take(1)
        if equal:
            bits.unsigned()
        if bits.take(1):
            delay_bits = bits.take(5) + 1
            bits.take(32 + 5)
            time_bits = 0 if equal else bits.take(5) + 1
            bits.take(5 if equal else 0)
    initial_delay = bits.take(1)
    for _ in range(bits.take(5) + 1):
        bits.take(12)
        bits.take(1 if bits.take(5) > 7 else 0)
        if delay_bits and bits.take(1):
            bits.take(2 * delay_bits + 1)
        if initial_delay and bits.take(1):
            bits.take(4)
    return time_bits


def _shown(bits: Bits, sequence: _Sequence) -> VideoHead | None:
    """The head of a frame that is shown; None of one that is only kept."""
    if sequence.is_still:
        return VideoHead(is_key=True)
    if bits.take(1):
        return VideoHead()  # a frame that was sent before: its number stands there
    kind, shown = bits.take(2), bits.take(1)
    bits.take(sequence.time_bits if shown else 1)
    bits.take(0 if kind == _SWITCH or (kind == _KEY and shown) else 1)
    bits.take(1)
    screen_content = bits.take(1) if sequence.screen_content == _CHOSEN_BY_FRAME else sequence.screen_content
    if screen_content and sequence.integer_motion == _CHOSEN_BY_FRAME:
        bits.take(1)
    bits.take(sequence.id_bits)
    if kind == _SWITCH or bits.take(1):
        raise DecodingError("a frame of the video has another size than its sequence")
    if not shown:
        return None
    number = bits.take(sequence.number_bits) if sequence.number_bits else None
    return VideoHead((), kind == _KEY, number, 1 << sequence.number_bits if sequence.number_bits else 0)
