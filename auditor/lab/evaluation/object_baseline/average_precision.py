"""A detector's objects against KITTI's labels: which count as hits, which as false, and which do not count.

As in KITTI's object benchmark at its moderate difficulty: an object has to be found where it is at least 25 px high, at
most partly occluded and truncated by 30 % at most. A detection does not count where it matches another object of its
kind or one that is easily mistaken for it, where it lies in a region marked DontCare, and where it is too small.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from auditor.lab.evaluation.object_baseline.detectors import Detection, ImageBox, SolidBox, SolidDetection
from auditor.lab.evaluation.object_baseline.detectors.overlap import overlaps, overlaps_on_ground
from auditor.lab.evaluation.object_baseline.kitti_labels import ObjectLabel
from auditor.model.arrays import Floats

LEAST_IOU_OF_CARS, LEAST_IOU = 0.7, 0.5
_LEAST_HEIGHT_PX = 25.0
_MOST_OCCLUDED = 1
_MOST_TRUNCATED = 0.3
_MISTAKEN_FOR = {"car": {"van"}, "pedestrian": {"person_sitting", "person"}}
_ANYTHING = "dontcare"


@dataclass(frozen=True)
class ScoredObjects:
    """The objects of one kind in one frame: how many are to be found, and the scores and hits of those found.

    `sensor` is the one whose data was used; `iou` is the least overlap of a hit.
    """

    sensor: int
    label: str
    iou: float
    truths: int
    scores: tuple[float, ...]
    hits: tuple[bool, ...]


def score_in_image(
    sensor: int, detections: Sequence[Detection], labels: Sequence[ObjectLabel], kinds: frozenset[str]
) -> list[ScoredObjects]:
    """Boxes in the image against the labelled ones."""
    agreement = overlaps([one.box for one in detections], [ImageBox(*label.box_px) for label in labels])
    shown = [(one.score, one.label or "", one.box) for one in detections]
    return [_score(sensor, kind, shown, labels, agreement) for kind in sorted(kinds)]


def score_on_ground(
    sensor: int,
    detections: Sequence[SolidDetection],
    labels: Sequence[ObjectLabel],
    kinds: frozenset[str],
    seen: Callable[[SolidBox], ImageBox | None],
) -> list[ScoredObjects]:
    """Boxes in space against the labelled ones, seen from above; boxes outside the labelled image are left out."""
    boxes = [(one, box) for one in detections if (box := seen(one.box)) is not None]
    agreement = overlaps_on_ground([one.box for one, _ in boxes], [_solid(label) for label in labels])
    shown = [(one.score, one.label, box) for one, box in boxes]
    return [_score(sensor, kind, shown, labels, agreement) for kind in sorted(kinds)]


def _score(
    sensor: int,
    kind: str,
    detections: Sequence[tuple[float, str, ImageBox]],
    labels: Sequence[ObjectLabel],
    agreement: Floats,
) -> ScoredObjects:
    least = LEAST_IOU_OF_CARS if kind.lower() == "car" else LEAST_IOU
    wanted = [at for at, label in enumerate(labels) if label.kind.lower() == kind.lower() and _is_to_be_found(label)]
    alike = {kind.lower(), *_MISTAKEN_FOR.get(kind.lower(), ())}
    passed = [at for at, label in enumerate(labels) if label.kind.lower() in alike and at not in wanted]
    regions = [ImageBox(*label.box_px) for label in labels if label.kind.lower() == _ANYTHING]
    scores, hits, taken = [], [], set()
    for row, (score, _, box) in sorted(
        ((row, one) for row, one in enumerate(detections) if one[1] == kind), key=lambda one: -one[1][0]
    ):
        partner = _best(agreement[row], [at for at in wanted if at not in taken], least)
        partner = _best(agreement[row], [at for at in passed if at not in taken], least) if partner is None else partner
        if partner is not None:
            taken.add(partner)
        counted = partner in wanted if partner is not None else not _is_ignored(box, regions, least)
        if counted:
            scores.append(score)
            hits.append(partner is not None)
    return ScoredObjects(sensor, kind, least, len(wanted), tuple(scores), tuple(hits))


def _best(agreement: Floats, among: Sequence[int], least: float) -> int | None:
    best = max(among, key=lambda at: agreement[at], default=None)
    return best if best is not None and agreement[best] >= least else None


def _is_to_be_found(label: ObjectLabel) -> bool:
    height = label.box_px[3] - label.box_px[1]
    easy = label.occluded <= _MOST_OCCLUDED and label.truncated <= _MOST_TRUNCATED
    return easy and height >= _LEAST_HEIGHT_PX


def _is_ignored(box: ImageBox, regions: Sequence[ImageBox], least: float) -> bool:
    """True for an object that is too small to be counted, or lies in a region that was not labelled."""
    if box.bottom - box.top < _LEAST_HEIGHT_PX:
        return True
    for region in regions:
        width = min(box.right, region.right) - max(box.left, region.left)
        height = min(box.bottom, region.bottom) - max(box.top, region.top)
        if max(width, 0.0) * max(height, 0.0) >= least * box.area:
            return True
    return False


def _solid(label: ObjectLabel) -> SolidBox:
    height, width, length = np.maximum(label.size_m, 0.0).tolist()  # -1 where a region has no place in space
    return SolidBox(*label.place_m, length_m=length, width_m=width, height_m=height, yaw_rad=label.yaw_rad)
