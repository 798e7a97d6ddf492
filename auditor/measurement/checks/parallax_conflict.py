"""Parallax conflicts: where a camera's pictures of two moments agree with each other and not with the LiDAR.

A camera that moves sees a scene from two places. The LiDAR's range of a point says where the camera saw it a moment
ago: somewhere on the point's epipolar line. A parallax conflict is a point whose surroundings are found elsewhere on
that line, clearly better. Where the vehicle stands, at the focus of expansion and without texture nothing is compared.

What moves by itself is found elsewhere, too. The LiDAR saw it a moment ago as well: a group of conflicts whose
pictures fit one rigid thing, that moved as far towards the camera or away from it as the LiDAR says, is none.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import nan
from typing import NamedTuple

import cv2
import numpy as np

from auditor.measurement.checks.lidar_conflict import VerifiedConflicts
from auditor.measurement.disparity.half_resolution import halve
from auditor.measurement.disparity.lidar import LidarView
from auditor.measurement.disparity.stereo import textured
from auditor.measurement.ego_motion import Motion, ego_motion, pixels_of
from auditor.measurement.parameters import HALF, PATCH_CORRELATION
from auditor.measurement.time_parameters import PARALLAX_CONFLICT
from auditor.model.arrays import Floats, Floats32, Image, Indices, Mask
from auditor.model.optics.geometry import Matrix
from auditor.model.rig import Camera

_RADIUS = PARALLAX_CONFLICT.patch_px // 2
_DOWN, _RIGHT = (axis.ravel().astype(np.float32) for axis in np.mgrid[-_RADIUS : _RADIUS + 1, -_RADIUS : _RADIUS + 1])
_BESIDE = PARALLAX_CONFLICT.beside_px
_SECOND_NS = 10**9
_OFFSETS = np.arange(-PARALLAX_CONFLICT.farther_px, PARALLAX_CONFLICT.nearer_px + 1)
_MIDDLE = (1 / HALF - 1) / 2
_HALVED = np.array([[1 / HALF, 0, _MIDDLE], [0, 1 / HALF, _MIDDLE], [0, 0, 1]])
"""From pixels to half px, whose middles lie between those of two pixels."""
_NEARBY = np.ones(PARALLAX_CONFLICT.nearby_px, dtype=np.uint8)


class _Least(NamedTuple):
    """The NCC above which a point is found elsewhere, and by how much it has to be above that at its range."""

    consistent: float
    above: float


_WHOLE = _Least(PARALLAX_CONFLICT.consistent, PARALLAX_CONFLICT.clearly_less)
_COARSER = _Least(PARALLAX_CONFLICT.halved_consistent, PARALLAX_CONFLICT.halved_clearly_less)


@dataclass(frozen=True, eq=False)
class Moment:
    """What one frame holds for the next: a camera's grey image (H, W), and the LiDAR's view of that camera."""

    stamp_ns: int
    grey: Image
    view: LidarView

    @property
    def camera(self) -> Camera:
        """The camera."""
        return self.view.rig.camera(self.view.reference)

    def after_s(self, before: "Moment") -> float:
        """The seconds from another moment to this one."""
        return (self.stamp_ns - before.stamp_ns) / _SECOND_NS

    def follows(self, before: "Moment") -> bool:
        """Whether the other moment is earlier, and not too long ago to be compared with."""
        return 0 < self.after_s(before) <= PARALLAX_CONFLICT.most_s

    @cached_property
    def half(self) -> Image:
        """(h, w) the image at half resolution."""
        return halve(self.grey)

    def halved(self, times: int) -> Image:
        """The image, halved so many times."""
        return self.grey if not times else self.half if times == 1 else halve(self.halved(times - 1))

    @cached_property
    def point_m(self) -> Matrix:
        """(M, 3) the view's points in the camera's frame."""
        assert self.view.rig.lidar is not None
        rig_m = self.view.point_m.astype(np.float64) @ self.view.rig.lidar.rig_SE3_lidar[:3, :3].T
        rig_m += self.view.rig.lidar.rig_SE3_lidar[:3, 3] - self.camera.centre_m
        return np.asarray(rig_m @ self.camera.rotation.T)

    @cached_property
    def nearest_m(self) -> Floats32:
        """(h, w) the depth of the nearest point around each half px; inf where there is none."""
        depth = np.full(self.half.shape, np.inf, dtype=np.float32)
        place = self.view.place(HALF, self.half.shape[1])
        np.minimum.at(depth.ravel(), place, self.point_m[:, 2].astype(np.float32))
        return np.asarray(cv2.erode(depth, _NEARBY), dtype=np.float32)


@dataclass(frozen=True, eq=False)
class _Sought:
    """P points of the view now, and where their surroundings should be in the picture of a moment ago.

    `point` are their numbers in the view, `pixel` (P, 2) where they are now, `predicted` (P, 2) where the LiDAR's range
    puts them, `along` (P, 2) the direction in which nearer ones would lie, `parallax_px` (P,) how far they moved by
    their range alone, and `approached` (P,) by what share of their depth the camera came nearer.
    """

    point: Indices
    point_m: Matrix
    pixel: Floats
    predicted: Floats
    along: Floats
    parallax_px: Floats
    approached: Floats

    def chosen(self, some: Indices | slice) -> "_Sought":
        """Some of them."""
        return _Sought(*(getattr(self, name)[some] for name in self.__dataclass_fields__))

    @cached_property
    def halvings(self) -> Indices:
        """(P,) how many times the pictures are halved for each point."""
        return _halvings(self.parallax_px)

    def halved(self, times: int) -> "_Sought":
        """The same in pixels of pictures that are halved so many times."""
        if not times:
            return self
        scale = HALF**times
        pixel, predicted = ((one + 1 / 2) / scale - 1 / 2 for one in (self.pixel, self.predicted))
        return replace(self, pixel=pixel, predicted=predicted, parallax_px=self.parallax_px / scale)


class Compared(NamedTuple):
    """The points, compared with a picture of a moment ago, and how the camera moved since.

    `moved_m` is how far; NaN where that is not known.
    """

    points: VerifiedConflicts
    moved_m: float
    motion: Motion | None = None


def parallax_conflicts(now: Moment, before: Moment | None, expected: Motion | None = None) -> Compared:
    """Compare the LiDAR's points in a camera's view with that camera's picture of a moment ago.

    `expected` is how the camera should have moved since, by how it moved before.
    No point is valid where there is no such picture, it is too old, or the camera's motion cannot be told.
    """
    view, moved_m, motion = now.view, nan, None
    valid, conflicts = (np.zeros(view.row.size, dtype=np.bool_) for _ in range(2))
    row, column = view.row // HALF, view.column // HALF
    some = np.flatnonzero(textured(now.half)[row, column])
    if before is not None and now.follows(before) and before.half.shape == now.half.shape:
        K = _HALVED @ now.camera.intrinsics
        motion = ego_motion(now.half, before.half, K, now.point_m[some], (row[some], column[some]), expected)
        if motion is not None:
            moved_m = float(np.linalg.norm(motion.translation_m))
            sought = _seen_before(now, some, motion)
            agrees, found, place = _compared(now, before, sought)
            things = sought.chosen(found)
            valid[sought.point[agrees]] = True
            conflicts[things.point[~_moving(before, things, place)]] = True
    return Compared(VerifiedConflicts(view.row, view.column, valid | conflicts, conflicts), moved_m, motion)


def _seen_before(now: Moment, some: Indices, motion: Motion) -> _Sought:
    """Where some points of the view lie in the picture before, if they stand; those with enough parallax."""
    K, point_m = now.camera.intrinsics, now.point_m[some]
    turned = point_m @ motion.rotation.T
    moved = turned + motion.translation_m
    with np.errstate(divide="ignore", invalid="ignore"):
        predicted = pixels_of(K, moved)
        away = predicted - pixels_of(K, turned)
    parallax_px = np.hypot(*away.T)
    margin = (_RADIUS * HALF ** _halvings(parallax_px))[:, None]
    inside = (predicted > margin).all(axis=1) & (predicted < np.array(now.grey.shape[::-1]) - margin - 1).all(axis=1)
    inside &= (parallax_px >= PARALLAX_CONFLICT.least_px) & (moved[:, 2] > PARALLAX_CONFLICT.nearest_m)
    kept = np.flatnonzero(inside)
    kept = kept[:: max(-(-kept.size // PARALLAX_CONFLICT.most_points), 1)]
    return _Sought(
        some[kept],
        point_m[kept],
        pixels_of(K, point_m[kept]),
        predicted[kept],
        away[kept] / parallax_px[kept, None],
        parallax_px[kept],
        motion.translation_m[2] / turned[kept, 2],
    )


def _halvings(parallax_px: Floats) -> Indices:
    """(P,) how many times the pictures are halved to compare points of some parallax.

    What is near and beside the way crosses the picture: errors of its range and of the motion are of more pixels then,
    and so is what has to be tried.
    """
    with np.errstate(invalid="ignore"):
        times = np.ceil(np.log2(np.maximum(parallax_px / PARALLAX_CONFLICT.halved_from_px, 1)))
    return np.nan_to_num(np.minimum(times, PARALLAX_CONFLICT.most_halved)).astype(np.intp)


def _compared(now: Moment, before: Moment, sought: _Sought) -> tuple[Indices, Indices, Floats]:
    """The points that agree with the picture before, those found elsewhere on their lines, and where these are."""
    agree, found, place = [], [], []
    for times in np.unique(sought.halvings).tolist():
        some = np.flatnonzero(sought.halvings == times)
        agrees, elsewhere, there = _compared_at(
            now.halved(times), before.halved(times), sought.chosen(some).halved(times), _COARSER if times else _WHOLE
        )
        agree.append(some[agrees])
        found.append(some[elsewhere])
        place.append((there + 1 / 2) * HALF**times - 1 / 2 if times else there)
    none = np.zeros(0, dtype=np.intp)
    return np.concatenate([none, *agree]), np.concatenate([none, *found]), np.concatenate([np.zeros((0, 2)), *place])


def _compared_at(now: Image, before: Image, sought: _Sought, least: "_Least") -> tuple[Indices, Indices, Floats]:
    """As `_compared`, in two pictures (H, W)."""
    patches, norms = _patches(now, sought.pixel)
    beside = {o: _ncc(patches, norms, before, sought, o) for o in range(-_BESIDE, _BESIDE + 1)}
    at_range = np.max([*beside.values()], axis=0)
    # Elsewhere NCC is 1 at most. Those of most parallax go first: what has enough for an offset lies side by side.
    doubtful = np.flatnonzero(at_range < 1 - PARALLAX_CONFLICT.clearly_less)
    order = np.argsort(-sought.parallax_px[doubtful], kind="stable")
    these = doubtful[order]
    known = {o: ncc[these] for o, ncc in beside.items()}
    found_best, found_at = _best_elsewhere(patches[these], norms[these], before, sought.chosen(these), known)
    best, offset = np.empty_like(found_best), np.empty_like(found_at)
    best[order], offset[order] = found_best, found_at
    elsewhere = best > np.maximum(least.consistent, at_range[doubtful] + least.above)
    agrees = at_range > PARALLAX_CONFLICT.agreeing
    agrees[doubtful[elsewhere]] = False
    found = doubtful[elsewhere]
    place = sought.predicted[found] + offset[elsewhere, None] * sought.along[found]
    return np.flatnonzero(agrees), found, place


def _best_elsewhere(
    patches: Floats32, norms: Floats32, before: Image, sought: _Sought, known: Mapping[int, Floats32]
) -> tuple[Floats32, Floats]:
    """(P,) the largest NCC on the points' lines, not at the LiDAR's range, and how many px from there it is.

    No farther away than the point at infinity. The points come in the order of their parallax, the largest first;
    their NCC is `known` at some offsets.
    """
    found = np.full((_OFFSETS.size, sought.point.size), -1, dtype=np.float32)
    for step, offset in enumerate(_OFFSETS.tolist()):
        some = slice(np.count_nonzero(sought.parallax_px + offset >= -1))
        if offset in known:
            found[step, some] = known[offset][some]
        elif some.stop:
            found[step, some] = _ncc(patches[some], norms[some], before, sought.chosen(some), offset)
    elsewhere = np.where(np.abs(_OFFSETS[:, None]) <= _BESIDE, np.float32(-1), found)
    best = elsewhere.argmax(axis=0)
    return elsewhere.max(axis=0, initial=-1), _OFFSETS[best] + _between(found, best)


def _between(ncc: Floats32, best: Indices) -> Floats:
    """(P,) by how much the peak of a parabola through a best NCC and its neighbours lies beside it.

    It is half a step at most. `ncc` is (offsets, P).
    """
    middle, points = np.clip(best, 1, len(ncc) - 2), np.arange(best.size)
    lower, at, upper = ncc[middle - 1, points], ncc[middle, points], ncc[middle + 1, points]
    curvature = lower - 2 * at + upper
    is_peak = (curvature < 0) & (middle == best) & (np.minimum(lower, upper) > -1)
    beside = (lower - upper) / np.where(is_peak, curvature, np.float32(-1)) / 2
    return np.where(is_peak, np.clip(beside, -1 / 2, 1 / 2), 0.0)


def _ncc(patches: Floats32, norms: Floats32, before: Image, sought: _Sought, offset: int) -> Floats32:
    """(P,) the NCC of patches now with the picture before, `offset` px from where the LiDAR's range puts them.

    What came nearer was smaller a moment ago.
    """
    nearness = (sought.parallax_px + offset) / sought.parallax_px
    scale = 1 / np.maximum(1 + nearness * sought.approached, 1 / PARALLAX_CONFLICT.most_grown)
    others, other_norms = _patches(before, sought.predicted + offset * sought.along, scale)
    return np.asarray(np.einsum("mp,mp->m", patches, others) / (norms * other_norms), dtype=np.float32)


def _patches(image: Image, centres: Floats, scale: Floats | None = None) -> tuple[Floats32, Floats32]:
    """(P, pixels) patches of an image around centres (P, 2), without their means, and their norms (P,)."""
    if not len(centres):
        return np.zeros((0, _RIGHT.size), dtype=np.float32), np.zeros(0, dtype=np.float32)
    middle, size = centres.astype(np.float32), np.ones(1) if scale is None else scale
    column, row = size.astype(np.float32)[:, None] * _RIGHT, size.astype(np.float32)[:, None] * _DOWN
    column, row = middle[:, [0]] + column, middle[:, [1]] + row
    sampled = cv2.remap(image, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    patches = np.asarray(sampled, dtype=np.float32)
    # Sums of whole numbers are exact, and faster than the mean of fractions.
    patches -= cv2.reduce(sampled, 1, cv2.REDUCE_SUM, dtype=cv2.CV_32F) / np.float32(_RIGHT.size)
    norms = np.sqrt(np.einsum("mp,mp->m", patches, patches)) + np.float32(PATCH_CORRELATION.norm_floor)
    return patches, np.asarray(norms, dtype=np.float32)


def _moving(before: Moment, things: _Sought, place: Floats) -> Mask:
    """(P,) mask of the points found elsewhere, at `place` (P, 2), that belong to things that move.

    Neighbouring points whose depth changed alike are one thing. It moves where one translation takes them to where they
    are found, by which their depth changes as the LiDAR saw it change; half of them have to fit.
    """
    moving = np.zeros(things.point.size, dtype=np.bool_)
    row, column = np.rint(place[:, ::-1].T / HALF).astype(np.intp)
    height, width = before.half.shape
    depth_m = before.nearest_m[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
    # What the LiDAR had not seen there may move along with the camera.
    deeper_m = np.where(np.isfinite(depth_m), depth_m - things.point_m[:, 2], 0.0)
    for thing in _things(things.pixel, deeper_m):
        missed_px = _missed_px(before.camera.intrinsics, things.point_m[thing], place[thing], deeper_m[thing])
        moving[thing] = np.median(missed_px / HALF ** things.halvings[thing]) < PARALLAX_CONFLICT.moving_px
    return moving


def _missed_px(K: Matrix, point_m: Matrix, place: Floats, deeper_m: Floats) -> Floats:
    """(P,) by how many px a thing that moves as a whole misses where its points (P, 3) are found."""
    ray = (place - K[:2, 2]) / (K[0, 0], K[1, 1])
    depth = point_m[:, 2:] + float(np.median(deeper_m))
    aside_m = np.median(ray * depth - point_m[:, :2], axis=0)
    missed = ((point_m[:, :2] + aside_m) / depth - ray) * (K[0, 0], K[1, 1])
    return np.asarray(np.hypot(*missed.T))


def _things(pixel: Floats, deeper_m: Floats) -> list[Indices]:
    """The points (P, 2) in groups of neighbours, in cells that touch, whose depths changed (P,) alike."""
    if not len(pixel):
        return []
    cell = (pixel / PARALLAX_CONFLICT.cluster_px).astype(np.intp)
    cell -= cell.min(axis=0) - 1
    marked = np.zeros(cell.max(axis=0) + 2, dtype=np.uint8)
    marked[cell[:, 0], cell[:, 1]] = 1
    _, labels = cv2.connectedComponents(cv2.dilate(marked, np.ones((3, 3), np.uint8)))
    label = labels[cell[:, 0], cell[:, 1]]
    order = np.lexsort((deeper_m, label))
    apart = np.diff(deeper_m[order]) > PARALLAX_CONFLICT.changed_alike_m
    return np.split(order, np.flatnonzero(apart | (np.diff(label[order]) > 0)) + 1)
