"""Patches of one camera that are brighter, or darker, than all that another one shows where they could lie.

An opaque light or an opaque spot leaves stereo nothing to match, so that what is compared at its disparities does not
see it. Nothing is matched here: the tone curve of the two pictures predicts each level of the other camera, and a patch
counts by what it exceeds all of them by, along its rows, from far away to as near as `nearest_m`.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from auditor.measurement.checks.light import View, view_of
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
    usual: float = parameter(1.0, unit="of 12 grey levels and a quarter of what is predicted, that is none", source=_REAL)


NUMBERS = UnmatchedLight()
_NEARBY = np.ones((2 * NUMBERS.step_px - 1, 2 * NUMBERS.step_px - 1), dtype=np.uint8)
_UNIT = np.float32(LIGHT.level) + np.float32(LIGHT.share) * np.arange(256, dtype=np.float32)
_PATCH = (NUMBERS.patch_px // NUMBERS.step_px,) * 2


@dataclass(frozen=True, eq=False)
class Limits:
    """The (h, w) highest and lowest levels of one camera that the other one predicts along the rows of each pixel."""

    highest: Image
    lowest: Image


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
    matches, step = seen.once(consistency_of, i, k).matches, NUMBERS.step_px
    row, column = np.nonzero(matches.seen[::step, ::step])
    if row.size < NUMBERS.fewest:
        return UnmatchedShares((None, None), (None, None))
    row, column = row * step, column * step
    source, reference = seen.once(view_of, i), seen.once(view_of, k)
    there = np.rint(matches.column[row, column]).astype(np.intp).clip(0, source.levels.shape[1] - 1)
    s, t = source.levels[row, there], reference.levels[row, column]
    usable = np.asarray((s < source.saturation) & (t < reference.saturation))
    reach = _reach(seen, i, k)
    of_source = _standing_out(seen, i, source.levels, _limits(seen, k, reference, predict(t, s, usable).table[0], -reach))
    of_reference = _standing_out(seen, k, reference.levels, _limits(seen, i, source, predict(s, t, usable).table[0], reach))
    return UnmatchedShares((of_source[0], of_reference[0]), (of_source[1], of_reference[1]))


def _reach(seen: Seen, i: int, k: int) -> int:
    """How many samples a match lies beside its pixel at most."""
    focal_px = seen.rig.camera(k).projection[0, 0] / HALF
    return int(np.ceil(focal_px * abs(seen.rig.baseline_m(i, k)) / NUMBERS.nearest_m / NUMBERS.step_px))


def _limits(seen: Seen, other: int, view: View, curve: Image, reach: int) -> Limits:
    """What another camera predicts along rows: of up to `reach` samples to the left, or to the right below 0.

    What lies beyond its picture is unknown, and what saturates may be as bright as any.
    """
    unknown = _unknown(seen, other)
    predicted = np.asarray(cv2.LUT(view.levels, curve), dtype=np.uint8)
    brightest = np.where(unknown | (view.levels >= view.saturation), np.uint8(_WHITE), predicted)
    darkest = np.where(unknown, np.uint8(_BLACK), predicted)
    beside = NUMBERS.beside_px // NUMBERS.step_px
    along = np.ones((1, abs(reach) + 2 * beside + 1), dtype=np.uint8)
    anchor = (abs(reach) + beside if reach > 0 else beside, 0)
    border = {"anchor": anchor, "borderType": cv2.BORDER_CONSTANT}
    step = NUMBERS.step_px
    highest = cv2.dilate(cv2.dilate(brightest, _NEARBY)[::step, ::step], along, borderValue=(_WHITE,), **border)
    lowest = cv2.erode(cv2.erode(darkest, _NEARBY)[::step, ::step], along, borderValue=(_BLACK,), **border)
    return Limits(np.asarray(highest, dtype=np.uint8), np.asarray(lowest, dtype=np.uint8))


def _unknown(seen: Seen, camera: int) -> Mask:
    known = seen.known.get(camera)
    return np.zeros(seen.half_res[camera].shape, dtype=np.bool_) if known is None else ~known[::HALF, ::HALF]


def _standing_out(seen: Seen, camera: int, levels: Image, limits: Limits) -> tuple[float, float]:
    """How much of a patch (0 to 1) lies above the highest, and below the lowest level that is predicted."""
    step = NUMBERS.step_px
    own, known = levels[::step, ::step].astype(np.float32), ~_unknown(seen, camera)[::step, ::step]
    return (
        _largest((own - limits.highest) / _UNIT[limits.highest], known),
        _largest((limits.lowest - own) / _UNIT[limits.lowest], known),
    )


def _largest(excess: Floats32, known: Mask) -> float:
    shown = np.clip(excess - np.float32(NUMBERS.usual), 0, 1) * known
    means = cv2.blur(shown, _PATCH, borderType=cv2.BORDER_CONSTANT)
    return float(np.max(means))
