"""Camera infos as their pictures need them: regions and binnings applied, and those that are no camera's refused."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from auditor.errors import RigError
from auditor.model.optics.geometry import Matrix
from auditor.recordings.decoding import CameraInfo
from auditor.recordings.decoding.interface import Region, SizePx
from auditor.recordings.parameters import CAMERA_LIMITS

_WHOLE = Region()


def of_pictures(info: CameraInfo, size_px: SizePx) -> CameraInfo:
    """The camera info with K and P of the pictures as they were recorded, which have `size_px`.

    K and P are of the whole sensor (sensor_msgs/CameraInfo); they are moved by the region's corner and divided by the
    binning, as ROS's image_geometry does. Where the camera info has the size of the pictures in spite of both, its
    driver wrote K and P for them already. Raises RigError where neither fits the pictures.
    """
    across, down = (max(by, 1) for by in info.binning)
    region = info.region if info.region.width_px and info.region.height_px else _WHOLE
    if (region == _WHOLE and across == down == 1) or size_px == (info.width_px, info.height_px):
        return info
    width, height = (info.width_px, info.height_px) if region == _WHOLE else (region.width_px, region.height_px)
    if not (_is_binned(size_px[0], width, across) and _is_binned(size_px[1], height, down)):
        raise RigError(
            f"its pictures have {size_px[0]} x {size_px[1]} px, and its camera info speaks of {width} x {height} px of "
            f"{info.width_px} x {info.height_px}, binned by {across} x {down}"
        )
    picture_of_sensor = np.array(
        [[1 / across, 0, -region.left_px / across], [0, 1 / down, -region.top_px / down], [0, 0, 1]]
    )
    return replace(
        info,
        intrinsics=picture_of_sensor @ info.intrinsics,
        projection=picture_of_sensor @ info.projection,
        width_px=size_px[0],
        height_px=size_px[1],
    )


def _is_binned(binned_px: int, whole_px: int, by: int) -> bool:
    """Whether so many pixels are left of a row or column; a rest may have been dropped, or kept as one more."""
    return abs(binned_px * by - whole_px) < by


def check_size(size_px: SizePx) -> None:
    """Raises RigError where pictures of a size cannot be compared."""
    if not all(0 < side <= CAMERA_LIMITS.widest_px for side in size_px):
        raise RigError(f"its pictures have {size_px[0]} x {size_px[1]} px")


def check_camera(matrices: Iterable[Matrix], rotation: Matrix, distortion: Iterable[float]) -> None:
    """Raises RigError where a (3, 3) matrix is not that of a lens, or a rotation or distortion is absurd.

    Such numbers would overflow, or cannot be inverted, further on.
    """
    for K in matrices:
        if not np.all(np.abs(K) < CAMERA_LIMITS.largest):
            raise RigError("its camera info holds numbers that are absurd or not finite")
        if not (K[0, 0] > 0 and K[1, 1] > 0):
            raise RigError("it is uncalibrated (its camera info has no focal length)")
        if abs(K[2, 2] - 1) > CAMERA_LIMITS.tolerance or not np.linalg.cond(K) < CAMERA_LIMITS.worst_condition:
            raise RigError("the K or P of its camera info is not that of a camera: it cannot be inverted")
    if not np.all(np.abs(rotation @ rotation.T - np.eye(3)) < CAMERA_LIMITS.tolerance):
        raise RigError("the R of its camera info is not a rotation")
    if not all(abs(one) < CAMERA_LIMITS.largest_distortion for one in distortion):
        raise RigError("its distortion is absurd or not finite")
