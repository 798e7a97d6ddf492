"""A rig of one camera and a LiDAR: the camera's own past stands in for a second camera."""

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from math import isnan, nan

import numpy as np

from auditor.measurement.checks.collect import collect_checks
from auditor.measurement.checks.in_time.parallax_conflict import ParallaxComparison, parallax_conflicts
from auditor.measurement.checks.in_time.still_light import Glimpse, OfThePast, measure_still_light
from auditor.measurement.checks.in_time.still_texture import NUMBERS as STILL_TEXTURE
from auditor.measurement.checks.lidar_conflict import VerifiedConflicts, cells_of_points
from auditor.measurement.disparity.disparity_error import Comparison
from auditor.measurement.ego_motion import Motion
from auditor.measurement.moment import Moment
from auditor.measurement.shared_view import FrameArrays, RectifiedFrame, lidar_views
from auditor.measurement.time_parameters import PARALLAX_CONFLICT, STILL_LIGHT
from auditor.model.arrays import Image
from auditor.model.checks import Check
from auditor.model.checks.kind import Of
from auditor.model.measurement import Counts
from auditor.model.stamps import NANOSECONDS

_MOST_HELD = 14  # pictures, which are 7 m of way and more than is asked for: it bounds the memory

_BY_THE_PAST = tuple(one for one in Check if one.kind.of is Of.LIDAR)
"""The checks of a lone camera."""

_BEGINNING = Motion(np.eye(3), np.zeros(3)), 0.0
"""Where a camera is whose way begins."""


class OwnPast:
    """Compares the frames of one recording, in their order, each with one of the last, which are kept.

    It is the one before, or the one before that while the vehicle drives slowly: parallax grows with the way. Where the
    motion since then cannot be told, it is the one before after all.
    """

    def __init__(self) -> None:
        self._held: deque[Moment] = deque(maxlen=PARALLAX_CONFLICT.most_held)
        self._speed_m_s = nan
        self._last: tuple[Motion, float] | None = None
        self._way = _Way()

    def compare(self, prepared: RectifiedFrame) -> FrameArrays:
        """The arrays of the next frame; one that lacks the camera or the LiDAR is compared with nothing, nor kept.

        In a picture that is white where too many of the LiDAR's points lie nothing is counted: it was not looked at,
        unless light is found.
        """
        rig, frame = prepared.rig, prepared.frame
        lidar = lidar_views(frame, rig, prepared.triples)
        conflicts: dict[int, VerifiedConflicts] = {}
        of_pasts: dict[Check, dict[int, OfThePast]] = {check: {} for check in _BY_THE_PAST}
        unmatched: dict[int, float | None] = {}
        for k, view in lidar.items():
            now = Moment(frame.stamp_ns, prepared.greys[k], view)
            compared, said = self._compared(now)
            conflicts[k], unmatched[k] = compared.points, compared.unmatched_share
            for check, of_past in said.items():
                of_pasts[check][k] = of_past
            if now.white_share > PARALLAX_CONFLICT.most_white_share:
                conflicts[k] = _none_of(conflicts[k])
        frame_checks = replace(
            collect_checks(prepared.half_res, {}, {}, lidar, rig),
            of_pasts=of_pasts,
            unmatched=unmatched,
            by_direction={
                Check.PARALLAX_CONFLICT: {(k, k): cells_of_points(points, lidar[k]) for k, points in conflicts.items()}
            },
            verified_conflicts={(k, k): points for k, points in conflicts.items()},
        )
        comparisons = {triple: _comparison(conflicts[triple.k]) for triple in prepared.triples}
        return FrameArrays(rig, prepared.half_res, comparisons, {}, lidar, frame_checks, cloud=frame.cloud)

    def _compared(self, now: Moment) -> tuple[ParallaxComparison, dict[Check, OfThePast]]:
        recent = [one for one in self._held if now.follows(one)]
        before = self._chosen(now, recent)
        compared = self._with(now, before)
        told = not isnan(compared.moved_m) and not (compared.motion is not None and compared.motion.by_ranges)
        if not told and before is not None and before is not recent[-1]:
            # Beside the way, near things cross the picture so fast that corners are followed for one frame only.
            before = recent[-1]
            compared = self._with(now, before)
        if before is not None and compared.motion is not None:
            self._last = compared.motion, now.after_s(before)
        self._speed_m_s = compared.moved_m / now.after_s(before) if before else nan
        self._held.append(now)
        said = {Check.STILL_LIGHT: self._way.looked_back(now, before, compared.motion)}
        if compared.still_texture is not None:
            said[Check.STILL_TEXTURE] = OfThePast(compared.still_texture, 0.0, np.zeros(0))
        return compared, {check: one for check, one in said.items() if one is not None}

    def _with(self, now: Moment, before: Moment | None) -> ParallaxComparison:
        return parallax_conflicts(now, before, self._expected(now, before), self._way.long_ago(now))

    def _expected(self, now: Moment, before: Moment | None) -> Motion | None:
        """How the camera moved since another moment if it goes on as it moved last."""
        if before is None or self._last is None:
            return None
        motion, took_s = self._last
        return motion.lasting(now.after_s(before) / took_s)

    def _chosen(self, now: Moment, recent: Sequence[Moment]) -> Moment | None:
        """The last of the recent ones since which the camera has moved far enough, by its speed so far; else the first.

        Where that is not known it is the last.
        """
        far = [one for one in recent if not self._speed_m_s * now.after_s(one) < PARALLAX_CONFLICT.enough_m]
        return far[-1] if far else recent[0] if recent else None


class _Way:
    """The way that a camera went, and pictures of it that are kept."""

    def __init__(self) -> None:
        self._placed: dict[int, tuple[Motion, float]] = {}
        self._glimpses: deque[Glimpse] = deque(maxlen=_MOST_HELD)
        self._lit: OfThePast | None = None

    def long_ago(self, now: Moment) -> Image | None:
        """The last picture since which the camera went far by the moment before; None where none is kept."""
        *_, (_, way_m) = self._placed.values() or [_BEGINNING]
        far = [
            one.half
            for one in self._glimpses
            if way_m - one.way_m >= STILL_TEXTURE.way_m and one.half.shape == now.half.shape
        ]
        return far[-1] if far else None

    def looked_back(self, now: Moment, before: Moment | None, motion: Motion | None) -> OfThePast | None:
        """What light stays in the next moment, whose camera moved so since the one `before`; None where not known."""
        if before is None or motion is None:
            self._lit = None
            return None
        if before.stamp_ns not in self._placed:
            self._glimpses.clear()
            self._lit = None
            self._placed = {before.stamp_ns: _BEGINNING}
            self._glimpses.append(_glimpse(before, _BEGINNING))
        placed = _further(self._placed[before.stamp_ns], motion)
        self._placed = {**dict(list(self._placed.items())[-PARALLAX_CONFLICT.most_held :]), now.stamp_ns: placed}
        while self._glimpses and now.stamp_ns - self._glimpses[0].stamp_ns > STILL_LIGHT.most_s * NANOSECONDS:
            self._glimpses.popleft()
        glimpse = _glimpse(now, placed)
        self._lit = measure_still_light(glimpse, now.point_m, self._glimpses, self._lit)
        if not self._glimpses or glimpse.way_m - self._glimpses[-1].way_m >= STILL_LIGHT.apart_m:
            self._glimpses.append(glimpse)
        return self._lit


def _further(placed: tuple[Motion, float], motion: Motion) -> tuple[Motion, float]:
    """Where a camera is, and how far it went, that has moved on from where it was."""
    there, way_m = placed
    moved = Motion(there.rotation @ motion.rotation, there.rotation @ motion.translation_m + there.translation_m)
    return moved, way_m + motion.length_m


def _glimpse(moment: Moment, placed: tuple[Motion, float]) -> Glimpse:
    return Glimpse.of(moment.stamp_ns, moment.half, moment.camera.intrinsics, moment.point_m, placed)


def _none_of(points: VerifiedConflicts) -> VerifiedConflicts:
    """The same points, of which none was compared."""
    none = np.zeros_like(points.valid)
    return replace(points, valid=none, lidar_conflicts=none)


def _comparison(points: VerifiedConflicts) -> Comparison:
    """E of the LiDAR, the camera a moment ago and the camera: the share of parallax conflicts."""
    valid, over = int(np.count_nonzero(points.valid)), int(np.count_nonzero(points.lidar_conflicts))
    counts = Counts(valid, over, valid, over, 0)
    return Comparison(counts, points.row[points.lidar_conflicts], points.column[points.lidar_conflicts], 1)
