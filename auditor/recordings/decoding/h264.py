"""The size and the number of the pictures in an H.264 access unit, read from its headers before it is decoded.

Format: ITU-T H.264, annex B (start codes), 7.3.2.1.1 (sequence parameter set), 7.3.3 (slice header), 9.1 (Exp-Golomb).

FFmpeg (the package `av`) would give the same after it has opened a decoder for the stream. It is not used because by
then it has allocated pictures of the size that the stream declares. Here the size is read from a few bits and compared
with the camera's, before any native code sees the stream; FFmpeg then decodes.
"""

import re
from typing import NamedTuple

from auditor.errors import DecodingError
from auditor.recordings.decoding.interface import SizePx

_PARAMETER_SET = 7
_KEY_PICTURE = 5
_PICTURES = {1, _KEY_PICTURE}
_START = re.compile(rb"\x00\x00\x01")
_LONG_PROFILES = {44, 83, 86, 100, 110, 118, 122, 128, 134, 135, 138, 139, 244}
_MAX_PARAMETER_SET_BYTES = 4096
_MAX_SLICE_HEADER_BYTES = 64
_MAX_UNITS = 1000


class Parameters(NamedTuple):
    """A sequence parameter set; `number_bits` is the length of a picture's number in bits."""

    size_px: SizePx
    number_bits: int
    separate_planes: bool


def parameter_sets(data: bytes) -> list[Parameters]:
    """Every sequence parameter set in an access unit. Raises DecodingError for a damaged one."""
    return [_parameters(_payload(data, start)) for start in _units(data) if data[start] & 0x1F == _PARAMETER_SET]


def has_key_picture(data: bytes) -> bool:
    """True where the access unit has a key picture, at which decoding may begin."""
    return any(data[start] & 0x1F == _KEY_PICTURE for start in _units(data))


def picture_number(data: bytes, parameters: Parameters) -> int | None:
    """The number of the picture in an access unit (frame_num), None where there is none. Raises DecodingError.

    It equals the last reference picture's number or exceeds it by one, modulo 2^number_bits; else a picture is missing.
    """
    for start in _units(data):
        if data[start] & 0x1F in _PICTURES:
            bits = _Bits(_payload(data, start, _MAX_SLICE_HEADER_BYTES))
            for _ in range(3):  # first macroblock, kind, picture parameter set
                bits.unsigned()
            bits.take(2 if parameters.separate_planes else 0)
            return bits.take(parameters.number_bits)
    return None


def _units(data: bytes) -> list[int]:
    """Where the units of an access unit begin, behind their start codes."""
    units = [found.end() for found in _START.finditer(data) if found.end() < len(data)]
    if len(units) > _MAX_UNITS:
        raise DecodingError("the video message has too many units")
    return units


def _payload(data: bytes, start: int, most_bytes: int = _MAX_PARAMETER_SET_BYTES) -> bytes:
    """A unit without its first byte and without its emulation prevention bytes."""
    unit = data[start + 1 : start + most_bytes]
    end = _START.search(unit)
    return (unit[: end.start()] if end else unit).replace(b"\x00\x00\x03", b"\x00\x00")


class _Bits:
    def __init__(self, data: bytes) -> None:
        self._value = int.from_bytes(data, "big")
        self._left = 8 * len(data)

    def take(self, count: int) -> int:
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
        number = self.unsigned()
        return (number + 1) // 2 if number % 2 else -(number // 2)


def _parameters(data: bytes) -> Parameters:
    bits = _Bits(data)
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


def _skip_long_profile(bits: _Bits) -> tuple[int, bool]:
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


def _skip_scaling_list(bits: _Bits, size: int) -> None:
    last = following = 8
    for _ in range(size):
        if following:
            following = (last + bits.signed() + 256) % 256
        last = following or last


def _skip_order(bits: _Bits) -> None:
    kind = bits.unsigned()
    if kind == 0:
        bits.unsigned()
    elif kind == 1:
        bits.take(1)
        bits.signed()
        bits.signed()
        for _ in range(min(bits.unsigned(), 255)):
            bits.signed()
