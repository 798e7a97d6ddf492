"""Which pixels of a camera are brighter or darker than what all other cameras see of the same points."""

from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.measurement.checks.photometric_consistency import PairConsistency
from auditor.measurement.disparity.lidar import LidarView
from auditor.measurement.disparity.stereo import StereoMap
from auditor.measurement.parameters import DAMAGED_PIXELS, GAIN_FIT, HALF
from auditor.measurement.shared_view import Evidence
from auditor.model.checks import Pair
from auditor.model.measurement import REGION_STEP
from auditor.model.rig import Rig

_OPENED = np.ones(DAMAGED_PIXELS.opened_px, dtype=np.uint8)
_CLOSED = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, DAMAGED_PIXELS.closed_px)

Mask = NDArray[np.bool_]
Floats = NDArray[np.float32]


def damaged_pixels(evidence: Evidence, camera: int) -> Mask:
    """(h, w) mask, its pixels REGION_STEP full-resolution ones wide; empty where there is no other camera.

    The other cameras' pictures are warped into this one's by the LiDAR's depths and by stereo's where two pictures are
    alike. What is brighter (or darker) than in all of them by 35 grey levels is marked, gains and offsets fitted, if it
    is larger than a speck; whichever of light and darkness takes the larger area. Pairs with views of their own compare
    there, and each knows only its own depths.
    """
    differences = _brought_back(evidence, camera) if evidence.pairs else _differences(evidence, camera)
    if not differences:
        return np.zeros(_shrunk(evidence.views[camera]).shape, dtype=np.bool_)
    brighter, darker = (_solid(np.nan_to_num(d)) for d in (np.fmin.reduce(differences), -np.fmax.reduce(differences)))
    return brighter if np.count_nonzero(brighter) >= np.count_nonzero(darker) else darker


def _brought_back(evidence: Evidence, camera: int) -> list[Floats]:
    """(h, w) each: what each pair that the camera is in says in its own view, NaN where it does not see."""
    with_it = [(pair.index(camera) + 1, part) for pair, part in evidence.pairs.items() if camera in pair]
    return [
        part.back.values(difference, REGION_STEP)
        for number, part in with_it
        for difference in _differences(part.own, number)
    ]


def _differences(evidence: Evidence, camera: int) -> list[Floats]:
    """(h, w) each: by how much a camera's picture is brighter than another's, warped into it."""
    rig = evidence.rig
    small = {number: _shrunk(half) for number, half in evidence.views.items()}
    still = small[camera].astype(np.float32)
    nearness, sure = _nearness(
        camera, rig, evidence.lidar, evidence.maps, evidence.frame_checks.consistencies, still.shape
    )
    place = np.indices(still.shape).astype(np.float32)
    row, column = place[0], place[1]
    differences = []
    for other, seen in small.items():
        if other != camera:
            there = column - nearness * np.float32(_direction(rig, camera, other) / REGION_STEP)
            warped = cv2.remap(seen, there, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            difference = still - _fitted(warped.astype(np.float32), still, sure)
            if evidence.valid_masks:
                seen_there = cv2.remap(_shrunk_mask(evidence.valid_masks[other]), there, row, cv2.INTER_NEAREST)
                difference[np.minimum(seen_there, _shrunk_mask(evidence.valid_masks[camera])) == 0] = np.nan
            differences.append(difference)
    return differences


def _shrunk_mask(sees: Mask) -> NDArray[np.uint8]:
    return sees[::REGION_STEP, ::REGION_STEP].astype(np.uint8)


def _shrunk(half: NDArray[np.uint8]) -> NDArray[np.uint8]:
    size = (-(-half.shape[1] * HALF // REGION_STEP), -(-half.shape[0] * HALF // REGION_STEP))
    return np.asarray(cv2.resize(half, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


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
) -> tuple[Floats, Mask]:
    """Disparities at a baseline of one metre in a camera's picture, and where that picture was alike to another.

    (h, w) each; what neither the LiDAR nor stereo knows gets the nearest known value.
    """
    known = np.zeros(shape, dtype=np.float32)
    sure = np.zeros(shape, dtype=np.bool_)

    def put(k: int, u: Floats, v: NDArray[np.integer], value: Floats) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Take points of view k over into the camera's picture."""
        moved = u if k == camera else u - value * np.float32(_direction(rig, k, camera))
        column, row = (moved / np.float32(REGION_STEP)).astype(np.intp), (v // REGION_STEP).astype(np.intp)
        inside = (moved >= 0) & (column < shape[1]) & (row < shape[0])
        row, column = row[inside], column[inside]
        known[row, column] = value[inside]
        return row, column

    for k, view in views.items():
        i = next(c.number for c in rig.cameras if c.number != k)
        put(k, view.u_px, view.row, view.disparity_px(i) / np.float32(rig.baseline_m(i, k)))
    for (i, k), stereo in maps.items():
        step, every = HALF // stereo.step, REGION_STEP // HALF
        photometric_consistency = consistencies[i, k]
        consistent = photometric_consistency.comparable & (photometric_consistency.alike > DAMAGED_PIXELS.consistent)
        row, column = np.nonzero(consistent[::every, ::every])
        disparity = stereo.disparity_px[:: step * every, :: step * every][row, column]
        u = (column * REGION_STEP).astype(np.float32)
        place = put(k, u, row * REGION_STEP, disparity / np.float32(rig.baseline_m(i, k)))
        if camera in (i, k):
            sure[place] = True
    missing = (known <= 0).astype(np.uint8)
    if missing.all():
        return known, sure
    _, nearest = cv2.distanceTransformWithLabels(missing, cv2.DIST_L2, 3, labelType=cv2.DIST_LABEL_PIXEL)
    values = np.zeros(int(nearest.max()) + 1, dtype=np.float32)
    values[nearest[missing == 0]] = known[missing == 0]
    return np.asarray(cv2.medianBlur(values[nearest], DAMAGED_PIXELS.median_px), dtype=np.float32), sure


def _fitted(warped: Floats, still: Floats, sure: Mask) -> Floats:
    """The other picture at this camera's gain and offset, learnt where the two are surely alike."""
    of_pairs = sure & (np.maximum(warped, still) < GAIN_FIT.saturated)
    x, y = warped[of_pairs], still[of_pairs]
    if x.size < DAMAGED_PIXELS.gain_fewest:
        return warped
    gain, offset = np.float32(1), np.float32(np.median(y - x))
    keep = int(DAMAGED_PIXELS.gain_kept_share * x.size)
    for _ in range(DAMAGED_PIXELS.gain_rounds):
        best = np.argpartition(np.abs(gain * x + offset - y), keep)[:keep]
        spread = x[best] - x[best].mean()
        gain = np.clip(np.dot(spread, y[best]) / max(np.dot(spread, spread), np.float32(1)), *GAIN_FIT.gains)
        offset = y[best].mean() - gain * x[best].mean()
    return np.asarray(np.clip(gain * warped + offset, 0, 255), dtype=np.float32)


def _solid(difference: Floats) -> Mask:
    """The larger parts of what stands out, without specks and gaps."""
    mark = (cv2.blur(difference, DAMAGED_PIXELS.blur_px) > DAMAGED_PIXELS.differs_by).astype(np.uint8)
    _, part, boxes, _ = cv2.connectedComponentsWithStats(cv2.morphologyEx(mark, cv2.MORPH_OPEN, _OPENED))
    area = boxes[:, cv2.CC_STAT_AREA].copy()
    area[0] = 0  # what is not marked
    kept = area >= max(DAMAGED_PIXELS.smallest, DAMAGED_PIXELS.part_share * area.max())
    return np.asarray(cv2.morphologyEx(kept[part].astype(np.uint8), cv2.MORPH_CLOSE, _CLOSED) > 0)
