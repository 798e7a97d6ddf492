"""sensor_msgs/CameraInfo and tf2_msgs/TFMessage."""

from collections.abc import Sequence
from typing import Any, ClassVar, Literal

import numpy as np

from auditor.errors import DecodingError
from auditor.model.frames import Message
from auditor.model.optics.geometry import Matrix, motion, rotation_from_quaternion
from auditor.recordings.decoding.interface import CameraInfo, Header, ImageRegion, Transform
from auditor.recordings.decoding.ros import RosTypes, read_header

ABSURD = 1e9
"""An upper limit of focal lengths in pixels and distances in metres; map coordinates reach 1e7."""


class RosCameraInfoDecoder:
    """sensor_msgs/CameraInfo: K, D, R, P in ROS 1 and k, d, r, p in ROS 2."""

    kind: ClassVar[Literal["camera_info"]] = "camera_info"

    def __init__(self, types: RosTypes) -> None:
        self._types = types

    def header(self, message: Message) -> Header:
        """The header, without decoding the rest."""
        return read_header(message)

    def camera_info(self, message: Message) -> CameraInfo:
        """The calibration. Raises DecodingError where a number is absurd or not finite."""
        info = self._types.decode(message)
        d, k, r, p = (getattr(info, name, None) for name in (("D", "K", "R", "P") if hasattr(info, "K") else "dkrp"))
        if d is None or k is None or r is None or p is None:
            raise DecodingError("the camera info lacks one of D, K, R and P", where=message.topic)
        return CameraInfo(
            header=read_header(message),
            width_px=info.width,
            height_px=info.height,
            distortion=tuple(float(value) for value in d),
            intrinsics=checked_matrix(k, 3, message.topic),
            rotation=checked_matrix(r, 3, message.topic),
            projection=checked_matrix(p, 4, message.topic),
            distortion_model=str(getattr(info, "distortion_model", "")),
            region=_region(getattr(info, "roi", None)),
            binning=(int(getattr(info, "binning_x", 1)), int(getattr(info, "binning_y", 1))),
        )


def _region(roi: Any) -> ImageRegion:  # noqa: ANN401  # the class is generated
    return ImageRegion() if roi is None else ImageRegion(roi.x_offset, roi.y_offset, roi.width, roi.height)


def checked_matrix(values: Sequence[float] | Matrix, columns: int, topic: str) -> Matrix:
    """The (3, columns) matrix of a calibration. Raises DecodingError where it has another size or absurd numbers."""
    matrix = np.array(values, dtype=np.float64)
    if matrix.size != 3 * columns or not np.all(np.abs(matrix) < ABSURD):
        raise DecodingError("the camera info holds an ill-formed matrix", where=topic)
    return matrix.reshape(3, columns)


class RosTransformsDecoder:
    """tf2_msgs/TFMessage, and tf/tfMessage of old ROS 1."""

    kind: ClassVar[Literal["transforms"]] = "transforms"

    def __init__(self, types: RosTypes) -> None:
        self._types = types

    def transforms(self, message: Message) -> tuple[Transform, ...]:
        """All of the message. Raises DecodingError where not one of them is a motion."""
        made = [
            transform_of(
                stamped.header.frame_id,
                stamped.child_frame_id,
                numbers_of(stamped.transform.rotation, "xyzw"),
                numbers_of(stamped.transform.translation, "xyz"),
            )
            for stamped in self._types.decode(message).transforms
        ]
        return checked_transforms(made, message.topic)


def numbers_of(vector: object, names: str) -> tuple[float, ...]:
    """The numbers of a ROS vector or quaternion, by their names."""
    return tuple(float(getattr(vector, name)) for name in names)


def transform_of(parent: str, child: str, quaternion: Sequence[float], translation_m: Sequence[float]) -> Transform:
    """A transform of a quaternion (x, y, z, w) and a translation; one with a problem where they are no motion."""
    parent, child = parent.lstrip("/"), child.lstrip("/")
    try:
        return Transform(parent, child, motion_of(quaternion, translation_m))
    except ValueError as error:
        return Transform(parent, child, np.eye(4), problem=str(error))


def motion_of(quaternion: Sequence[float], translation_m: Sequence[float]) -> Matrix:
    """The (4, 4) motion of a quaternion (x, y, z, w) and a translation. Raises ValueError where they are none."""
    if not all(abs(number) < ABSURD for number in (*quaternion, *translation_m)):
        raise ValueError("its numbers are absurdly large or not finite")
    return motion(rotation_from_quaternion(*quaternion), np.array(translation_m, dtype=np.float64))


def checked_transforms(transforms: Sequence[Transform], topic: str) -> tuple[Transform, ...]:
    """Transforms of one message. Raises DecodingError where each has a problem: then the message is damaged."""
    if transforms and all(transform.problem for transform in transforms):
        first = transforms[0]
        raise DecodingError(f"{first.parent} to {first.child}: {first.problem}", where=topic)
    return tuple(transforms)
