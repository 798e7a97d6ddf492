"""A rig of one camera and a LiDAR: the camera's own past stands in for a second camera."""

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from math import isnan, nan

import numpy as np

from auditor.measurement.checks.collect import collect_checks
from auditor.measurement.checks.count_grid import cells_of_points
from auditor.measurement.checks.disparity_error import Comparison
from auditor.measurement.checks.lidar_conflict import VerifiedConflicts
from auditor.measurement.checks.parallax_conflict import Moment, parallax_conflicts
from auditor.measurement.ego_motion import Motion
from auditor.measurement.shared_view import FrameArrays, RectifiedFrame, lidar_views
from auditor.measurement.time_parameters import PARALLAX_CONFLICT
from auditor.model.measurement import Counts


class OwnPast:
    """Compares the frames of one recording, in their order, each with one of the last, which are kept.

    It is the one before, or the one before that while the vehicle drives slowly: parallax grows with the way. Where the
    motion since then cannot be told, it is the one before after all.
    """

    def __init__(self) -> None:
        self._held: deque[Moment] = deque(maxlen=PARALLAX_CONFLICT.most_held)
        self._speed_m_s = nan
        self._last: tuple[Motion, float] | None = None

    def compare(self, prepared: RectifiedFrame) -> FrameArrays:
        """The arrays of the next frame; one that lacks the camera or the LiDAR is compared with nothing, nor kept."""
        rig, frame = prepared.rig, prepared.frame
        lidar = lidar_views(frame, rig, prepared.triples)
        found: dict[int, VerifiedConflicts] = {}
        for k, view in lidar.items():
            now = Moment(frame.stamp_ns, prepared.greys[k], view)
            found[k] = self._compared(now)
        frame_checks = replace(
            collect_checks(prepared.half_res, {}, {}, lidar, rig),
            parallax_conflicts={(k, k): cells_of_points(points, lidar[k]) for k, points in found.items()},
            verified_conflicts={(k, k): points for k, points in found.items()},
        )
        comparisons = {triple: _comparison(found[triple.k]) for triple in prepared.triples}
        return FrameArrays(rig, prepared.half_res, comparisons, {}, lidar, frame_checks, cloud=frame.cloud)

    def _compared(self, now: Moment) -> VerifiedConflicts:
        recent = [one for one in self._held if now.follows(one)]
        before = self._chosen(now, recent)
        points, moved_m, motion = parallax_conflicts(now, before, self._expected(now, before))
        if isnan(moved_m) and before is not None and before is not recent[-1]:
            # Beside the way, near things cross the picture so fast that corners are followed for one frame only.
            before = recent[-1]
            points, moved_m, motion = parallax_conflicts(now, before, self._expected(now, before))
        if before is not None and motion is not None:
            self._last = motion, now.after_s(before)
        self._speed_m_s = moved_m / now.after_s(before) if before else nan
        self._held.append(now)
        return points

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


def _comparison(points: VerifiedConflicts) -> Comparison:
    """E of the LiDAR, the camera a moment ago and the camera: the share of parallax conflicts."""
    valid, over = int(np.count_nonzero(points.valid)), int(np.count_nonzero(points.lidar_conflicts))
    counts = Counts(valid, over, valid, over, 0)
    return Comparison(counts, points.row[points.lidar_conflicts], points.column[points.lidar_conflicts], 1)
