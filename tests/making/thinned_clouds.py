"""Clouds of a LiDAR with fewer rings, made from those of one with more."""

import numpy as np

from auditor.model.frames import PointCloud

RINGS = 64
"""Of KITTI's LiDAR; its files hold ring after ring, each once around from straight ahead."""


def every_other_ring(cloud: PointCloud) -> PointCloud:
    """The cloud of a KITTI drive without every second ring."""
    x, y, _ = cloud.xyz_m.T
    azimuth = np.mod(np.arctan2(y, x), 2 * np.pi)
    ring = np.cumsum(np.abs(np.diff(azimuth, prepend=azimuth[:1])) > np.pi)
    assert ring[-1] + 1 == RINGS
    return PointCloud(cloud.stamp_ns, np.ascontiguousarray(cloud.xyz_m[ring % 2 == 0]))
