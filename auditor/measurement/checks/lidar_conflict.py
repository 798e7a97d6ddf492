"""LiDAR conflicts: where two cameras agree with each other and disagree with the LiDAR.

An inconsistent pixel (Eq. 2) comes from one of three sensors and does not show which; on clean frames most have other
causes: a surface occluded from one sensor, glass, dark paint, a wrong match. A LiDAR conflict is an inconsistent pixel
that was verified: nothing occludes the point, and the images are consistent at stereo's disparity and less so at the
LiDAR's. A facula on a camera makes images inconsistent at every disparity, so it causes no LiDAR conflict.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auditor.measurement.checks.disparity_error import inconsistent
from auditor.measurement.checks.photometric_consistency import PairConsistency, ncc_at
from auditor.measurement.disparity.lidar import LidarView, visible_to_source
from auditor.measurement.disparity.stereo import StereoMap
from auditor.measurement.parameters import HALF, LIDAR_CONFLICT, MATCHER_RANGE, PATCH_CORRELATION
from auditor.model.arrays import Image, Indices, Mask
from auditor.model.rig import Rig


@dataclass(frozen=True, eq=False)
class VerifiedConflicts:
    """The inconsistent pixels of E_{0,j,k}, verified point by point.

    `row` and `column` (M,) are full-resolution pixels of the view's points. `valid` (M,): the point is seen by both
    cameras, has texture, and its images are consistent at stereo's disparity. `lidar_conflicts` (M,): valid points with
    which the cameras disagree.
    """

    row: NDArray[np.int32]
    column: NDArray[np.int32]
    valid: Mask
    lidar_conflicts: Mask


def verify_conflicts(
    view: LidarView,
    stereo: StereoMap,
    consistency: PairConsistency,
    rig: Rig,
    source: int,
    half_res: tuple[Image, Image],
) -> VerifiedConflicts:
    """Compare DM_{0,k} at a source camera with DM_{j,k}, and keep the inconsistent pixels that the images confirm.

    `half_res` are the half-resolution grey images of the reference and the source, `consistency` compares them.
    """
    d0, place = view.disparity_px(source), view.place(stereo.step, stereo.disparity_px.shape[1])
    valid = stereo.valid.take(place) & stereo.textured.take(place)
    valid &= (view.u_px - d0 >= 1) & (d0 < stereo.range_px - MATCHER_RANGE.margin_px)
    valid &= visible_to_source(view, rig, source, d0)
    ncc_stereo = consistency.ncc.take(view.place(HALF, consistency.ncc.shape[1]))
    valid &= ncc_stereo > PATCH_CORRELATION.consistent
    over = inconsistent(d0, stereo.disparity_px.take(place))
    flagged = np.flatnonzero(valid & over)
    # Under a strong attack most pixels are inconsistent: one of `stride` neighbours is verified for all of them.
    stride = max(-(-flagged.size // LIDAR_CONFLICT.most_verified), 1)
    sample = flagged[::stride]
    ncc_lidar = ncc_at(*half_res, view.row[sample] // HALF, view.column[sample] // HALF, d0[sample] / np.float32(HALF))
    verified = ncc_lidar < ncc_stereo[sample] - np.float32(LIDAR_CONFLICT.clearly_less)
    verified[verified] = ~_occluded(view, stereo, rig, source, sample[verified])
    lidar_conflicts = np.zeros(valid.size, dtype=np.bool_)
    # Points lie in row-major order: those left out are neighbours of the verified one.
    lidar_conflicts[flagged] = verified.repeat(stride)[: flagged.size]
    return VerifiedConflicts(view.row, view.column, valid & (lidar_conflicts | ~over), lidar_conflicts)


def _occluded(view: LidarView, stereo: StereoMap, rig: Rig, source: int, sample: Indices) -> Mask:
    """(S,) mask of points whose beam passes over the surface that stereo sees (free space).

    Stereo sees something nearer than the LiDAR; at its depth z_s = f b / ds the beam runs through a pixel p' whose own
    disparity is smaller than ds by more than 3 px. Then the point is occluded from the cameras, and no sensor is wrong.
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
