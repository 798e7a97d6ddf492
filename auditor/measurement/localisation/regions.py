"""Regions: the portion of its image or cloud that would be damaged if a sensor is attacked."""

from collections.abc import Collection, Iterator

import cv2
import numpy as np

from auditor.measurement.checks.lidar_conflict import VerifiedConflicts
from auditor.measurement.disparity.lidar import LidarView
from auditor.measurement.localisation.images import damaged_pixels
from auditor.measurement.localisation.points import among, damaged_points, solid_around, things
from auditor.measurement.pairwise_views import OF_TWO
from auditor.measurement.shared_view import FrameArrays
from auditor.model.arrays import Mask, Points
from auditor.model.measurement import REGION_STEP, Region
from auditor.model.rig import LIDAR, Rig

_NO_BOX = (0, 0, 0, 0)


def localise(arrays: FrameArrays, sensors: Collection[int], rig: Rig) -> tuple[Region, ...]:
    """The regions of the `sensors` that may be attacked, in the pictures that people see: see `shown_rectification`.

    Which of them is attacked is only known once a frame is judged with its neighbours. `rig` is the recording's. A
    camera's region is what other cameras see otherwise: a lone camera has none. Where no camera looks each thing that a
    LiDAR or its last scan says is not there is a region, a solid without pixels.
    """
    if not rig.cameras:
        return tuple(_of_clouds(arrays, sensors, rig))
    shown = rig if rig.is_rectified else arrays.rig
    cameras = [camera for camera in sorted(arrays.views) if camera in sensors and rig.n > 1]
    regions = [_of_camera(arrays, camera, shown) for camera in cameras]
    if LIDAR in sensors and arrays.lidar:
        regions += [_of_lidar(arrays, shown), *_beside_views(arrays)]
    return tuple(region for region in regions if region)


def _of_camera(arrays: FrameArrays, camera: int, shown: Rig) -> Region | None:
    mask = damaged_pixels(arrays, camera)
    return _region(camera, camera, mask, float(mask.mean()), shown) if mask.any() else None


def _of_clouds(arrays: FrameArrays, sensors: Collection[int], rig: Rig) -> Iterator[Region]:
    for (sensor, by), (points, returns) in arrays.frame_checks.disputed.items():
        if sensor in sensors:
            yield from _of_things(points, returns, sensor, by, rig.alone(sensor))


def _of_things(points: Points, returns: int, sensor: int, by: int, rig: Rig) -> Iterator[Region]:
    for thing in things(points, rig):
        yield Region(sensor, by, _NO_BOX, len(thing) / returns, b"", len(thing), solid_around(thing, rig))


def _beside_views(arrays: FrameArrays) -> Iterator[Region]:
    """What its last scan says of the LiDAR's points that no camera sees."""
    points = arrays.frame_checks.from_nowhere
    if points is not None and len(points) and arrays.cloud is not None:
        seen = np.logical_or.reduce([among(points, view.point_m) for view in arrays.lidar.values()])
        yield from _of_things(points[~seen], len(arrays.cloud.xyz_m), LIDAR, LIDAR, arrays.rig)


def _of_lidar(arrays: FrameArrays, shown: Rig) -> Region | None:
    k, rig = max(arrays.lidar), arrays.rig
    view = arrays.lidar[k]
    verified_conflicts = _verified_conflicts(arrays, k)
    damaged = (
        damaged_points(view, verified_conflicts, rig) if verified_conflicts else np.zeros(view.row.size, dtype=np.bool_)
    )
    if (from_nowhere := arrays.frame_checks.from_nowhere) is not None and len(from_nowhere):
        damaged |= among(view.point_m, from_nowhere)
    if not damaged.any():
        return None
    mask = _pixels(view, damaged, rig)
    region = _region(LIDAR, k, mask, float(damaged.mean()), shown)
    points = int(np.count_nonzero(damaged))
    return Region(LIDAR, k, region.box_px, region.share, region.mask, points, solid_around(view.point_m[damaged], rig))


def _verified_conflicts(arrays: FrameArrays, k: int) -> list[VerifiedConflicts]:
    """The verified conflicts of all pairs in view k; those of a pair's own view are found there by their points."""
    if not arrays.pairs:
        return [points for (_, of), points in arrays.frame_checks.verified_conflicts.items() if of == k]
    view = arrays.lidar[k]
    own = [part.own for (_, of), part in arrays.pairs.items() if of == k]
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


def _region(sensor: int, view: int, mask: Mask, share: float, shown: Rig) -> Region:
    camera = shown.camera(view)
    size = -(-camera.width_px // REGION_STEP), -(-camera.height_px // REGION_STEP)
    if mask.shape[::-1] != size:  # of enlarged pictures: a pixel is damaged where a part of it is
        mask = np.asarray(cv2.resize(mask.astype(np.float32), size, interpolation=cv2.INTER_AREA)) > 0
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    box = (
        int(columns[0]) * REGION_STEP,
        int(rows[0]) * REGION_STEP,
        min((int(columns[-1]) + 1) * REGION_STEP, camera.width_px),
        min((int(rows[-1]) + 1) * REGION_STEP, camera.height_px),
    )
    _, png = cv2.imencode(".png", mask.astype(np.uint8) * 255, [cv2.IMWRITE_PNG_BILEVEL, 1])
    return Region(sensor, view, box, share, png.tobytes())
