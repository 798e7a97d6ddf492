"""Patches of one camera that are brighter, or darker, than all that another one shows where they could lie.

An opaque light or an opaque spot leaves stereo nothing to match, so that what is compared at its disparities does not
see it. Nothing is matched here: the tone curve of the two pictures predicts each level of the other camera, and a patch
counts by what it exceeds all of them by, along its rows, from far away to as near as `nearest_m`.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from auditor.measurement.checks.light import view_of
from auditor.measurement.checks.photometric_consistency import consistency_of
from auditor.measurement.checks.seen import Seen
from auditor.measurement.parameters import HALF, LIGHT
from auditor.measurement.tone_curve import predict
from auditor.model.arrays import Floats32, Image, Mask
from auditor.model.parameters import BY_HAND, parameter

_REAL = "24 frames of three real drives, with discs and faculas painted in (docs/decisions.md): chosen on them"
_WHITE, _BLACK = 255, 0


@dataclass(frozen=True)
class UnmatchedLight:
    """By how much a patch of one camera exceeds all that another one shows on its rows."""

    step_px: int = parameter(4, unit="half px each way, of which one is compared", source=BY_HAND)
    fewest: int = parameter(200, unit="half px that both cameras see, to fit the curve to", source=BY_HAND)
    nearest_m: float = parameter(2.0, unit="m, nearer than which nothing is looked for", source=_REAL)
    beside_px: int = parameter(8, unit="half px further on either side", source=BY_HAND)
    patch_px: int = parameter(24, unit="half px, side of a patch", source=_REAL)
    usual: float = parameter(
        1.0, unit="of 12 grey levels and a quarter of what is predicted, that is none", source=_REAL
    )


NUMBERS = UnmatchedLight()
_STEP = NUMBERS.step_px
_NEARBY = np.ones((2 * _STEP - 1, 2 * _STEP - 1), dtype=np.uint8)
_PATCH = (NUMBERS.patch_px // _STEP, NUMBERS.patch_px // _STEP)
_UNIT = np.float32(LIGHT.level) + np.float32(LIGHT.share) * np.arange(256, dtype=np.float32)


@dataclass(frozen=True, eq=False)
class Sampled:
    """One camera at every `step_px`-th pixel, (h, w): its level, and the highest and the lowest one nearby.

    `known`: it sees all of what is nearby. `bounded`: so it does, and nothing there saturates.
    """

    level: Image
    highest: Image
    lowest: Image
    known: Mask
    bounded: Mask


@dataclass(frozen=True, eq=False)
class UnmatchedShares:
    """How much of a patch is brighter, and darker, 0 to 1, in the source and in the reference, as a pair."""

    brighter: tuple[float | None, float | None]
    darker: tuple[float | None, float | None]


def measure_unmatched_light(seen: Seen, i: int, k: int) -> tuple[float | None, float | None]:
    """How much of a patch of the source, and of the reference, is brighter than all that the other one shows.

    None where they see too little together.
    """
    return seen.once(unmatched_shares, i, k).brighter


def measure_unmatched_darkness(seen: Seen, i: int, k: int) -> tuple[float | None, float | None]:
    """How much of a patch of the source, and of the reference, is darker than all that the other one shows."""
    return seen.once(unmatched_shares, i, k).darker


def unmatched_shares(seen: Seen, i: int, k: int) -> UnmatchedShares:
    """The patches of a pair that stand out the most."""
    matches = seen.once(consistency_of, i, k).matches
    row, column = np.nonzero(matches.seen[::_STEP, ::_STEP])
    if row.size < NUMBERS.fewest:
        return UnmatchedShares((None, None), (None, None))
    source, reference = seen.once(view_of, i), seen.once(view_of, k)
    row, column = row * _STEP, column * _STEP
    there = np.rint(matches.column[row, column]).astype(np.intp).clip(0, source.levels.shape[1] - 1)
    s, t = source.levels[row, there], reference.levels[row, column]
    usable = np.asarray((s < source.saturation) & (t < reference.saturation))
    to_source, to_reference = predict(t, s, usable).table[0], predict(s, t, usable).table[0]
    sampled_i, sampled_k, reach = seen.once(sampled, i), seen.once(sampled, k), _reach(seen, i, k)
    of_source = _standing_out(sampled_i, _along(sampled_k, to_source, -reach))
    of_reference = _standing_out(sampled_k, _along(sampled_i, to_reference, reach))
    return UnmatchedShares((of_source[0], of_reference[0]), (of_source[1], of_reference[1]))


def sampled(seen: Seen, camera: int) -> Sampled:
    """The samples of a camera's levels."""
    view, whole = seen.once(view_of, camera), seen.known.get(camera)
    highest, lowest = (of(view.levels, _NEARBY)[::_STEP, ::_STEP] for of in (cv2.dilate, cv2.erode))
    known = np.ones(highest.shape, dtype=np.bool_)
    if whole is not None:
        known = cv2.erode(whole[::HALF, ::HALF].astype(np.uint8), _NEARBY)[::_STEP, ::_STEP] > 0
    level = view.levels[::_STEP, ::_STEP]
    return Sampled(level, highest, lowest, known, np.asarray(known & (highest < view.saturation)))


def _reach(seen: Seen, i: int, k: int) -> int:
    """How many samples a match lies beside its pixel at most."""
    focal_px = seen.rig.camera(k).projection[0, 0] / HALF
    return int(np.ceil(focal_px * seen.rig.baseline_m(i, k) / NUMBERS.nearest_m / _STEP))


def _along(other: Sampled, curve: Image, reach: int) -> tuple[Image, Image]:
    """The highest and lowest levels predicted along rows, of `reach` samples to the left, or to the right below 0.

    What the other camera does not see is unknown, as what lies beyond its picture; what saturates may be brighter.
    """
    highest, lowest = cv2.LUT(other.highest, curve), cv2.LUT(other.lowest, curve)
    beside = NUMBERS.beside_px // _STEP
    along = np.ones((1, abs(reach) + 2 * beside + 1), dtype=np.uint8)
    anchor = (beside + max(reach, 0), 0)
    highest = cv2.dilate(
        np.where(other.bounded, highest, np.uint8(_WHITE)),
        along,
        anchor=anchor,
        borderType=cv2.BORDER_CONSTANT,
        borderValue=(_WHITE,),
    )
    lowest = cv2.erode(
        np.where(other.known, lowest, np.uint8(_BLACK)),
        along,
        anchor=anchor,
        borderType=cv2.BORDER_CONSTANT,
        borderValue=(_BLACK,),
    )
    return np.asarray(highest, dtype=np.uint8), np.asarray(lowest, dtype=np.uint8)


def _standing_out(own: Sampled, predicted: tuple[Image, Image]) -> tuple[float, float]:
    """How much of a patch (0 to 1) lies above the highest, and below the lowest level that is predicted."""
    level = own.level.astype(np.float32)
    highest, lowest = predicted
    brighter, darker = (level - highest) / _UNIT[highest], (lowest - level) / _UNIT[lowest]
    return _largest(brighter, own.known), _largest(darker, own.known)


def _largest(excess: Floats32, known: Mask) -> float:
    shown = np.clip(excess - np.float32(NUMBERS.usual), 0, 1) * known
    return float(np.max(cv2.blur(shown, _PATCH, borderType=cv2.BORDER_CONSTANT)))
