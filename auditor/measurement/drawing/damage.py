"""The damaged portions of a frame as its pixels and points, from the regions that were measured."""

from collections.abc import Iterable

import cv2
import numpy as np

from auditor.measurement.disparity.lidar import lidar_view
from auditor.measurement.disparity.rectification import shown_rectification
from auditor.measurement.localisation.points import among
from auditor.model.arrays import Mask, Points
from auditor.model.frames import PointCloud
from auditor.model.measurement import REGION_STEP, Region, Solid
from auditor.model.rig import LIDAR, Camera, Rig

_SLACK_M = 0.01  # a stored box has lost the last digits of the points that it was put around


def damaged_image(region: Region, camera: Camera) -> Mask:
    """(H, W) mask of a camera's rectified image: the pixels of a region that lies in it."""
    small = np.asarray(cv2.imdecode(np.frombuffer(region.mask, np.uint8), cv2.IMREAD_GRAYSCALE))
    rows, columns = (np.arange(size) // REGION_STEP for size in (camera.height_px, camera.width_px))
    return np.asarray(small[np.ix_(rows, columns)] > 0)


def damaged_cloud(cloud: PointCloud, rig: Rig, regions: Iterable[Region]) -> Mask:
    """(N,) mask of a cloud's points: those of the LiDAR's region. Raises RigError."""
    damaged, ideal = np.zeros(len(cloud.xyz_m), dtype=np.bool_), shown_rectification(rig).rig
    for region in regions:
        if region.sensor == LIDAR and ideal.lidar is not None:
            view = lidar_view(cloud, ideal, region.view)
            held = damaged_image(region, ideal.camera(region.view))[view.row, view.column]
            if region.solid is not None:
                held &= _inside(view.point_m, region.solid, ideal)
            damaged |= among(cloud.xyz_m, view.point_m[held])
    return damaged


def _inside(points: Points, solid: Solid, rig: Rig) -> Mask:
    """(M,) mask of the points in a box, as `solid_around` makes it."""
    assert rig.lidar is not None
    rotation = rig.lidar.rig_SE3_lidar[:3, :3]
    right, down, forward = ((points - np.array(solid.centre_m)) @ rotation.T).T
    turn = -np.deg2rad(solid.yaw_deg)
    across = right * np.cos(turn) + forward * np.sin(turn)
    along = forward * np.cos(turn) - right * np.sin(turn)
    halves = np.array(solid.size_m) / 2 + _SLACK_M
    beyond = np.abs([across, down, along]).T - halves
    return np.asarray(beyond.max(axis=1, initial=-np.inf) <= 0)
