"""The agreement of boxes: intersection over union."""

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np

from auditor.lab.evaluation.object_baseline.detectors.interface import Detection, ImageBox, SolidBox
from auditor.model.arrays import Floats


def overlaps(first: Sequence[ImageBox], second: Sequence[ImageBox], reach_px: float = 0.0) -> Floats:
    """(N, M) intersection over union of boxes in two images.

    Where the second image is a source camera's, `reach_px` is the largest disparity: each of its boxes is first shifted
    to the right, by up to that, to where it lies best under the other.
    """
    a, b = _array(first)[:, None], _array(second)[None, :]
    centre_a, centre_b = (a[..., 0] + a[..., 2]) / 2, (b[..., 0] + b[..., 2]) / 2
    shift = np.clip(centre_a - centre_b, 0.0, reach_px)
    width = np.minimum(a[..., 2], b[..., 2] + shift) - np.maximum(a[..., 0], b[..., 0] + shift)
    height = np.minimum(a[..., 3], b[..., 3]) - np.maximum(a[..., 1], b[..., 1])
    return _over_union(np.maximum(width, 0) * np.maximum(height, 0), _area(a), _area(b))


def overlaps_on_ground(first: Sequence[SolidBox], second: Sequence[SolidBox]) -> Floats:
    """(N, M) intersection over union of the boxes' footprints."""
    common = np.zeros((len(first), len(second)))
    for n, a in enumerate(first):
        for m, b in enumerate(second):
            reach = (np.hypot(a.length_m, a.width_m) + np.hypot(b.length_m, b.width_m)) / 2
            if np.hypot(a.x_m - b.x_m, a.z_m - b.z_m) < reach:
                shapes = a.footprint_m.astype(np.float32), b.footprint_m.astype(np.float32)
                common[n, m] = cv2.intersectConvexConvex(*shapes)[0]
    areas = [np.array([box.length_m * box.width_m for box in boxes]) for boxes in (first, second)]
    return _over_union(common, areas[0][:, None], areas[1][None, :])


LEAST_HEIGHT_PX, EDGE_PX, MOST_HIDDEN = 40.0, 2.0, 0.3
"""Objects of scores that are lower, nearer to the edge, or further behind another one need no partner."""


class BestOverlap(NamedTuple):
    """An object's best overlap with one of the other side, and how sure its detector is of it."""

    iou: float
    score: float


def best_partners(
    first: Sequence[Detection],
    second: Sequence[Detection],
    labels_of_first: frozenset[str] | None = None,
    labels_of_second: frozenset[str] | None = None,
    reach_px: float = 0.0,
    size_px: tuple[int, int] | None = None,
) -> tuple[BestOverlap, ...]:
    """For each object that one sensor sees, its overlap with the other's best object; 0 where there is none.

    Labels are what a detector can name, None where it finds objects of any kind; `reach_px` is the largest disparity
    where they are of two images. An object that the other detector
    could not have named needs no partner, and is left out; with `size_px`, width and height of the images, so is one
    that is not plainly seen. Either may be a partner.
    """
    agreement = overlaps([one.box for one in first], [one.box for one in second], reach_px)
    best = [
        *zip(first, agreement.max(axis=1, initial=0.0), [labels_of_second] * len(first), strict=True),
        *zip(second, agreement.max(axis=0, initial=0.0), [labels_of_first] * len(second), strict=True),
    ]
    plain = [*_plainly_seen(first, size_px), *_plainly_seen(second, size_px)]
    return tuple(
        BestOverlap(float(value), one.score)
        for (one, value, known), is_plain in zip(best, plain, strict=True)
        if is_plain and (known is None or one.label in known)
    )


def _plainly_seen(objects: Sequence[Detection], size_px: tuple[int, int] | None) -> list[bool]:
    """Which objects are easy to find in an image, after KITTI: high enough, whole, and hardly behind another one.

    Of two objects the one whose lower edge is lower is taken to be nearer.
    """
    if size_px is None or not objects:
        return [True] * len(objects)
    box = _array([one.box for one in objects])
    whole = (box[:, :2] > EDGE_PX).all(axis=1) & (box[:, 2:] < np.subtract(size_px, EDGE_PX)).all(axis=1)
    common = np.minimum(box[:, None, 2:], box[None, :, 2:]) - np.maximum(box[:, None, :2], box[None, :, :2])
    hidden = np.maximum(common, 0).prod(axis=2) > MOST_HIDDEN * _area(box)[:, None]
    hidden &= box[:, None, 3] < box[None, :, 3]
    plain: list[bool] = (whole & (box[:, 3] - box[:, 1] >= LEAST_HEIGHT_PX) & ~hidden.any(axis=1)).tolist()
    return plain


def suppressed(scores: Floats, agreement: Floats, most: float) -> list[int]:
    """Non-maximum suppression: the positions that stay, the surest first, none over `most` with a surer one."""
    kept: list[int] = []
    for position in np.argsort(-scores, kind="stable"):
        if not kept or agreement[position, kept].max() <= most:
            kept.append(int(position))
    return kept


def _array(boxes: Sequence[ImageBox]) -> Floats:
    return np.array([(box.left, box.top, box.right, box.bottom) for box in boxes], dtype=np.float64).reshape(-1, 4)


def _area(boxes: Floats) -> Floats:
    size: Floats = np.maximum(boxes[..., 2:] - boxes[..., :2], 0).prod(axis=-1)
    return size


def _over_union(common: Floats, first: Floats, second: Floats) -> Floats:
    union = first + second - common
    return np.divide(common, union, out=np.zeros(common.shape), where=union > 0)
