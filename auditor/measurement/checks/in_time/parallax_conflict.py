"""Parallax conflicts: where a camera's pictures of two moments agree with each other and not with the LiDAR.

A camera that moves sees a scene from two places. The LiDAR's range of a point says where the camera saw it a moment
ago: somewhere on the point's epipolar line. A parallax conflict is a point whose surroundings are found elsewhere on
that line, clearly better. Where the vehicle stands, at the focus of expansion and without texture nothing is compared.

What moves by itself is found elsewhere, too (`moving_things`), and so is what stays in the picture (`still_texture`):
neither is a conflict.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from math import nan
from typing import NamedTuple

import cv2
import numpy as np

from auditor.measurement.checks.in_time.still_texture import NUMBERS as STILL_TEXTURE
from auditor.measurement.checks.in_time.still_texture import appeared, measure_still_texture, staying
from auditor.measurement.checks.lidar_conflict import VerifiedConflicts
from auditor.measurement.disparity.stereo import textured
from auditor.measurement.ego_motion import Motion, ego_motion, pixels_of
from auditor.measurement.moment import Moment
from auditor.measurement.moving_things import FoundElsewhere, moving
from auditor.measurement.parameters import HALF, LIDAR_PROJECTION, PATCH_CORRELATION
from auditor.measurement.time_parameters import PARALLAX_CONFLICT
from auditor.model.arrays import Floats, Floats32, Image, Indices, Mask
from auditor.model.optics.geometry import Matrix

_RADIUS = PARALLAX_CONFLICT.patch_px // 2
_DOWN, _RIGHT = (axis.ravel().astype(np.float32) for axis in np.mgrid[-_RADIUS : _RADIUS + 1, -_RADIUS : _RADIUS + 1])
_EVERY = np.arange(_RIGHT.size)
_SPARSE = np.flatnonzero((_RIGHT % 2 == 0) & (_DOWN % 2 == 0))
"""Every pixel of a patch, and every second one of every second row, where pictures are smooth."""
_HALVES = np.stack([_DOWN <= 0, _DOWN >= 0, _RIGHT <= 0, _RIGHT >= 0], axis=1).astype(np.float32)
"""(pixels, 4) which pixels of a patch are of its upper, lower, left and right half."""
_BESIDE = PARALLAX_CONFLICT.beside_px
_OFFSETS = np.arange(-PARALLAX_CONFLICT.farther_px, PARALLAX_CONFLICT.nearer_px + 1, dtype=np.float64)
_AT_RANGE = np.arange(-_BESIDE, _BESIDE + 1, dtype=np.float64)[:, None]
_FIRST = np.flatnonzero((_OFFSETS % PARALLAX_CONFLICT.step_px == 0) & (np.abs(_OFFSETS) > _BESIDE))
"""The places of the offsets that are tried first."""
_FURTHER = np.arange(1 - PARALLAX_CONFLICT.step_px, PARALLAX_CONFLICT.step_px)[:, None]
"""Those that are tried then, from the best of them: it, its neighbours, and their neighbours."""
_AT_ONCE = 256
"""Points that are compared with all others at once: memory stays bounded."""
_PATCHES_AT_ONCE = 2048
"""Patches that are compared at once, for the same reason."""
_MOST_PATCHES = np.iinfo(np.int16).max - 1  # that OpenCV samples at once
_AROUND = np.ones((PARALLAX_CONFLICT.around_px, PARALLAX_CONFLICT.around_px), dtype=np.uint8)


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

    def chosen(self, some: Indices | Mask | slice) -> "_Sought":
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


class ParallaxComparison(NamedTuple):
    """The points, compared with a picture of a moment ago, and how the camera moved since.

    `moved_m` is how far; NaN where that is not known. `still_texture` is that check's statistic, None where it cannot
    be told. Of the points that lie apart from those found elsewhere an `unmatched_share` does not agree; None where
    they are too few.
    """

    points: VerifiedConflicts
    moved_m: float
    motion: Motion | None = None
    still_texture: float | None = None
    unmatched_share: float | None = None


class _ComparedPoints(NamedTuple):
    """The numbers of points that were compared, of those that agree with the picture before, and of `conflicts`.

    The latter are found at a `place` (C, 2). `unmatched_share` is that of ParallaxComparison.
    """

    every: Indices
    agrees: Indices
    conflicts: Indices
    place: Floats
    unmatched_share: float | None = None

    @property
    def numbers(self) -> tuple[Indices, Indices, Indices]:
        """The numbers of all, of those that agree, and of those that conflict."""
        return self.every, self.agrees, self.conflicts


def parallax_conflicts(
    now: Moment, before: Moment | None, expected: Motion | None = None, long_ago: Image | None = None
) -> ParallaxComparison:
    """Compare the LiDAR's points in a camera's view with that camera's picture of a moment ago.

    `expected` is how the camera should have moved since, by how it moved before; `long_ago` its half-resolution picture
    (h, w) of much farther back.
    No point is valid where there is no such picture, it is too old, or the pictures do not tell the camera's motion.
    """
    view, moved_m, motion, texture, unmatched = now.view, nan, None, None, None
    valid, conflicts = (np.zeros(view.row.size, dtype=np.bool_) for _ in range(2))
    some = np.flatnonzero(textured(now.half)[view.row // HALF, view.column // HALF])
    if before is not None and now.follows(before) and before.half.shape == now.half.shape:
        motion = ego_motion(now, before, some, expected)
    if before is not None and motion is not None:
        moved_m = motion.length_m
        sought = _seen_before(now, some, motion)
        compared = _sampled(now, before, sought)
        stays, texture = _staying(now, before, long_ago, sought, compared)
        if not motion.by_ranges:
            valid[sought.point[compared.agrees]] = True
            conflicts[_conflicting(now, before, sought, compared, stays)] = True
            unmatched = compared.unmatched_share
    points = VerifiedConflicts(view.row, view.column, valid | conflicts, conflicts)
    return ParallaxComparison(points, moved_m, motion, texture, unmatched)


def _conflicting(now: Moment, before: Moment, sought: _Sought, compared: _ComparedPoints, stays: Indices) -> Indices:
    """The numbers of the points that conflict: they neither stay in the picture nor move by themselves."""
    moved = ~np.isin(compared.conflicts, stays)
    moved &= ~_outnumbered(now, sought.point[stays], sought.point[compared.conflicts], moved)
    things, place = sought.chosen(compared.conflicts[moved]), compared.place[moved]
    alike = _alike(things, place)
    things, place = things.chosen(alike), place[alike]
    elsewhere = FoundElsewhere(things.pixel, things.point_m, place, HALF**things.halvings)
    return np.asarray(things.point[~moving(before.camera.intrinsics, before.nearest_m, elsewhere)])


def _staying(
    now: Moment, before: Moment, long_ago: Image | None, sought: _Sought, compared: _ComparedPoints
) -> tuple[Indices, float | None]:
    """The points that stay in the picture though they should have moved, or appeared, and how much of it stays."""
    differing = np.setdiff1d(compared.every, compared.agrees, assume_unique=True)
    lately = differing[staying(now, [before.half], sought.point[differing])]
    if long_ago is None:
        return lately, None
    always = staying(now, [long_ago], sought.point[lately])
    stays = lately[always]
    moving = compared.every[np.hypot(*(sought.predicted - sought.pixel)[compared.every].T) >= STILL_TEXTURE.least_px]
    texture = measure_still_texture(now, sought.point[moving], np.isin(moving, stays))
    fresh = appeared(now, long_ago, sought.point[lately])
    return lately[always | fresh], texture


def _seen_before(now: Moment, some: Indices, motion: Motion) -> _Sought:
    """Where some points of the view lie in the picture before, if they stand; those with enough parallax."""
    K, point_m = now.camera.intrinsics, now.point_m[some]
    far = K @ motion.rotation @ point_m.T
    moved = far + (K @ motion.translation_m)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        predicted = moved[:2] / moved[2]
        away = predicted - far[:2] / far[2]
    parallax_px = np.hypot(*away)
    compared = np.flatnonzero((parallax_px >= PARALLAX_CONFLICT.least_px) & (moved[2] > LIDAR_PROJECTION.nearest_m))
    predicted, parallax_px = predicted[:, compared], parallax_px[compared]
    margin = _RADIUS * HALF ** _halvings(parallax_px)
    size = np.array(now.grey.shape[::-1])[:, None]
    kept = np.flatnonzero(((predicted > margin) & (predicted < size - margin - 1)).all(axis=0))
    of = compared[kept]
    return _Sought(
        some[of],
        point_m[of],
        pixels_of(K, point_m[of]),
        predicted[:, kept].T,
        (away[:, of] / parallax_px[kept]).T,
        parallax_px[kept],
        motion.translation_m[2] / far[2, of],
    )


def _halvings(parallax_px: Floats) -> Indices:
    """(P,) how many times the pictures are halved to compare points of some parallax.

    What is near and beside the way crosses the picture: errors of its range and of the motion are of more pixels then,
    and so is what has to be tried.
    """
    with np.errstate(invalid="ignore"):
        times = np.ceil(np.log2(np.maximum(parallax_px / PARALLAX_CONFLICT.halved_from_px, 1)))
    return np.nan_to_num(np.minimum(times, PARALLAX_CONFLICT.most_halved)).astype(np.intp)


def _outnumbered(now: Moment, stays: Indices, conflicts: Indices, moved: Mask) -> Mask:
    """(C,) mask of the conflicts around which so many more points stay: a pattern is found one period further, too."""
    place = now.view.place(HALF, now.half.shape[1])

    def around(points: Indices) -> Floats32:
        there = np.bincount(place[points], minlength=now.half.size).astype(np.float32).reshape(now.half.shape)
        summed = np.asarray(cv2.boxFilter(there, -1, _AROUND.shape, normalize=False), dtype=np.float32)
        return summed.ravel()[place[conflicts]]

    return np.asarray(around(stays) > STILL_TEXTURE.outnumber * around(conflicts[moved]))


def _sampled(now: Moment, before: Moment, sought: _Sought) -> _ComparedPoints:
    """A sample of the points, compared with the picture before, and all around those that are found elsewhere."""
    first = np.arange(0, sought.point.size, max(-(-sought.point.size // PARALLAX_CONFLICT.first_points), 1))
    compared = _compared(now, before, sought, first)
    there = now.view.place(HALF, now.half.shape[1])[sought.point]
    elsewhere = np.zeros(now.half.shape, dtype=np.uint8)
    elsewhere.ravel()[there[compared.conflicts]] = 1
    around = cv2.dilate(elsewhere, _AROUND).ravel()[there]
    apart = first[around[first] == 0]
    around[first] = 0
    further = _compared(now, before, sought, np.flatnonzero(around))
    unmatched = 1 - float(np.isin(apart, compared.agrees).mean()) if apart.size >= PARALLAX_CONFLICT.fewest else None
    every, agrees, conflicts = (np.concatenate(both) for both in zip(compared.numbers, further.numbers, strict=True))
    return _ComparedPoints(every, agrees, conflicts, np.concatenate([compared.place, further.place]), unmatched)


def _compared(now: Moment, before: Moment, sought: _Sought, some: Indices) -> _ComparedPoints:
    """Some points, compared with the picture before."""
    agree, conflicts, place = [some[:0]], [some[:0]], [np.zeros((0, 2))]
    for times in np.unique(sought.halvings[some]).tolist():
        alike = some[sought.halvings[some] == times]
        agrees, elsewhere, there = _compared_at(now, before, times, sought.chosen(alike).halved(times))
        agree.append(alike[agrees])
        conflicts.append(alike[elsewhere])
        place.append((there + 1 / 2) * HALF**times - 1 / 2 if times else there)
    return _ComparedPoints(some, np.concatenate(agree), np.concatenate(conflicts), np.concatenate(place))


def _compared_at(now: Moment, then: Moment, times: int, sought: _Sought) -> tuple[Indices, Indices, Floats]:
    """Which points agree, which are found elsewhere on their lines, and where, in pictures halved so many times."""
    patches, before = _patches(now.halved(times), sought.pixel, np.ones(1)), then.halved(times)
    [at_range] = _nccs(patches, before, sought, np.zeros((1, 1)))
    # Elsewhere NCC is 1 at most.
    doubtful = np.flatnonzero(at_range < 1 - PARALLAX_CONFLICT.clearly_less)
    patches, some = patches[doubtful], sought.chosen(doubtful)
    sides = _nccs(patches, before, some, _AT_RANGE[_AT_RANGE != 0, None])
    beside = np.insert(sides, _BESIDE, at_range[doubtful], axis=0)
    at_range[doubtful] = beside.max(axis=0)
    best, offset = _best_elsewhere(
        patches, before, some, _promising(now.smooth(times), then.smooth(times), some), beside
    )
    clearly = at_range[doubtful] + PARALLAX_CONFLICT.clearly_less
    elsewhere = np.flatnonzero(best > np.maximum(PARALLAX_CONFLICT.consistent, clearly))
    agrees = at_range > PARALLAX_CONFLICT.agreeing
    agrees[doubtful[elsewhere]] = False
    conflicts = elsewhere[_in_halves(patches[elsewhere], before, some.chosen(elsewhere), offset[elsewhere])]
    place = some.predicted[conflicts] + offset[conflicts, None] * some.along[conflicts]
    return np.flatnonzero(agrees), doubtful[conflicts], place


def _in_halves(patches: Floats32, before: Image, sought: _Sought, offset: Floats) -> Mask:
    """(P,) mask of the points of which each half of the patch is found at an offset (P,), and not at their range.

    The edge of a thing is in its patch beside what lies behind it, which is found elsewhere; the thing is not.
    """
    if not len(patches):
        return np.zeros(0, dtype=np.bool_)
    offsets = np.concatenate([offset[None], np.broadcast_to(_AT_RANGE, (len(_AT_RANGE), offset.size))])
    others = _patches_before(before, sought, offsets)
    patches, size = patches - patches.mean(axis=1, keepdims=True), _HALVES.sum(axis=0)
    mean, other_mean = patches @ _HALVES / size, others @ _HALVES / size
    both = (patches * others) @ _HALVES - size * mean * other_mean
    norm = _norms(np.square(patches) @ _HALVES - size * np.square(mean))
    ncc = both / (norm * _norms(np.square(others) @ _HALVES - size * np.square(other_mean)))
    return np.asarray((ncc[0] > ncc[1:].max(axis=0) + PARALLAX_CONFLICT.clearly_less).all(axis=1))


def _promising(now: Image, before: Image, sought: _Sought) -> Indices:
    """(P,) which of the offsets is the best by some pixels of pictures without their details; -1 where none is good.

    Every third one is tried.
    """
    offsets = _OFFSETS[_FIRST, None]
    ncc = _nccs(_patches(now, sought.pixel, np.ones(1), _SPARSE), before, sought, offsets, _SPARSE)
    ncc[sought.parallax_px + offsets < -1] = -1
    good = ncc.max(axis=0) > PARALLAX_CONFLICT.promising
    return np.where(good, _FIRST[ncc.argmax(axis=0)], -1)


def _best_elsewhere(
    patches: Floats32, before: Image, sought: _Sought, promising: Indices, beside: Floats32
) -> tuple[Floats32, Floats]:
    """(P,) the largest NCC on the points' lines, not at the LiDAR's range, and how many px from there it is.

    It is sought around offsets that are `promising` (P,), and no farther away than the point at infinity; -1 where it
    is the last of what is tried, which may be no peak. `beside` are the NCC at the LiDAR's range.
    """
    points, near = np.arange(len(patches)), np.flatnonzero(promising >= 0)
    around = np.clip(promising[near] + _FURTHER, 0, _OFFSETS.size - 1)
    tried = _nccs(patches[near], before, sought.chosen(near), _OFFSETS[around])
    ncc = np.full((_OFFSETS.size, points.size), -1, dtype=np.float32)
    ncc[around, near] = np.where(sought.parallax_px[near] + _OFFSETS[around] < -1, np.float32(-1), tried)
    at_range = np.abs(_OFFSETS) <= _BESIDE
    ncc[at_range] = -1
    best = ncc.argmax(axis=0)
    largest = np.where((best == 0) | (best == _OFFSETS.size - 1), np.float32(-1), ncc[best, points])
    ncc[at_range] = beside
    return largest, _OFFSETS[best] + _between(ncc, best)


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


def _nccs(patches: Floats32, before: Image, sought: _Sought, offsets: Floats, pixels: Indices = _EVERY) -> Floats32:
    """(O, P) the NCC of patches now with the picture before, `offsets` px (O, 1) or (O, P) from the LiDAR's range."""
    offsets = np.broadcast_to(offsets, (len(offsets), len(patches)))
    patches = patches - patches.mean(axis=1, keepdims=True)
    norms = _norms(np.einsum("pk,pk->p", patches, patches))
    ncc = np.empty(offsets.shape, dtype=np.float32)
    at_once = max(_PATCHES_AT_ONCE // len(offsets), 1)
    for begin in range(0, len(patches), at_once):
        some = slice(begin, begin + at_once)
        others = _patches_before(before, sought.chosen(some), offsets[:, some], pixels)
        both = np.einsum("pk,opk->op", patches[some], others)
        squares = np.einsum("opk,opk->op", others, others) - np.square(np.einsum("opk->op", others)) / pixels.size
        ncc[:, some] = both / (norms[some] * _norms(squares))
    return ncc


def _patches_before(before: Image, sought: _Sought, offsets: Floats, pixels: Indices = _EVERY) -> Floats32:
    """(O, P, pixels) patches of the picture before. What came nearer was smaller a moment ago."""
    nearness = (sought.parallax_px + offsets) / sought.parallax_px
    scale = 1 / np.maximum(1 + nearness * sought.approached, 1 / PARALLAX_CONFLICT.most_grown)
    centres = sought.predicted + offsets[..., None] * sought.along
    return _patches(before, centres.reshape(-1, 2), scale.ravel(), pixels).reshape(*offsets.shape, -1)


def _patches(image: Image, centres: Floats, scale: Floats, pixels: Indices = _EVERY) -> Floats32:
    """(P, pixels) patches of an image around centres (P, 2), (P,) or (1,) times as wide as those now."""
    if not len(centres):
        return np.zeros((0, pixels.size), dtype=np.float32)
    scale = np.broadcast_to(scale, len(centres))
    column, row = (
        np.stack([middle, scale], axis=1, dtype=np.float32) @ np.stack([np.ones_like(beside), beside])[:, pixels]
        for middle, beside in zip(centres.T, (_RIGHT, _DOWN), strict=True)
    )
    some = (slice(begin, begin + _MOST_PATCHES) for begin in range(0, len(centres), _MOST_PATCHES))
    sampled = [
        cv2.remap(image, column[rows], row[rows], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE) for rows in some
    ]
    return np.concatenate(sampled, dtype=np.float32)


def _norms(squares: Floats32) -> Floats32:
    """The norms of patches, by the sums of their squares less their means."""
    return np.sqrt(np.maximum(squares, 0)) + np.float32(PATCH_CORRELATION.norm_floor)


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
