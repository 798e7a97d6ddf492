"""Parallax conflicts: where a camera's pictures of two moments agree with each other and not with the LiDAR.

A camera that moves sees a scene from two places. The LiDAR's range of a point says where the camera saw it a moment
ago: somewhere on the point's epipolar line. A parallax conflict is a point whose surroundings are found elsewhere on
that line, clearly better. Where the vehicle stands, at the focus of expansion and without texture nothing is compared.

What moves by itself is found elsewhere, too (`moving_things`), and is no conflict.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import nan
from typing import NamedTuple

import cv2
import numpy as np

from auditor.measurement.checks.lidar_conflict import VerifiedConflicts
from auditor.measurement.checks.tone_curve import saturation_level
from auditor.measurement.disparity.half_resolution import halve
from auditor.measurement.disparity.lidar import LidarView
from auditor.measurement.disparity.stereo import textured
from auditor.measurement.ego_motion import Motion, ego_motion, pixels_of
from auditor.measurement.moving_things import FoundElsewhere, moving
from auditor.measurement.parameters import HALF, LIDAR_PROJECTION, PATCH_CORRELATION
from auditor.measurement.time_parameters import PARALLAX_CONFLICT
from auditor.model.arrays import Floats, Floats32, Image, Indices, Mask
from auditor.model.optics.geometry import Matrix
from auditor.model.rig import Camera

_RADIUS = PARALLAX_CONFLICT.patch_px // 2
_DOWN, _RIGHT = (axis.ravel().astype(np.float32) for axis in np.mgrid[-_RADIUS : _RADIUS + 1, -_RADIUS : _RADIUS + 1])
_HALVES = _DOWN <= 0, _DOWN >= 0, _RIGHT <= 0, _RIGHT >= 0
"""Of a patch: upper, lower, left and right."""
_BESIDE = PARALLAX_CONFLICT.beside_px
_SECOND_NS = 10**9
_OFFSETS = np.arange(-PARALLAX_CONFLICT.farther_px, PARALLAX_CONFLICT.nearer_px + 1)
_MIDDLE = (1 / HALF - 1) / 2
_HALVED = np.array([[1 / HALF, 0, _MIDDLE], [0, 1 / HALF, _MIDDLE], [0, 0, 1]])
"""From pixels to half px, whose middles lie between those of two pixels."""
_AT_ONCE = 256
"""Points that are compared with all others at once: memory stays bounded."""
_PATCHES_AT_ONCE = 2048
"""Patches that are compared at once, for the same reason."""
_NEARBY = np.ones(PARALLAX_CONFLICT.nearby_px, dtype=np.uint8)


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

    @property
    def white_share(self) -> float:
        """The share of the view's points where the picture saturates; 0 where there is no point."""
        there = self.half.ravel()[self.view.place(HALF, self.half.shape[1])]
        return float(np.mean(there >= saturation_level(self.half))) if there.size else 0.0

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
        numbers = np.arange(len(self.point))[some]
        return _Sought(*(getattr(self, name).take(numbers, axis=0) for name in self.__dataclass_fields__))

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
            valid[sought.point[agrees]] = True
            alike = _alike(sought.chosen(found), place)
            things, place = sought.chosen(found[alike]), place[alike]
            K = before.camera.intrinsics
            moves = moving(
                K, before.nearest_m, FoundElsewhere(things.pixel, things.point_m, place, HALF**things.halvings)
            )
            conflicts[things.point[~moves]] = True
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
    inside &= (parallax_px >= PARALLAX_CONFLICT.least_px) & (moved[:, 2] > LIDAR_PROJECTION.nearest_m)
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
            now.halved(times), before.halved(times), sought.chosen(some).halved(times)
        )
        agree.append(some[agrees])
        found.append(some[elsewhere])
        place.append((there + 1 / 2) * HALF**times - 1 / 2 if times else there)
    none = np.zeros(0, dtype=np.intp)
    return np.concatenate([none, *agree]), np.concatenate([none, *found]), np.concatenate([np.zeros((0, 2)), *place])


def _compared_at(now: Image, before: Image, sought: _Sought) -> tuple[Indices, Indices, Floats]:
    """As `_compared`, in two pictures (H, W)."""
    patches, norms = _patches(now, sought.pixel)
    beside = {o: _ncc(patches, norms, before, sought, o) for o in range(-_BESIDE, _BESIDE + 1)}
    at_range = np.max([*beside.values()], axis=0)
    # Elsewhere NCC is 1 at most.
    doubtful = np.flatnonzero(at_range < 1 - PARALLAX_CONFLICT.clearly_less)
    known = {o: ncc[doubtful] for o, ncc in beside.items()}
    best, offset = _best_elsewhere(patches[doubtful], norms[doubtful], before, sought.chosen(doubtful), known)
    clearly = at_range[doubtful] + PARALLAX_CONFLICT.clearly_less
    elsewhere = best > np.maximum(PARALLAX_CONFLICT.consistent, clearly)
    agrees = at_range > PARALLAX_CONFLICT.agreeing
    agrees[doubtful[elsewhere]] = False
    found, offset = doubtful[elsewhere], offset[elsewhere]
    whole = _in_halves(patches[found], before, sought.chosen(found), offset)
    found, offset = found[whole], offset[whole]
    return np.flatnonzero(agrees), found, sought.predicted[found] + offset[:, None] * sought.along[found]


def _in_halves(patches: Floats32, before: Image, sought: _Sought, offset: Floats) -> Mask:
    """(P,) mask of the points of which each half of the patch is found at an offset (P,), and not at their range.

    The edge of a thing is in its patch beside what lies behind it, which is found elsewhere; the thing is not.
    """
    halves = [_of_half(patches, half) for half in _HALVES]
    there = _half_nccs(halves, before, sought, offset)
    at_range = np.max([_half_nccs(halves, before, sought, o) for o in range(-_BESIDE, _BESIDE + 1)], axis=0)
    return np.asarray((there > at_range + PARALLAX_CONFLICT.clearly_less).all(axis=0))


def _half_nccs(halves: Sequence[Floats32], before: Image, sought: _Sought, offset: Floats | int) -> Floats32:
    """(4, P) the NCC of the halves of patches, as `_ncc`."""
    others, _ = _patches_before(before, sought, offset)
    pairs = [(now, _of_half(others, half)) for now, half in zip(halves, _HALVES, strict=True)]
    return np.array([np.einsum("mp,mp->m", a, b) / (_norms(a) * _norms(b)) for a, b in pairs], dtype=np.float32)


def _of_half(patches: Floats32, half: Mask) -> Floats32:
    part = patches[:, half]
    return np.asarray(part - part.mean(axis=1, keepdims=True), dtype=np.float32)


def _best_elsewhere(
    patches: Floats32, norms: Floats32, before: Image, sought: _Sought, known: Mapping[int, Floats32]
) -> tuple[Floats32, Floats]:
    """(P,) the largest NCC on the points' lines, not at the LiDAR's range, and how many px from there it is.

    No farther away than the point at infinity; -1 where it is the last of what is tried, which may be no peak. Their
    NCC is `known` at some offsets.
    """
    tried = sought.parallax_px + _OFFSETS[:, None] >= -1
    found = np.full(tried.shape, -1, dtype=np.float32)
    for offset, ncc in known.items():
        step = offset - _OFFSETS[0]
        found[step, tried[step]] = ncc[tried[step]]
        tried[step] = False
    steps, points = np.nonzero(tried)
    for begin in range(0, steps.size, _PATCHES_AT_ONCE):
        step, point = steps[begin : begin + _PATCHES_AT_ONCE], points[begin : begin + _PATCHES_AT_ONCE]
        found[step, point] = _ncc(
            patches[point], norms[point], before, sought.chosen(point), _OFFSETS[step].astype(np.float64)
        )
    elsewhere = np.where(np.abs(_OFFSETS[:, None]) <= _BESIDE, np.float32(-1), found)
    best = elsewhere.argmax(axis=0)
    at_an_end = (best == 0) | (best == len(_OFFSETS) - 1)
    largest = np.where(at_an_end, np.float32(-1), elsewhere.max(axis=0, initial=-1))
    return largest, _OFFSETS[best] + _between(found, best)


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


def _ncc(patches: Floats32, norms: Floats32, before: Image, sought: _Sought, offset: Floats | int) -> Floats32:
    """(P,) the NCC of patches now with the picture before, `offset` px from where the LiDAR's range puts them.

    What came nearer was smaller a moment ago.
    """
    others, other_norms = _patches_before(before, sought, offset)
    return np.asarray(np.einsum("mp,mp->m", patches, others) / (norms * other_norms), dtype=np.float32)


def _patches_before(before: Image, sought: _Sought, offset: Floats | int) -> tuple[Floats32, Floats32]:
    nearness = (sought.parallax_px + offset) / sought.parallax_px
    scale = 1 / np.maximum(1 + nearness * sought.approached, 1 / PARALLAX_CONFLICT.most_grown)
    return _patches(before, sought.predicted + np.reshape(offset, (-1, 1)) * sought.along, scale)


def _patches(image: Image, centres: Floats, scale: Floats | None = None) -> tuple[Floats32, Floats32]:
    """(P, pixels) patches of an image around centres (P, 2), without their means, and their norms (P,)."""
    if not len(centres):
        return np.zeros((0, _RIGHT.size), dtype=np.float32), np.zeros(0, dtype=np.float32)
    middle, size = centres.astype(np.float32), (np.ones(1) if scale is None else scale).astype(np.float32)[:, None]
    column, row = (np.repeat(middle[:, [axis]], _RIGHT.size, axis=1) for axis in (0, 1))
    column += size * _RIGHT
    row += size * _DOWN
    sampled = cv2.remap(image, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    patches = np.asarray(sampled, dtype=np.float32)
    # Sums of whole numbers are exact, and faster than the mean of fractions.
    patches -= cv2.reduce(sampled, 1, cv2.REDUCE_SUM, dtype=cv2.CV_32F) / np.float32(_RIGHT.size)
    return patches, _norms(patches)


def _norms(patches: Floats32) -> Floats32:
    norms = np.sqrt(np.einsum("mp,mp->m", patches, patches)) + np.float32(PATCH_CORRELATION.norm_floor)
    return np.asarray(norms, dtype=np.float32)


def _alike(things: _Sought, place: Floats) -> Mask:
    """(P,) mask of the points found elsewhere, at `place` (P, 2), that have neighbours, most of them found as far away.

    Neighbours are those within a patch. Wrong matches are scattered in depth, what is behind a bogus wall is not.
    """
    scale = HALF**things.halvings
    found_px = things.parallax_px + np.einsum("pd,pd->p", place - things.predicted, things.along)
    depth_px = things.parallax_px * things.point_m[:, 2]
    alike = np.zeros(found_px.size, dtype=np.bool_)
    for begin in range(0, found_px.size, _AT_ONCE):
        some = slice(begin, begin + _AT_ONCE)
        reach_px, most_px = PARALLAX_CONFLICT.patch_px * scale[some], PARALLAX_CONFLICT.alike_px * scale[some]
        near = (np.abs(things.pixel[some, None] - things.pixel) < reach_px[:, None, None]).all(axis=2)
        apart_px = np.abs(depth_px[some, None] * (found_px / depth_px) - found_px[some, None])
        # Each is its own neighbour here.
        others, as_far = near.sum(axis=1) - 1, (near & (apart_px < most_px[:, None])).sum(axis=1) - 1
        alike[some] = (others > 0) & (as_far >= PARALLAX_CONFLICT.alike_share * others)
    return alike
