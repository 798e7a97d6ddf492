"""Unmatched light: a patch of one camera that saturates and is brighter than all that another one shows on its rows.

An opaque light leaves stereo nothing to match, so that what is compared at its disparities does not see it. Nothing is
matched here: the tone curve of the two pictures predicts each level of the other camera, and a patch counts by what it
exceeds all of them by, from far away to as near as `nearest_m`. Stray light in a lens and drops seldom saturate.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from auditor.measurement.checks.light import UNITS, WHITE, CameraLevels, view_of
from auditor.measurement.checks.photometric_consistency import matched_samples
from auditor.measurement.frame_views import FrameViews
from auditor.measurement.parameters import HALF
from auditor.measurement.tone_curve import Classes, Prediction, predict
from auditor.model.arrays import Image, Indices, Mask
from auditor.model.parameters import BY_HAND, parameter

_REAL = "24 frames of three real drives, with discs and faculas painted in (docs/decisions.md): chosen on them"


@dataclass(frozen=True)
class UnmatchedLight:
    """By how much a patch of one camera exceeds all that another one shows on its rows."""

    step_px: int = parameter(4, unit="half px each way, of which one is compared", source=BY_HAND)
    fewest: int = parameter(200, unit="half px that both cameras see, to fit the curve to", source=BY_HAND)
    nearest_m: float = parameter(2.0, unit="m, nearer than which nothing is looked for", source=_REAL)
    beside_px: int = parameter(8, unit="half px further on either side", source=BY_HAND)
    patch_px: int = parameter(24, unit="half px, side of a patch", source=_REAL)
    usual: float = parameter(0.5, unit="times 12 levels and a quarter of the prediction, that is none", source=_REAL)


NUMBERS = UnmatchedLight()
_STEP = NUMBERS.step_px
_NEARBY = np.ones((2 * _STEP - 1, 2 * _STEP - 1), dtype=np.uint8)
_PATCH = (NUMBERS.patch_px // _STEP, NUMBERS.patch_px // _STEP)


@dataclass(frozen=True, eq=False)
class SampledLevels:
    """One camera at every `step_px`-th pixel, (h, w): its `level`, and the `highest` one nearby.

    `known`: it sees all of what is nearby. `saturated`: something there saturates.
    """

    level: Image
    highest: Image
    known: Mask
    saturated: Mask


def measure_unmatched_light(seen: FrameViews, i: int, k: int) -> tuple[float | None, float | None]:
    """How much of a patch, 0 to 1, of the source, and of the reference, is brighter than all that the other one shows.

    None where they see too little together.
    """
    row, column, there = seen.once(matched_samples, i, k, _STEP)
    if row.size < NUMBERS.fewest:
        return None, None
    source, reference = seen.once(view_of, i), seen.once(view_of, k)
    s, t = source.levels[row, there], reference.levels[row, column]
    usable = np.asarray((s < source.saturation) & (t < reference.saturation))
    sampled_i, sampled_k, reach = seen.once(sampled, i), seen.once(sampled, k), _reach(seen, i, k)
    of_source, of_reference = _hues(source, reference), _hues(reference, source)
    to_source = _predicted(sampled_k, predict(t, s, usable, _at(of_reference, row, column)), of_reference)
    to_reference = _predicted(sampled_i, predict(s, t, usable, _at(of_source, row, there)), of_source)
    return (
        _standing_out(sampled_i, _highest_along(to_source, -reach)),
        _standing_out(sampled_k, _highest_along(to_reference, reach)),
    )


def sampled(seen: FrameViews, camera: int) -> SampledLevels:
    """The samples of a camera's levels."""
    view, whole = seen.once(view_of, camera), seen.valid_masks.get(camera)
    highest = np.asarray(cv2.dilate(view.levels, _NEARBY)[::_STEP, ::_STEP], dtype=np.uint8)
    inside = np.ones(highest.shape, dtype=np.bool_)
    if whole is not None:
        inside = cv2.erode(whole[::HALF, ::HALF].astype(np.uint8), _NEARBY)[::_STEP, ::_STEP] > 0
    return SampledLevels(view.levels[::_STEP, ::_STEP], highest, inside, np.asarray(highest >= view.saturation))


def _reach(seen: FrameViews, i: int, k: int) -> int:
    """How many samples a match lies beside its pixel at most."""
    focal_px = seen.rig.camera(k).projection[0, 0] / HALF
    return int(np.ceil(focal_px * seen.rig.baseline_m(i, k) / NUMBERS.nearest_m / _STEP))


def _hues(view: CameraLevels, other: CameraLevels) -> Classes | None:
    """The classes of chroma of a camera by which the levels of another are predicted: of a grey one from colours."""
    return view.classes if view.channels and not other.channels else None


def _at(classes: Classes | None, row: Indices, column: Indices) -> Classes | None:
    return None if classes is None else classes[row, column]


def _predicted(other: SampledLevels, prediction: Prediction, classes: Classes | None) -> Image:
    """The level (h, w) that each sample of the other camera predicts.

    What it does not see is unknown, and what saturates may be brighter.
    """
    predicted = prediction.of(other.highest, None if classes is None else classes[::_STEP, ::_STEP])
    predicted[other.saturated | ~other.known] = WHITE
    return predicted


def _highest_along(predicted: Image, reach: int) -> Image:
    """The highest level (h, w) predicted along rows, of `reach` samples to the left, or to the right below 0.

    What lies beyond the picture is unknown.
    """
    beside = NUMBERS.beside_px // _STEP
    along = np.ones((1, abs(reach) + 2 * beside + 1), dtype=np.uint8)
    anchor, border = (beside + max(reach, 0), 0), cv2.BORDER_CONSTANT
    highest = cv2.dilate(predicted, along, anchor=anchor, borderType=border, borderValue=(int(WHITE),))
    return np.asarray(highest, dtype=np.uint8)


def _standing_out(own: SampledLevels, highest: Image) -> float:
    """How much of a patch that saturates lies above the highest level that is predicted."""
    excess = (own.level.astype(np.float32) - highest) / cv2.LUT(highest, UNITS)
    shown = np.clip(excess - np.float32(NUMBERS.usual), 0, 1) * own.known
    share, saturates = (
        cv2.blur(one, _PATCH, borderType=cv2.BORDER_CONSTANT) for one in (shown, own.saturated.astype(np.float32))
    )
    return float((share * (saturates > 0)).max())
