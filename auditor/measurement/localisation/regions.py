"""Where in its image or cloud each sensor under suspicion would be damaged."""

from collections.abc import Collection, Iterable
from itertools import combinations

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.measurement.checks.lidar_conflict import VerifiedConflicts
from auditor.measurement.disparity.lidar import LidarView
from auditor.measurement.localisation.images import damaged_pixels
from auditor.measurement.localisation.points import among, damaged_points, solid_around
from auditor.measurement.pairwise_views import OF_TWO
from auditor.measurement.shared_view import Evidence
from auditor.model.checks import Check, Pair, PairCheck
from auditor.model.measurement import REGION_STEP, Region
from auditor.model.rig import LIDAR, Rig

Mask = NDArray[np.bool_]


def localise(evidence: Evidence, raised: Collection[PairCheck]) -> tuple[Region, ...]:
    """The regions of the sensors that may be attacked, given the elements that thresholds could raise.

    Which of them is attacked is only known once a frame is judged with its neighbours.
    """
    rig = evidence.rig
    regions = [_of_camera(evidence, camera) for camera in suspects(raised, tuple(evidence.views))]
    if any(pair_check.check is Check.LIDAR_CONFLICT for pair_check in raised):
        regions.append(_of_lidar(evidence, rig))
    return tuple(region for region in regions if region)


def suspects(raised: Iterable[PairCheck], cameras: Collection[int]) -> tuple[int, ...]:
    """The cameras of the smallest sets that touch every pair raised by what cameras see."""
    pairs: set[Pair] = {
        (e.i, e.k) for e in raised if e.check in (Check.PHOTOMETRIC_INCONSISTENCY, Check.BRIGHTNESS_DIFFERENCE)
    }
    for size in range(len(cameras) + 1):
        sets = [s for s in combinations(sorted(cameras), size) if all(i in s or k in s for i, k in pairs)]
        if sets:
            return tuple(sorted(set().union(*sets)))
    return ()


def _of_camera(evidence: Evidence, camera: int) -> Region | None:
    mask = damaged_pixels(evidence, camera)
    return _region(camera, camera, mask, float(mask.mean()), evidence.rig) if mask.any() else None


def _of_lidar(evidence: Evidence, rig: Rig) -> Region | None:
    k = max(evidence.lidar)
    view = evidence.lidar[k]
    verified_conflicts = _verified_conflicts(evidence, k)
    damaged = (
        damaged_points(view, verified_conflicts, rig) if verified_conflicts else np.zeros(view.row.size, dtype=np.bool_)
    )
    if not damaged.any():
        return None
    mask = _pixels(view, damaged, rig)
    region = _region(LIDAR, k, mask, float(damaged.mean()), rig)
    points = int(np.count_nonzero(damaged))
    return Region(LIDAR, k, region.box_px, region.share, region.mask, points, solid_around(view.point_m[damaged], rig))


def _verified_conflicts(evidence: Evidence, k: int) -> list[VerifiedConflicts]:
    """What pairs say of the LiDAR's points in view k; those with views of their own say it of the same points there."""
    if not evidence.pairs:
        return [points for (_, of), points in evidence.frame_checks.verified_conflicts.items() if of == k]
    view = evidence.lidar[k]
    own = [part.own for (_, of), part in evidence.pairs.items() if of == k]
    of_pairs = [
        (one.lidar[OF_TWO[1]], points) for one in own for points in one.frame_checks.verified_conflicts.values()
    ]
    return [
        VerifiedConflicts(
            view.row,
            view.column,
            valid=among(view.point_m, seen.point_m[points.valid]),
            lidar_conflicts=among(view.point_m, seen.point_m[points.lidar_conflicts]),
        )
        for seen, points in of_pairs
    ]


def _pixels(view: LidarView, damaged: Mask, rig: Rig) -> Mask:
    """The mask of the pixels that hold these points."""
    camera = rig.camera(view.reference)
    mask = np.zeros((-(-camera.height_px // REGION_STEP), -(-camera.width_px // REGION_STEP)), dtype=np.bool_)
    mask[view.row[damaged] // REGION_STEP, view.column[damaged] // REGION_STEP] = True
    return mask


def _region(sensor: int, view: int, mask: Mask, share: float, rig: Rig) -> Region:
    camera = rig.camera(view)
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    box = (
        int(columns[0]) * REGION_STEP,
        int(rows[0]) * REGION_STEP,
        min((int(columns[-1]) + 1) * REGION_STEP, camera.width_px),
        min((int(rows[-1]) + 1) * REGION_STEP, camera.height_px),
    )
    _, png = cv2.imencode(".png", mask.astype(np.uint8) * 255, [cv2.IMWRITE_PNG_BILEVEL, 1])
    return Region(sensor, view, box, share, png.tobytes())
