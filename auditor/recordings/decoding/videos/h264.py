"""The heads of H.264 messages. Format: ITU-T H.264, annex B, 7.3.2.1.1 (parameters), 7.3.3 (slices)."""

from typing import NamedTuple

from auditor.errors import DecodingError
from auditor.recordings.decoding.interface import SizePx
from auditor.recordings.decoding.videos.heads import Bits, VideoHead, payload, units

_PARAMETER_SET = 7
_KEY_PICTURE = 5
_PICTURES = {1, _KEY_PICTURE}
_LONG_PROFILES = {44, 83, 86, 100, 110, 118, 122, 128, 134, 135, 138, 139, 244}
_MAX_SLICE_HEADER_BYTES = 64


class Parameters(NamedTuple):
    """A sequence parameter set; `number_bits` is the length of a picture's number in bits."""

    size_px: SizePx
    number_bits: int
    separate_planes: bool


def parameter_sets(data: bytes) -> list[Parameters]:
    """Every sequence parameter set in an access unit. Raises DecodingError for a damaged one."""
    return [_parameters(payload(data, start + 1)) for start in units(data) if data[start] & 0x1F == _PARAMETER_SET]


def has_key_picture(data: bytes) -> bool:
    """True where the access unit has a key picture, at which decoding may begin."""
    return any(data[start] & 0x1F == _KEY_PICTURE for start in units(data))


def picture_number(data: bytes, parameters: Parameters) -> int | None:
    """The number of the picture in an access unit (frame_num), None where there is none. Raises DecodingError.

    It equals the last reference picture's number or exceeds it by one, modulo 2^number_bits; else a picture is missing.
    """
    for start in units(data):
        if data[start] & 0x1F in _PICTURES:
            bits = Bits(payload(data, start + 1, _MAX_SLICE_HEADER_BYTES))
            for _ in range(3):  # first macroblock, kind, picture parameter set
                bits.unsigned()
            bits.take(2 if parameters.separate_planes else 0)
            return bits.take(parameters.number_bits)
    return None


class H264:
    """See heads.Heads."""

    def __init__(self) -> None:
        self._parameters: Parameters | None = None

    def head(self, data: bytes) -> VideoHead:
        """The head of an access unit."""
        declared = parameter_sets(data)
        self._parameters = declared[-1] if declared else self._parameters
        sizes_px, parameters = tuple(one.size_px for one in declared), self._parameters
        if parameters is None:
            return VideoHead(sizes_px, period=1)
        number = picture_number(data, parameters)
        is_key = number is not None and has_key_picture(data)
        return VideoHead(sizes_px, is_key, number, 1 << parameters.number_bits, may_repeat=True)


def _parameters(data: bytes) -> Parameters:
    bits = Bits(data)
    profile = bits.take(8)
    bits.take(16)  # constraints and level
    bits.unsigned()  # the set's number
    chroma, separate = _skip_long_profile(bits) if profile in _LONG_PROFILES else (1, False)
    number_bits = 4 + bits.unsigned()
    if number_bits > 16:
        raise DecodingError("the video's parameters make no sense")
    _skip_order(bits)
    bits.unsigned()  # max_num_ref_frames
    bits.take(1)
    columns, rows = bits.unsigned() + 1, bits.unsigned() + 1
    whole_frames = bits.take(1)
    if not whole_frames:
        bits.take(1)
    bits.take(1)
    width, height = 16 * columns, 16 * rows * (2 - whole_frames)
    if bits.take(1):
        left, right, top, bottom = (bits.unsigned() for _ in range(4))
        across = 2 if chroma in {1, 2} else 1
        down = (2 if chroma == 1 else 1) * (2 - whole_frames)
        width, height = width - across * (left + right), height - down * (top + bottom)
    return Parameters((width, height), number_bits, separate)


def _skip_long_profile(bits: Bits) -> tuple[int, bool]:
    chroma = bits.unsigned()
    separate = chroma == 3 and bool(bits.take(1))
    bits.unsigned()
    bits.unsigned()
    bits.take(1)
    if bits.take(1):
        for place in range(8 if chroma != 3 else 12):
            if bits.take(1):
                _skip_scaling_list(bits, 16 if place < 6 else 64)
    return chroma, separate


def _skip_scaling_list(bits: Bits, size: int) -> None:
    last = following = 8
    for _ in range(size):
        if following:
            following = (last + bits.signed() + 256) % 256
        last = following or last


def _skip_order(bits: Bits) -> None:
    kind = bits.unsigned()
    if kind == 0:
        bits.unsigned()
    elif kind == 1:
        bits.take(1)
        bits.signed()
        bits.signed()
        for _ in range(min(bits.unsigned(), 255)):
            bits.signed()
