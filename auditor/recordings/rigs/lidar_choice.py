"""Which of several LiDARs a group of cameras is compared with: the one that covers most of their pictures."""

from collections.abc import Sequence

import numpy as np

from auditor.model.arrays import Points
from auditor.model.optics.geometry import Matrix
from auditor.recordings.parameters import LIDAR_CHOICE
from auditor.recordings.rigs.cameras import View
from auditor.recordings.rigs.ordering import Placed
from auditor.recordings.synchronisation.survey import CloudTopic


def best_lidar(placed: Placed, clouds: Sequence[tuple[CloudTopic, Matrix]]) -> tuple[CloudTopic, Matrix] | None:
    """Of LiDARs with their places rig_SE3_lidar (4, 4) the one with the most points that covers the cameras' pictures.

    It is passed over where it covers much less of them than another one does.
    """
    by_points = sorted(clouds, key=lambda one: -one[0].points)
    if len(by_points) < 2:
        return by_points[0] if by_points else None
    shares = [_covered(placed, cloud.some_m, rig_SE3_lidar) for cloud, rig_SE3_lidar in by_points]
    enough = LIDAR_CHOICE.least_of_best * max(shares)
    return next(one for one, share in zip(by_points, shares, strict=True) if share >= enough)


def _covered(placed: Placed, some_m: Points | None, rig_SE3_lidar: Matrix) -> float:
    """The share of the cells of the cameras' pictures that some of a LiDAR's points fall into; 0 where not known."""
    if some_m is None:
        return 0.0
    points_m = some_m.astype(np.float64) @ rig_SE3_lidar[:3, :3].T + rig_SE3_lidar[:3, 3]
    cameras = zip(placed.views, placed.rotations, placed.centres_m, strict=True)
    return float(np.mean([_cells(view, (points_m - centre_m) @ rotation.T) for view, rotation, centre_m in cameras]))


def _cells(view: View, points_m: Matrix) -> float:
    """The share of a picture's cells with (N, 3) points of the camera's frame."""
    ahead = points_m[points_m[:, 2] > LIDAR_CHOICE.nearest_m]
    x, y = view.lens.distort(ahead[:, 0] / ahead[:, 2], ahead[:, 1] / ahead[:, 2])
    width, height = view.image.size_px
    across = LIDAR_CHOICE.columns * (view.K[0, 0] * x + view.K[0, 1] * y + view.K[0, 2]) / width
    down = LIDAR_CHOICE.rows * (view.K[1, 1] * y + view.K[1, 2]) / height
    with np.errstate(invalid="ignore"):
        inside = (across >= 0) & (across < LIDAR_CHOICE.columns) & (down >= 0) & (down < LIDAR_CHOICE.rows)
    cells = down[inside].astype(np.intp) * LIDAR_CHOICE.columns + across[inside].astype(np.intp)
    return np.unique(cells).size / (LIDAR_CHOICE.columns * LIDAR_CHOICE.rows)
