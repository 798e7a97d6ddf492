"""The messages of a KITTI raw drive: picture files, scans, and calibrations written as small JSON messages.

Format: the KITTI raw data development kit. A scan is N x (x, y, z, reflectance), float32.
"""

import json
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from auditor.errors import DecodingError
from auditor.model.frames import Message
from auditor.recordings.decoding.clouds import finite
from auditor.recordings.decoding.images import PictureDecoder
from auditor.recordings.decoding.interface import CameraInfo, Header, Transform

PICTURE = "kitti/Picture"
SCAN = "kitti/Scan"
CALIBRATION = "kitti/Calibration"
TRANSFORMS = "kitti/Transforms"
OXTS = "kitti/Oxts"
LIDAR_FRAME = "velo_link"
POINT_BYTES = 16
_OXTS_NUMBERS = 6


def camera_frame(topic: str) -> str:
    """The coordinate frame of a camera's topics: `/kitti/camera_gray_left/image_rect` -> `camera_gray_left`."""
    return topic.split("/")[2]


class KittiPictureDecoder(PictureDecoder):
    """PNG files; they carry no stamp; the reader takes it from timestamps.txt."""

    def header(self, message: Message) -> Header:
        """The header, its stamp being that of the message."""
        return Header(message.log_time_ns, camera_frame(message.topic))

    def picture(self, message: Message) -> memoryview:
        """The file."""
        return memoryview(message.data)


def scan_points(message: Message) -> NDArray[np.float32]:
    """(N, 4) float32: x, y, z in metres and reflectance. Raises DecodingError where the scan is cut."""
    if len(message.data) % POINT_BYTES or not message.data:
        raise DecodingError(f"the scan is cut: {len(message.data)} bytes are not whole points", where=message.topic)
    points: NDArray[np.float32] = np.frombuffer(message.data, "<f4").reshape(-1, 4)
    return points


class KittiScanDecoder:
    """Scans of the HDL-64E."""

    kind: ClassVar[Literal["cloud"]] = "cloud"

    def header(self, message: Message) -> Header:
        """The header, its stamp being that of the message."""
        return Header(message.log_time_ns, LIDAR_FRAME)

    def xyz_m(self, message: Message) -> NDArray[np.float32]:
        """The finite points, (N, 3) float32 metres."""
        return finite(np.ascontiguousarray(scan_points(message)[:, :3]))


def oxts_numbers(message: Message) -> tuple[float, ...]:
    """The first six numbers of a file of the GPS and its inertial unit: latitude and longitude (deg), altitude (m),
    roll, pitch and yaw (rad, counter-clockwise from east). Raises ValueError where it has fewer.
    """
    numbers = tuple(float(word) for word in bytes(message.data).split()[:_OXTS_NUMBERS])
    if len(numbers) < _OXTS_NUMBERS:
        raise ValueError("it is cut")
    return numbers


class KittiCalibrationDecoder:
    """A camera's part of calib_cam_to_cam.txt: P_rect and S_rect; the images are rectified, so D = 0 and R = I."""

    kind: ClassVar[Literal["camera_info"]] = "camera_info"

    def header(self, message: Message) -> Header:
        """The header, its stamp being that of the message."""
        return Header(message.log_time_ns, camera_frame(message.topic))

    def camera_info(self, message: Message) -> CameraInfo:
        """The calibration."""
        calibration = json.loads(bytes(message.data))
        projection = np.array(calibration["P_rect"], dtype=np.float64).reshape(3, 4)
        width, height = (round(value) for value in calibration["S_rect"])
        return CameraInfo(self.header(message), width, height, (), projection[:, :3], np.eye(3), projection)


class KittiTransformsDecoder:
    """The places of the cameras and the LiDAR, from both calibration files."""

    kind: ClassVar[Literal["transforms"]] = "transforms"

    def transforms(self, message: Message) -> tuple[Transform, ...]:
        """All of the message."""
        return tuple(
            Transform(entry["parent"], entry["child"], np.array(entry["parent_SE3_child"], dtype=np.float64))
            for entry in json.loads(bytes(message.data))
        )
