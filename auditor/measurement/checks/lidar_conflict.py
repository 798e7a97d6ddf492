"""Where two cameras agree with each other and contradict the LiDAR.

An inconsistent pixel (Eq. 2) accuses one of three sensors and does not say which; on clean frames most of them accuse
nobody: a surface hidden from one sensor, glass, dark paint, a matcher's mistake. A contradiction is an inconsistent
pixel that survived adjudication: nothing hides the point, and the pictures are alike at stereo's disparity and less so
at the LiDAR's. A facula on a camera makes pictures unlike at every disparity, so it contradicts nothing.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auditor.measurement.checks.disparity_error import inconsistent
from auditor.measurement.checks.photometric_consistency import PairConsistency, ncc_at
from auditor.measurement.disparity.lidar import LidarView, visible_to_source
from auditor.measurement.disparity.stereo import StereoMap
from auditor.measurement.parameters import HALF, LIDAR_CONFLICT, MATCHER_RANGE, PATCH_CORRELATION
from auditor.model.rig import Rig

Mask = NDArray[np.bool_]
Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class VerifiedConflicts:
    """E_{0,j,k} adjudicated, point by point.

    `row` and `column` (M,) are full-resolution pixels of the view's points. `valid` (M,): seen by both cameras, with
    texture, and pictures alike enough at stereo's disparity to say yes or no. `contradicted` (M,): of those, what they
    say of the LiDAR is no.
    """

    row: NDArray[np.int32]
    column: NDArray[np.int32]
    valid: Mask
    lidar_conflicts: Mask


def verify_conflicts(
    view: LidarView,
    stereo: StereoMap,
    alike: PairConsistency,
    rig: Rig,
    source: int,
    half_res: tuple[NDArray[np.uint8], NDArray[np.uint8]],
) -> VerifiedConflicts:
    """Compare DM_{0,k} at a witness with DM_{j,k}, and keep the inconsistent pixels that the pictures confirm.

    `halves` are the half-resolution grey images of the reference and of the witness, `alike` their likeness.
    """
    d0 = view.disparity_px(source)
    row, column = view.row // stereo.step, view.column // stereo.step
    ds = stereo.disparity_px[row, column]
    valid = stereo.valid[row, column] & stereo.textured[row, column]
    valid &= (view.u_px - d0 >= 1) & (d0 < stereo.range_px - MATCHER_RANGE.margin_px)
    valid &= visible_to_source(view, rig, source, d0)
    confident = alike.alike[view.row // HALF, view.column // HALF]
    valid &= confident > PATCH_CORRELATION.consistent
    over = inconsistent(d0, ds)
    flagged = np.flatnonzero(valid & over)
    # Under a strong attack most pixels are inconsistent: every so many-th stands for its neighbours.
    stride = max(-(-flagged.size // LIDAR_CONFLICT.most_verified), 1)
    sample = flagged[::stride]
    n0 = ncc_at(*half_res, view.row[sample] // HALF, view.column[sample] // HALF, d0[sample] / np.float32(HALF))
    guilty = n0 < confident[sample] - np.float32(LIDAR_CONFLICT.clearly_less)
    guilty[guilty] = ~_occluded(view, stereo, rig, source, sample[guilty])
    lidar_conflicts = np.zeros(valid.size, dtype=np.bool_)
    # Points lie in row-major order: those left out are neighbours of the one that stands for them.
    lidar_conflicts[flagged] = guilty.repeat(stride)[: flagged.size]
    return VerifiedConflicts(view.row, view.column, valid & (lidar_conflicts | ~over), lidar_conflicts)


def _occluded(view: LidarView, stereo: StereoMap, rig: Rig, source: int, sample: NDArray[np.intp]) -> Mask:
    """(S,) mask of points whose beam passes over the surface that stereo sees (free space).

    Stereo sees something nearer than the LiDAR; at its depth z_s = f b / ds the beam runs through a pixel p' whose own
    disparity is smaller than ds by more than 3 px. Then the point is hidden from the cameras, and nobody is wrong.
    """
    assert rig.lidar is not None
    camera = rig.camera(view.reference)
    ds = stereo.disparity_px[view.row[sample] // stereo.step, view.column[sample] // stereo.step]
    P = (camera.projection @ rig.lidar.rig_SE3_lidar).astype(np.float32)
    origin, ray = P[:, 3:], P[:, :3] @ view.point_m[sample].T  # homogeneous pixels of O and of X - O
    focal_times_baseline = np.float32(camera.focal_px * rig.baseline_m(source, view.reference))
    depth = focal_times_baseline / np.maximum(ds, np.float32(LIDAR_CONFLICT.smallest_px))
    u, v, w = origin + ray * ((depth - origin[2]) / ray[2])
    column, row = np.rint(u / w / stereo.step).astype(np.intp), np.rint(v / w / stereo.step).astype(np.intp)
    height, width = stereo.disparity_px.shape
    # Where stereo sees something farther than the LiDAR there is nothing to pass over.
    nearer = (depth < ray[2] + origin[2]) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
    there = stereo.disparity_px[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
    return np.asarray(nearer & (there < ds - np.float32(LIDAR_CONFLICT.passes_over_px)))
