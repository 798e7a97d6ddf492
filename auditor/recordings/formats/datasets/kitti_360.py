"""Drives of KITTI-360: `data_2d_raw/<date>_drive_<number>_sync`, with scans and calibration beside `data_2d_raw`.

Format: KITTI-360's documentation, "Sensor Calibration" and "2D/3D Data". calibration/perspective.txt holds P_rect,
S_rect and R_rect of the two cameras that look ahead, calib_cam_to_velo.txt the place of camera 0 in the LiDAR's frame.
The two fisheyes that look sideways overlap with no camera and are left out.
"""

from pathlib import Path

import numpy as np

from auditor.errors import RecordingError
from auditor.model.optics.geometry import invert, motion
from auditor.recordings.content import Contents
from auditor.recordings.formats.datasets.kitti_raw import (
    SCAN_TOPIC,
    KittiCalibration,
    KittiRecording,
    files_by_stamp,
    picture_topic,
    read_matrices,
    read_small_text,
)
from auditor.recordings.formats.folders import Stream

_CAMERAS = ("00", "01")


class Kitti360Reader:
    """Recognises a drive's folder of pictures."""

    def detects(self, path: Path) -> bool:
        """True for a folder with rectified pictures, with KITTI-360's calibration two folders above."""
        top = path.resolve().parent.parent
        return (path / "image_00" / "data_rect").is_dir() and (top / "calibration" / "perspective.txt").is_file()

    def open(self, path: Path) -> KittiRecording:
        """Open it. Raises RecordingError where its calibration is ill-formed."""
        path = path.resolve()
        top, contents = path.parent.parent, Contents()
        scans = top / "data_3d_raw" / path.name / "velodyne_points"
        calibration = _calibration(top / "calibration", contents)
        streams = [
            Stream(
                picture_topic(number), tuple(files_by_stamp(path / f"image_{number}", "*.png", contents, "data_rect"))
            )
            for number in _CAMERAS
        ]
        streams.append(Stream(SCAN_TOPIC, tuple(files_by_stamp(scans, "*.bin", contents))))
        others = [*path.glob("image_0[01]/timestamps.txt"), *scans.glob("timestamps.txt")]
        return KittiRecording(path, top, calibration, streams, others, "unknown", contents)


def _calibration(folder: Path, contents: Contents) -> KittiCalibration:
    cameras_file, lidar_file = folder / "perspective.txt", folder / "calib_cam_to_velo.txt"
    values = read_matrices(contents.of(cameras_file))
    try:
        cameras = {n: {"P_rect": values[f"P_rect_{n}"], "S_rect": values[f"S_rect_{n}"]} for n in _CAMERAS}
        rectified_R_cam0 = values["R_rect_00"].reshape(3, 3)
        numbers = [float(word) for word in read_small_text(contents.of(lidar_file)).split()]
        lidar_SE3_cam0 = np.vstack([np.reshape(numbers, (3, 4)), [0, 0, 0, 1]])
    except (KeyError, ValueError) as error:
        raise RecordingError(f"its calibration is ill-formed ({error})", where=folder) from error
    cam0_SE3_lidar = motion(rectified_R_cam0, np.zeros(3)) @ invert(lidar_SE3_cam0)
    return KittiCalibration((cameras_file, lidar_file), cameras, cam0_SE3_lidar)
