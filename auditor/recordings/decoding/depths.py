"""Pictures of more than 8 bits a value, and the 8 bits that are kept of them.

A camera of 12 bits writes values of 0 to 4095 into 16 bits, or these times 16; no message says which. The depth is
found once a topic, from its first pictures, and then holds for all: a scale of each picture's own would hide an attack.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from auditor.model.rig import MOST_BITS, PIXEL_BITS
from auditor.recordings.parameters import PICTURE_DEPTH

Values = NDArray[np.unsignedinteger[Any]]
"""(H, W) or (H, W, channels), of 8 bits or of 16 in the machine's byte order."""


def depth_of(largest: int) -> int:
    """The bits of a camera of whose values this is the largest. Those at the upper end of 16 bits have 16."""
    return next((bits for bits in PICTURE_DEPTH.bits if largest < 1 << bits), MOST_BITS)


def upper_8_bits(values: Values, bits: int) -> NDArray[np.uint8]:
    """Of values of 16 bits the upper 8 of so many: the full scale becomes 255, and so does what lies above it."""
    shift = bits - PIXEL_BITS if values.dtype == np.uint16 else 0
    if not shift:
        return np.asarray(values, dtype=np.uint8)
    kept = np.empty(values.shape, np.uint8)
    for row, into in zip(values, kept, strict=True):  # whole pictures of 16 bits would take twice their memory
        np.minimum(row >> shift, 255, out=into, casting="unsafe")
    return kept


class Depths:
    """What image decoders share that read pictures of more than 8 bits: their depths by topic, 16 where not known."""

    def __init__(self) -> None:
        self._bits: dict[str, int] = {}

    def use_depth(self, topic: str, bits: int) -> None:
        """Take the values of a topic's pictures as of so many bits, from here on."""
        self._bits[topic] = bits

    def bits(self, topic: str) -> int:
        """The bits of a topic's values, where they have more than 8."""
        return self._bits.get(topic, MOST_BITS)
