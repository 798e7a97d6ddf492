"""Fingerprints of each sensor's data: those of a frozen sensor are equal frame after frame."""

import zlib
from collections import Counter
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from auditor.model.frames import Frame
from auditor.model.measurement import NO_FINGERPRINT

_WHITE = 255


def fingerprints(frame: Frame) -> dict[int, int]:
    """The fingerprint of each sensor present that has one."""
    prints = {number: fingerprint_of_image(image.pixels) for number, image in frame.images.items()}
    prints |= {number: fingerprint_of_points(cloud.xyz_m) for number, cloud in frame.clouds.items()}
    return {sensor: known for sensor, known in prints.items() if known != NO_FINGERPRINT}


class RepeatedData:
    """How often a sensor's data were those of its frame before, by sensor, over the frames of a recording."""

    def __init__(self) -> None:
        self.counts: Counter[int] = Counter()
        self._last: dict[int, int] = {}

    def add(self, prints: Mapping[int, int]) -> None:
        """Take the fingerprints of the next frame."""
        self.counts.update(sensor for sensor, known in prints.items() if self._last.get(sensor) == known)
        self._last.update(prints)


def fingerprint_of_image(pixels: NDArray[np.uint8]) -> int:
    """CRC-32 of an image's pixels: equal for equal data, and hardly ever otherwise.

    A picture that is white all over has none: it is dazzled, and that it does not change tells nothing.
    """
    return zlib.crc32(np.ascontiguousarray(pixels).data) if pixels.min() < _WHITE else NO_FINGERPRINT


def fingerprint_of_points(xyz_m: NDArray[np.float32]) -> int:
    """CRC-32 of a cloud's points (M, 3)."""
    return zlib.crc32(np.ascontiguousarray(xyz_m).data)
