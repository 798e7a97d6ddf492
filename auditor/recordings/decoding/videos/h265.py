"""The heads of H.265 messages. Format: ITU-T H.265, annex B, 7.3.1.2 (units), 7.3.2 (parameters), 7.3.6.1 (slices).

Messages hold one picture that depends on no later one. Its picture order count then is that of the picture before plus
one, as encoders of low delay write it.
"""

from typing import NamedTuple

from auditor.errors import DecodingError
from auditor.recordings.decoding.interface import SizePx
from auditor.recordings.decoding.videos.heads import Bits, VideoHead, payload, units

_HEADER_BYTES = 2
_SEQUENCE, _PICTURE = 33, 34
_SLICES = range(22)
_KEY_PICTURES = range(16, 22)
_IRAP = range(16, 24)
_IDR = range(19, 21)
_MAX_SLICE_HEADER_BYTES = 64


class Sequence(NamedTuple):
    """A sequence parameter set; `number_bits` is the length of a picture order count in bits."""

    size_px: SizePx
    number_bits: int
    separate_planes: bool


class _Pictures(NamedTuple):
    sequence: int
    has_output_flag: bool
    extra_bits: int


class H265:
    """See heads.Heads."""

    def __init__(self) -> None:
        self._sequences: dict[int, Sequence] = {}
        self._pictures: dict[int, _Pictures] = {}

    def head(self, data: bytes) -> VideoHead:
        """The head of an access unit."""
        sizes_px: list[SizePx] = []
        for start in units(data):
            kind = data[start] >> 1 & 0x3F
            if kind == _SEQUENCE:
                number, sequence = _sequence(Bits(payload(data, start + _HEADER_BYTES)))
                self._sequences[number] = sequence
                sizes_px.append(sequence.size_px)
            elif kind == _PICTURE:
                number, pictures = _picture(Bits(payload(data, start + _HEADER_BYTES)))
                self._pictures[number] = pictures
            elif kind in _SLICES:
                bits = Bits(payload(data, start + _HEADER_BYTES, _MAX_SLICE_HEADER_BYTES))
                return self._of_slice(bits, kind, tuple(sizes_px))
        return VideoHead(tuple(sizes_px), period=1)

    def _of_slice(self, bits: Bits, kind: int, sizes_px: tuple[SizePx, ...]) -> VideoHead:
        if not bits.take(1):
            raise DecodingError("the video picture lacks its first slice")
        bits.take(1 if kind in _IRAP else 0)
        pictures = self._pictures.get(bits.unsigned())
        sequence = self._sequences.get(pictures.sequence) if pictures else None
        if pictures is None or sequence is None:
            return VideoHead(sizes_px, period=1)
        number = 0
        if kind not in _IDR:
            bits.take(pictures.extra_bits)
            bits.unsigned()  # the slice's type
            bits.take(pictures.has_output_flag + 2 * sequence.separate_planes)
            number = bits.take(sequence.number_bits)
        return VideoHead(sizes_px, kind in _KEY_PICTURES, number, 1 << sequence.number_bits)


def _sequence(bits: Bits) -> tuple[int, Sequence]:
    bits.take(4)
    layers = bits.take(3)
    bits.take(1)
    _skip_levels(bits, layers)
    number, chroma = bits.unsigned(), bits.unsigned()
    separate = chroma == 3 and bool(bits.take(1))
    width, height = bits.unsigned(), bits.unsigned()
    if bits.take(1):
        left, right, top, bottom = (bits.unsigned() for _ in range(4))
        width -= (2 if chroma in {1, 2} else 1) * (left + right)
        height -= (2 if chroma == 1 else 1) * (top + bottom)
    bits.unsigned()
    bits.unsigned()  # depths
    number_bits = 4 + bits.unsigned()
    if number_bits > 16 or number > 15:
        raise DecodingError("the video's parameters make no sense")
    return number, Sequence((width, height), number_bits, separate)


def _skip_levels(bits: Bits, layers: int) -> None:
    """Profile, tier and level of the stream and of its temporal layers (7.3.3)."""
    bits.take(96)
    there = [(bits.take(1), bits.take(1)) for _ in range(layers)]
    bits.take(2 * (8 - layers) if layers else 0)
    for profile, level in there:
        bits.take(88 * profile + 8 * level)


def _picture(bits: Bits) -> tuple[int, _Pictures]:
    number, sequence = bits.unsigned(), bits.unsigned()
    if number > 63:
        raise DecodingError("the video's parameters make no sense")
    bits.take(1)
    return number, _Pictures(sequence, bool(bits.take(1)), bits.take(3))
