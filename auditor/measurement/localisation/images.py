"""The damaged pixels of a camera: brighter or darker than what all other cameras see of the same points."""

from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.measurement.checks.photometric_consistency import PairConsistency
from auditor.measurement.disparity.lidar import LidarView
from auditor.measurement.disparity.stereo import StereoMap
from auditor.measurement.parameters import HALF
from auditor.measurement.shared_view import FrameArrays
from auditor.model.arrays import Floats32, Image, Indices, Mask
from auditor.model.checks import Pair
from auditor.model.measurement import REGION_STEP
from auditor.model.rig import Rig

_CONSISTENT = 0.8  # NCC above which stereo's depth is used
_DIFFERS_BY = 35.0  # grey levels
_BLUR_PX = (3, 3)  # mask px
_OPENED_PX = (5, 5)  # mask px
_CLOSED_PX = (9, 9)  # mask px
_SMALLEST = 30  # mask px of a part
_PART_SHARE = 0.1  # of the largest part
_MEDIAN_PX = 5  # mask px, of the depths
_SATURATED = 250.0  # grey levels from which on a brightness is saturated
_GAINS = (0.5, 2.0)  # the smallest and the largest
_GAIN_ROUNDS = 3  # in each, the pixels that fit best are kept
_GAIN_KEPT_SHARE = 0.7  # of the pixels
_GAIN_FEWEST = 200  # mask px

_OPENED = np.ones(_OPENED_PX, dtype=np.uint8)
_CLOSED = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, _CLOSED_PX)


def damaged_pixels(arrays: FrameArrays, camera: int) -> Mask:
    """(h, w) mask, its pixels REGION_STEP full-resolution ones wide; all False where there is no other camera.

    The other cameras' images are warped into this one's by the LiDAR's depths, and by stereo's where two images are
    consistent. Pixels are marked that are brighter (or darker) than in all of them by 35 grey levels, gains and offsets
    fitted, in parts that are large enough; of brighter and darker the larger area counts. Pairs with views of their own
    are compared there, each by its own depths.
    """
    differences = _warped_differences(arrays, camera) if arrays.pairs else _differences(arrays, camera)
    if not differences:
        return np.zeros(arrays.small_views[camera].shape, dtype=np.bool_)
    brighter, darker = (_solid(np.nan_to_num(d)) for d in (np.fmin.reduce(differences), -np.fmax.reduce(differences)))
    return brighter if np.count_nonzero(brighter) >= np.count_nonzero(darker) else darker


def _warped_differences(arrays: FrameArrays, camera: int) -> list[Floats32]:
    """(h, w) each: the differences in the own views of the camera's pairs, warped; NaN where a pair does not see."""
    with_it = [(pair.index(camera) + 1, part) for pair, part in arrays.pairs.items() if camera in pair]
    return [
        part.to_shared.values(difference, REGION_STEP)
        for number, part in with_it
        for difference in _differences(part.own, number)
    ]


def _differences(arrays: FrameArrays, camera: int) -> list[Floats32]:
    """(h, w) each: by how much a camera's image is brighter than another's, warped into it."""
    rig = arrays.rig
    still = arrays.small_views[camera].astype(np.float32)
    nearness, sure = _nearness(camera, rig, arrays.lidar, arrays.maps, arrays.frame_checks.consistencies, still.shape)
    place = np.indices(still.shape).astype(np.float32)
    row, column = place[0], place[1]
    differences = []
    for other, seen in arrays.small_views.items():
        if other != camera:
            there = column - nearness * np.float32(_direction(rig, camera, other) / REGION_STEP)
            warped = cv2.remap(seen, there, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            difference = still - _fitted(warped.astype(np.float32), still, sure)
            if arrays.valid_masks:
                seen_there = cv2.remap(_shrunk_mask(arrays.valid_masks[other]), there, row, cv2.INTER_NEAREST)
                difference[np.minimum(seen_there, _shrunk_mask(arrays.valid_masks[camera])) == 0] = np.nan
            differences.append(difference)
    return differences


def _shrunk_mask(sees: Mask) -> Image:
    return sees[::REGION_STEP, ::REGION_STEP].astype(np.uint8)


def _direction(rig: Rig, camera: int, other: int) -> float:
    """The baseline in metres, positive where the other camera stands to the right and sees points farther left."""
    return rig.baseline_m(other, camera) if other < camera else -rig.baseline_m(camera, other)


def _nearness(
    camera: int,
    rig: Rig,
    views: Mapping[int, LidarView],
    maps: Mapping[Pair, StereoMap],
    consistencies: Mapping[Pair, PairConsistency],
    shape: tuple[int, ...],
) -> tuple[Floats32, Mask]:
    """Disparities at a baseline of one metre in a camera's image, and where that image is consistent with another.

    (h, w) each; pixels that neither the LiDAR nor stereo measured get the nearest known value.
    """
    nearness = np.zeros(shape, dtype=np.float32)
    sure = np.zeros(shape, dtype=np.bool_)

    def put(k: int, u: Floats32, v: NDArray[np.integer], value: Floats32) -> tuple[Indices, Indices]:
        """Move points of view k into the camera's image."""
        moved = u if k == camera else u - value * np.float32(_direction(rig, k, camera))
        column, row = (moved / np.float32(REGION_STEP)).astype(np.intp), (v // REGION_STEP).astype(np.intp)
        inside = (moved >= 0) & (column < shape[1]) & (row < shape[0])
        row, column = row[inside], column[inside]
        nearness[row, column] = value[inside]
        return row, column

    for k, view in views.items():
        i = next(c.number for c in rig.cameras if c.number != k)
        put(k, view.u_px, view.row, view.disparity_px(i) / np.float32(rig.baseline_m(i, k)))
    for (i, k), stereo in maps.items():
        step, every = HALF // stereo.step, REGION_STEP // HALF
        consistent = consistencies[i, k].comparable & (consistencies[i, k].ncc > _CONSISTENT)
        consistent = consistent[::every, ::every]
        row, column = np.divmod(np.flatnonzero(consistent), consistent.shape[1])
        disparity = stereo.disparity_px[:: step * every, :: step * every][consistent]
        u = (column * REGION_STEP).astype(np.float32)
        place = put(k, u, row * REGION_STEP, disparity / np.float32(rig.baseline_m(i, k)))
        if camera in (i, k):
            sure[place] = True
    missing = (nearness <= 0).astype(np.uint8)
    if missing.all():
        return nearness, sure
    _, nearest = cv2.distanceTransformWithLabels(missing, cv2.DIST_L2, 3, labelType=cv2.DIST_LABEL_PIXEL)
    values = np.zeros(int(nearest.max()) + 1, dtype=np.float32)
    values[nearest[missing == 0]] = nearness[missing == 0]
    return np.asarray(cv2.medianBlur(values[nearest], _MEDIAN_PX), dtype=np.float32), sure


def _fitted(warped: Floats32, still: Floats32, sure: Mask) -> Floats32:
    """The other image at this camera's gain and offset, fitted where the two are consistent."""
    of_pairs = sure & (np.maximum(warped, still) < _SATURATED)
    x, y = warped[of_pairs], still[of_pairs]
    if x.size < _GAIN_FEWEST:
        return warped
    gain, offset = np.float32(1), np.float32(np.median(y - x))
    keep = int(_GAIN_KEPT_SHARE * x.size)
    for _ in range(_GAIN_ROUNDS):
        best = np.argpartition(np.abs(gain * x + offset - y), keep)[:keep]
        spread = x[best] - x[best].mean()
        gain = np.clip(np.dot(spread, y[best]) / max(np.dot(spread, spread), np.float32(1)), *_GAINS)
        offset = y[best].mean() - gain * x[best].mean()
    return np.asarray(np.clip(gain * warped + offset, 0, 255), dtype=np.float32)


def _solid(difference: Floats32) -> Mask:
    """The larger parts of what differs, without small parts and gaps."""
    mark = (cv2.blur(difference, _BLUR_PX) > _DIFFERS_BY).astype(np.uint8)
    _, part, boxes, _ = cv2.connectedComponentsWithStats(cv2.morphologyEx(mark, cv2.MORPH_OPEN, _OPENED))
    area = boxes[:, cv2.CC_STAT_AREA].copy()
    area[0] = 0  # what is not marked
    kept = area >= max(_SMALLEST, _PART_SHARE * area.max())
    return np.asarray(cv2.morphologyEx(kept[part].astype(np.uint8), cv2.MORPH_CLOSE, _CLOSED) > 0)
