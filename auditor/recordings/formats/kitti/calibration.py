"""KITTI's calibration files: lines of a name and its numbers, beside a drive's folder or in it."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from auditor.errors import RecordingError
from auditor.model.optics.geometry import Matrix, camera_centre, motion
from auditor.recordings.content import Contents, FileContent
from auditor.recordings.decoding.kitti import LIDAR_FRAME

CAMERAS = {"00": "camera_gray_left", "01": "camera_gray_right", "02": "camera_color_left", "03": "camera_color_right"}

_CAMERA_FILE = "calib_cam_to_cam.txt"
_LIDAR_FILE = "calib_velo_to_cam.txt"
_MAX_TEXT_BYTES = 16 * 2**20


class Calibration(NamedTuple):
    """P_rect and S_rect by camera number, and the LiDAR in the frame of rectified camera 0."""

    files: tuple[Path, ...]
    cameras: Mapping[str, Mapping[str, Matrix]]
    cam0_SE3_lidar: Matrix | None

    def transforms(self) -> list[dict[str, object]]:
        """The places of every camera and of the LiDAR, all in the frame of rectified camera 0."""
        children = {
            CAMERAS[number]: motion(np.eye(3), camera_centre(camera["P_rect"].reshape(3, 4)))
            for number, camera in self.cameras.items()
        }
        parent = CAMERAS["00"]
        if self.cam0_SE3_lidar is not None:
            children[LIDAR_FRAME] = self.cam0_SE3_lidar
        if parent not in children:
            return []
        return [
            {"parent": parent, "child": child, "parent_SE3_child": matrix.tolist()}
            for child, matrix in children.items()
            if child != parent
        ]


def read_calibration(drive: Path, contents: Contents) -> Calibration:
    """The calibration of a raw drive. Raises RecordingError where it is missing or ill-formed."""
    folder = next(
        (folder for folder in (drive, drive / "calib", drive.parent) if (folder / _CAMERA_FILE).is_file()), None
    )
    if folder is None:
        raise RecordingError(f"{_CAMERA_FILE} is missing", where=drive, remedy="put it beside the drive's folder")
    values = read_matrices(contents.of(folder / _CAMERA_FILE))
    cameras = {
        number: {"P_rect": values[f"P_rect_{number}"], "S_rect": values[f"S_rect_{number}"]}
        for number in CAMERAS
        if values.get(f"P_rect_{number}", np.empty(0)).size == 12
        and values.get(f"S_rect_{number}", np.empty(0)).size == 2
    }
    if not cameras:
        raise RecordingError("it holds no P_rect and S_rect of any camera", where=folder / _CAMERA_FILE)
    files = [folder / _CAMERA_FILE]
    cam0_SE3_lidar = None
    if (folder / _LIDAR_FILE).is_file():
        files.append(folder / _LIDAR_FILE)
        lidar = read_matrices(contents.of(folder / _LIDAR_FILE))
        try:
            unrectified = motion(lidar["R"].reshape(3, 3), lidar["T"])
            cam0_SE3_lidar = motion(values["R_rect_00"].reshape(3, 3), np.zeros(3)) @ unrectified
        except (KeyError, ValueError) as error:
            raise RecordingError(f"R, T or R_rect_00 is ill-formed ({error})", where=folder / _LIDAR_FILE) from error
    return Calibration(tuple(files), cameras, cam0_SE3_lidar)


def read_small_text(content: FileContent) -> str:
    """A calibration or time file. Raises RecordingError where it is too large to be one."""
    if content.size > _MAX_TEXT_BYTES:
        raise RecordingError(f"it has more than {_MAX_TEXT_BYTES} bytes", where=content.path)
    return content.read().decode("utf-8", "replace")


def read_matrices(content: FileContent) -> dict[str, Matrix]:
    """The numbers of every `name: numbers` line."""
    matrices = {}
    for line in read_small_text(content).splitlines():
        name, _, values = line.partition(":")
        try:
            matrices[name.strip()] = np.array([float(value) for value in values.split()])
        except ValueError:
            continue  # dates and other text
    return matrices
