"""Clouds of x, y and z as cloudini writes them: version 3, to the millimetre, each chunk packed by zstd."""

import math
import struct

import numpy as np
import zstandard
from numpy.typing import NDArray

_CHUNK_POINTS = 1 << 15


def cloudini(xyz_m: NDArray[np.float32], resolution: float = 0.001) -> bytes:
    """The points, rounded; NaN is kept."""
    lines = ["CLOUDINI_V03", "version: 3", f"width: {len(xyz_m)}", "height: 1", "point_step: 12"]
    lines += ["encoding_opt: LOSSY", "compression_opt: ZSTD", "fields:"]
    for place, axis in enumerate("xyz"):
        lines += [f"  - name: {axis}", f"    offset: {4 * place}", "    type: FLOAT32", f"    resolution: {resolution}"]
    made = bytearray("\n".join(lines).encode() + b"\n\0")
    for first in range(0, len(xyz_m), _CHUNK_POINTS):
        packed = zstandard.compress(_chunk(xyz_m[first : first + _CHUNK_POINTS], resolution))
        made += struct.pack("<I", len(packed)) + packed
    return bytes(made)


def _chunk(xyz_m: NDArray[np.float32], resolution: float) -> bytes:
    before, made = [0, 0, 0], bytearray()
    for point in xyz_m.tolist():
        for axis, value in enumerate(point):
            if math.isnan(value):
                before[axis] = 0
                made.append(0)
                continue
            number = round(value / resolution)
            change, before[axis] = number - before[axis], number
            made += _varint((change << 1 ^ change >> 63) + 1)
    return bytes(made)


def _varint(number: int) -> bytes:
    made = bytearray()
    while number > 0x7F:
        made.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes([*made, number])
