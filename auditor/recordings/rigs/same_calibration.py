"""Whether two calibrations are the same but for the noise of numbers that were computed anew."""

from dataclasses import fields

import numpy as np
from numpy.typing import ArrayLike

from auditor.recordings.decoding import CameraInfo
from auditor.recordings.parameters import CALIBRATION_CHANGES

_NUMBERS = (tuple, np.ndarray)


def same_numbers(a: ArrayLike, b: ArrayLike) -> bool:
    """True where no number differs by more than the noise, which is relative to the largest of them."""
    one, other = np.asarray(a, np.float64), np.asarray(b, np.float64)
    if one.shape != other.shape or not one.size:
        return one.shape == other.shape
    largest = max(float(np.abs(one).max()), float(np.abs(other).max()))
    return bool(np.all(np.abs(one - other) <= CALIBRATION_CHANGES.noise * largest))


def same_camera_info(a: CameraInfo, b: CameraInfo) -> bool:
    """True for two messages of one calibration; their stamps do not count."""
    if a.header.frame_id != b.header.frame_id:
        return False
    pairs = ((getattr(a, field.name), getattr(b, field.name)) for field in fields(a) if field.name != "header")
    return all(same_numbers(x, y) if isinstance(x, _NUMBERS) else x == y for x, y in pairs)
