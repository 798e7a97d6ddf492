"""A rig of one camera and a LiDAR: the camera's own past stands in for a second camera."""

from dataclasses import replace

import numpy as np

from auditor.measurement.checks.collect import collect_checks
from auditor.measurement.checks.count_grid import cells_of_points
from auditor.measurement.checks.disparity_error import Comparison
from auditor.measurement.checks.lidar_conflict import VerifiedConflicts
from auditor.measurement.checks.parallax_conflict import Moment, parallax_conflicts
from auditor.measurement.shared_view import FrameArrays, RectifiedFrame, lidar_views
from auditor.model.measurement import Counts


class OwnPast:
    """Compares the frames of one recording, in their order, each with the one before, which is kept."""

    def __init__(self) -> None:
        self._before: Moment | None = None

    def compare(self, prepared: RectifiedFrame) -> FrameArrays:
        """The arrays of the next frame; one that lacks the camera or the LiDAR is compared with nothing, nor kept."""
        rig, frame = prepared.rig, prepared.frame
        lidar = lidar_views(frame, rig, prepared.triples)
        found: dict[int, VerifiedConflicts] = {}
        for k, view in lidar.items():
            now = Moment(frame.stamp_ns, prepared.greys[k], view)
            found[k] = parallax_conflicts(now, self._before)
            self._before = now
        frame_checks = replace(
            collect_checks(prepared.half_res, {}, {}, lidar, rig),
            parallax_conflicts={(k, k): cells_of_points(points, lidar[k]) for k, points in found.items()},
            verified_conflicts={(k, k): points for k, points in found.items()},
        )
        comparisons = {triple: _comparison(found[triple.k]) for triple in prepared.triples}
        return FrameArrays(rig, prepared.half_res, comparisons, {}, lidar, frame_checks, cloud=frame.cloud)


def _comparison(points: VerifiedConflicts) -> Comparison:
    """E of the LiDAR, the camera a moment ago and the camera: the share of parallax conflicts."""
    valid, over = int(np.count_nonzero(points.valid)), int(np.count_nonzero(points.lidar_conflicts))
    counts = Counts(valid, over, valid, over, 0)
    return Comparison(counts, points.row[points.lidar_conflicts], points.column[points.lidar_conflicts], 1)
