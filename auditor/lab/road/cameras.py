"""From brightness to grey levels: what lens, sensor and camera calibration add."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auditor.lab.road.noise import Plane

_EXPOSURE = 560.0
"""Grey levels of white in full sunlight: bright walls and the sky saturate, as they do on the road."""

_MAX_ROW_ERROR_PX = 0.3


@dataclass(frozen=True)
class CameraCharacter:
    """How one camera departs from the ideal one. `row_error_px` is how far its rows lie beside the calibrated ones.

    `blur` is the weight of each neighbour. Photon noise has a variance of `photon` grey levels a grey level, read noise
    a deviation of `read`. `vignetting` is the share of light lost in the corners.
    """

    gain: float = 1.0
    offset: float = 0.0
    vignetting: float = 0.0
    blur: float = 0.0
    photon: float = 0.0
    read: float = 0.0
    row_error_px: float = 0.0


def draw_camera(rng: np.random.Generator) -> CameraCharacter:
    """A camera as it may come from the factory."""
    return CameraCharacter(
        gain=float(rng.uniform(0.92, 1.08)),
        offset=float(rng.uniform(0, 5)),
        vignetting=float(rng.uniform(0.05, 0.2)),
        blur=float(rng.uniform(0.12, 0.2)),
        photon=float(rng.uniform(0.015, 0.03)),
        read=float(rng.uniform(0.8, 1.3)),
        row_error_px=float(rng.uniform(-_MAX_ROW_ERROR_PX, _MAX_ROW_ERROR_PX)),
    )


def expose(brightness: Plane, character: CameraCharacter, rng: np.random.Generator) -> NDArray[np.uint8]:
    """The (H, W) image of a brightness of the same shape."""
    level = _blurred(brightness, character.blur) * np.float32(_EXPOSURE * character.gain)
    level *= _vignette(level.shape, character.vignetting)
    level += np.float32(character.offset)
    if character.read > 0:
        deviation = np.sqrt(np.clip(level, 0, 255) * np.float32(character.photon) + np.float32(character.read**2))
        level += deviation * rng.standard_normal(level.shape, dtype=np.float32)
    return np.asarray(np.clip(np.rint(level), 0, 255), dtype=np.uint8)


def _blurred(plane: Plane, weight: float) -> Plane:
    for axis in (0, 1):
        edge = np.concatenate([plane.take([0], axis), plane, plane.take([-1], axis)], axis=axis)
        before, after = (edge[:-2], edge[2:]) if axis == 0 else (edge[:, :-2], edge[:, 2:])
        plane = np.float32(1 - 2 * weight) * plane + np.float32(weight) * (before + after)
    return plane


def _vignette(shape: tuple[int, ...], loss: float) -> Plane:
    height, width = shape
    v = (np.arange(height, dtype=np.float32) * 2 - height) / width
    u = (np.arange(width, dtype=np.float32) * 2 - width) / width
    return np.asarray(1 - loss * (v[:, None] ** 2 + u[None, :] ** 2), dtype=np.float32)
