"""LiDAR conflicts: where two cameras agree with each other and disagree with the LiDAR.

An inconsistent pixel (Eq. 2) comes from one of three sensors and does not show which; on clean frames most have other
causes: a surface occluded from one sensor, glass, dark paint, a wrong match. A LiDAR conflict is an inconsistent pixel
that was verified: nothing occludes the point, and the images are consistent at stereo's disparity and less so at the
LiDAR's. A facula on a camera makes images inconsistent at every disparity, so it causes no LiDAR conflict.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auditor.measurement.checks.photometric_consistency import PairConsistency, consistency_of, ncc_at
from auditor.measurement.count_grid import cells_of_directions
from auditor.measurement.disparity.disparity_error import inconsistent
from auditor.measurement.disparity.lidar import LidarView, visible_to_source
from auditor.measurement.disparity.stereo import StereoMap
from auditor.measurement.frame_views import FrameViews
from auditor.measurement.parameters import COUNT_GRID, HALF, LIDAR_CONFLICT, MATCHER_RANGE, PATCH_CORRELATION
from auditor.measurement.point_parameters import FALSE_RANGES, LOST_RETURNS
from auditor.model.arrays import Floats32, Image, Indices, Mask
from auditor.model.measurement import Cells
from auditor.model.rig import Rig


@dataclass(frozen=True, eq=False)
class PointVotes:
    """What a pair says of each point of a view, (M,) masks.

    `clear`: both cameras see it, and their images match fairly there, textured or not, and not where the matcher's
    range ends. Of these `confirmed` agree with stereo, and `contradicted` are nearer, and the images match less well at
    the LiDAR's disparity.
    """

    clear: Mask
    confirmed: Mask
    contradicted: Mask


@dataclass(frozen=True, eq=False)
class VerifiedConflicts:
    """The inconsistent pixels of E_{0,j,k}, verified point by point.

    `row` and `column` (M,) are full-resolution pixels of the view's points. `valid` (M,): the point is seen by both
    cameras, has texture, and its images are consistent at stereo's disparity. `lidar_conflicts` (M,): valid points with
    which the cameras disagree. `votes` are those on a view's own points.
    """

    row: NDArray[np.int32]
    column: NDArray[np.int32]
    valid: Mask
    lidar_conflicts: Mask
    votes: PointVotes | None = None


def verify_conflicts(
    view: LidarView,
    stereo: StereoMap,
    consistency: PairConsistency,
    rig: Rig,
    source: int,
    half_res: tuple[Image, Image],
) -> VerifiedConflicts:
    """Compare DM_{0,k} at a source camera with DM_{j,k}, and keep the inconsistent pixels that the images confirm.

    A point nearer than the matcher searches conflicts as any other does: the images are compared at its disparity, and
    what is there matches there. `half_res` are the half-resolution grey images of the reference and the source,
    `consistency` compares them.
    """
    d0, place = view.disparity_px(source), view.place(stereo.step, stereo.disparity_px.shape[1])
    seen = stereo.valid.take(place) & (view.u_px - d0 >= 1)
    seen &= visible_to_source(view, rig, source, d0)
    ncc_stereo = consistency.ncc.take(view.place(HALF, consistency.ncc.shape[1]))
    ds = stereo.disparity_px.take(place)
    over = inconsistent(d0, ds)
    images_mirror, lidar_mirrors = (over & one for one in _mirrored(view, d0, ds))
    seen &= ~images_mirror
    over &= ~images_mirror

    valid = seen & ~lidar_mirrors & stereo.textured.take(place) & (ncc_stereo > PATCH_CORRELATION.consistent)
    clear = seen & (d0 < stereo.range_px - MATCHER_RANGE.margin_px)
    clear &= (ncc_stereo > FALSE_RANGES.consistent) & (ds >= LIDAR_CONFLICT.smallest_px)
    conflicting, nearer = _Candidates.of(valid & over), _Candidates.of(clear & over & (d0 > ds))
    # Most candidates are those of both questions.
    every = np.flatnonzero(np.bincount(np.concatenate([conflicting.sample, nearer.sample])))
    ncc_lidar = ncc_at(*half_res, view.row[every] // HALF, view.column[every] // HALF, d0[every] / np.float32(HALF))

    def confirmed(candidates: _Candidates, clearly_less: float) -> Mask:
        """(M,) those of the candidates where the images match clearly less well at the LiDAR's disparity."""
        sample = candidates.sample
        less = ncc_lidar[np.searchsorted(every, sample)] < ncc_stereo[sample] - np.float32(clearly_less)
        less[less] = ~_occluded(view, stereo, rig, source, sample[less])
        return candidates.all_by(less, valid.size)

    lidar_conflicts = confirmed(conflicting, LIDAR_CONFLICT.clearly_less)
    contradicted = confirmed(nearer, FALSE_RANGES.clearly_less)
    valid &= lidar_conflicts | ~over
    votes = PointVotes(clear, clear & ~over, contradicted)
    return VerifiedConflicts(view.row, view.column, valid, lidar_conflicts, votes)


def cells_of_points(conflicts: VerifiedConflicts, view: LidarView) -> Cells:
    """Count LiDAR points, valid and in conflict, by their direction from the LiDAR in the rig's axes."""
    row, column, inside = view.directions
    valid = np.flatnonzero(inside & conflicts.valid)
    return cells_of_directions(row.take(valid), column.take(valid), conflicts.lidar_conflicts.take(valid))


def verified(seen: FrameViews, j: int, k: int) -> VerifiedConflicts:
    """The verified conflicts of a pair."""
    consistency = seen.once(consistency_of, j, k)
    return verify_conflicts(seen.views[k], seen.maps[j, k], consistency, seen.rig, j, seen.halves(j, k))


def measure_lidar_conflict(seen: FrameViews, j: int, k: int) -> Cells:
    """The points of k's view, and those with which a pair disagrees."""
    return cells_of_points(seen.once(verified, j, k), seen.views[k])


class _Candidates(NamedTuple):
    """The numbers of points that are to be verified, of which one of `stride` neighbours is, for all of them.

    Under a strong attack most pixels are inconsistent.
    """

    flagged: Indices
    stride: int

    @classmethod
    def of(cls, candidates: Mask) -> "_Candidates":
        """Those of (M,) points."""
        flagged = np.flatnonzero(candidates)
        return cls(flagged, max(-(-flagged.size // LIDAR_CONFLICT.most_verified), 1))

    @property
    def sample(self) -> Indices:
        """Those that are verified."""
        return self.flagged[:: self.stride]

    def all_by(self, of_sample: Mask, points: int) -> Mask:
        """(points,) what all are by what those of the sample are."""
        conflicts = np.zeros(points, dtype=np.bool_)
        # Points lie in row-major order: those left out are neighbours of the verified one.
        conflicts[self.flagged] = of_sample.repeat(self.stride)[: self.flagged.size]
        return conflicts


def _mirrored(view: LidarView, d0: Floats32, ds: Floats32) -> tuple[Mask, Mask]:
    """(M,) masks of the points where wet ground mirrors: stereo sees what lies below the road, or the LiDAR does.

    The other one sees the road there, or what lies below it.
    """
    rig, camera = view.rig, view.rig.camera(view.reference)
    assert rig.lidar is not None
    eye_m = camera.centre_m[1] - rig.lidar.rig_SE3_lidar[1, 3].astype(np.float32)
    farther = d0 / np.maximum(ds, np.float32(LIDAR_CONFLICT.smallest_px))
    of_images = eye_m + (view.below_m - eye_m) * farther
    upper, lower = (view.road_m + side * LOST_RETURNS.above_road_m for side in (-1, 1))
    of_images_below = (view.below_m > upper) & (of_images > lower)
    return of_images_below, (of_images > upper) & (view.below_m > lower) & _beside_road(view, upper, lower)


def _beside_road(view: LidarView, upper_m: float, lower_m: float) -> Mask:
    """(M,) mask of the points in whose strip of directions more returns are the road's than lie below it.

    Where a sector is shifted none is.
    """
    columns = COUNT_GRID.lidar_cells[1]
    strip = np.clip(view.directions[1], 0, columns - 1)
    below = view.below_m > lower_m
    on_road = (view.below_m > upper_m) & ~below
    some, others = (np.bincount(strip[mask], minlength=columns) for mask in (on_road, below))
    return np.asarray((some > others)[strip])


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
