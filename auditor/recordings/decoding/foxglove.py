"""Foxglove's images, point clouds, calibrations and transforms, in protobuf and in JSON."""

from collections.abc import Callable, Collection
from types import SimpleNamespace
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from auditor.errors import DecodingError
from auditor.model.frames import Message
from auditor.recordings.decoding.clouds import finite, points_of, xyz_of
from auditor.recordings.decoding.foxglove_layouts import (
    CAMERA_CALIBRATION,
    COMPRESSED_IMAGE,
    COMPRESSED_VIDEO,
    FRAME_TRANSFORM,
    FRAME_TRANSFORMS,
    POINT_CLOUD,
    RAW_IMAGE,
    decode_json,
)
from auditor.recordings.decoding.geometry import checked_matrix, checked_transforms, motion_of, transform_of
from auditor.recordings.decoding.images import PictureDecoder, RawDecoder
from auditor.recordings.decoding.interface import CameraInfo, Decoder, Header, SizePx, Transform
from auditor.recordings.decoding.protobuf import check_schema, decode_protobuf
from auditor.recordings.decoding.ros import RosTypes
from auditor.recordings.decoding.videos.tracks import VideoData, Videos

_MAX_STAMP_NS = 2**63 - 1

_NO_ROTATION = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
_NO_TRANSLATION = {"x": 0.0, "y": 0.0, "z": 0.0}

_ROS_DATATYPES = {1: 2, 2: 1, 3: 4, 4: 3, 5: 6, 6: 5, 7: 7, 8: 8}
"""foxglove.PackedElementField's numeric types as sensor_msgs/PointField's."""


class FoxgloveMessages:
    """Decodes messages of one recording into dicts; an embedded protobuf schema must agree with the known layout."""

    def __init__(self, types: RosTypes) -> None:
        super().__init__()
        self._types = types
        self._checked: set[str] = set()

    def decode(self, message: Message, without: Collection[str] = ()) -> dict[str, Any]:
        """The fields by name; JSON fields in the set left out are not decoded. Raises DecodingError."""
        try:
            if message.encoding == "json":
                return decode_json(message.schema, bytes(message.data), without)
            if message.schema not in self._checked:
                definition = self._types.definition(message.schema)
                if definition is not None:
                    check_schema(message.schema, definition.data)
                self._checked.add(message.schema)
            return decode_protobuf(message.schema, memoryview(message.data))
        except DecodingError as error:
            raise DecodingError(error.what, where=message.topic) from error

    def header(self, message: Message) -> Header:
        """Stamp (0: none) and frame id."""
        values = self.decode(message, without=("data",))
        return Header(stamp_ns(values), values["frame_id"].lstrip("/"))


def stamp_ns(values: dict[str, Any]) -> int:
    """Nanoseconds since 1970 of a message's timestamp, which may be negative; 0 where it has none.

    Raises DecodingError.
    """
    stamp = values["timestamp"]
    time_ns = stamp["seconds"] * 10**9 + stamp["nanos"] if stamp else 0
    if abs(time_ns) > _MAX_STAMP_NS:
        raise DecodingError("its timestamp is out of range")
    return int(time_ns)


class FoxgloveRawImageDecoder(FoxgloveMessages, RawDecoder):
    """foxglove.RawImage; its encodings are ROS's."""

    def size_px(self, message: Message) -> SizePx:
        """The declared width and height."""
        values = self.decode(message, without=("data",))
        return values["width"], values["height"]

    def image(self, message: Message) -> SimpleNamespace:
        """The message with the fields of sensor_msgs/Image."""
        values = self.decode(message)
        return SimpleNamespace(**values | {"data": np.frombuffer(values["data"], np.uint8)}, is_bigendian=False)


class FoxgloveCompressedImageDecoder(FoxgloveMessages, PictureDecoder):
    """foxglove.CompressedImage with a PNG or JPEG inside."""

    def picture(self, message: Message) -> memoryview:
        """The file inside the message."""
        data: memoryview = self.decode(message)["data"]
        return data


class FoxglovePointCloudDecoder(FoxgloveMessages):
    """foxglove.PointCloud: as many points as its data hold; `pose` transforms them into the frame."""

    kind: ClassVar[Literal["cloud"]] = "cloud"

    def xyz_m(self, message: Message) -> NDArray[np.float32]:
        """The finite points, (N, 3) float32 metres."""
        values = self.decode(message)
        cloud = _cloud_of(values)
        if cloud.row_step % max(cloud.point_step, 1):
            raise DecodingError(f"the cloud is cut: {cloud.row_step} bytes are not whole points", where=message.topic)
        xyz_m = finite(xyz_of(points_of(cloud)))
        pose = values["pose"] or {}
        try:
            frame_SE3_points = motion_of(
                _vector(pose, "orientation", _NO_ROTATION), _vector(pose, "position", _NO_TRANSLATION)
            )
        except ValueError as error:
            raise DecodingError(str(error), where=message.topic) from error
        if np.array_equal(frame_SE3_points, np.eye(4)):
            return xyz_m
        with np.errstate(over="ignore", invalid="ignore"):
            moved = xyz_m @ frame_SE3_points[:3, :3].T + frame_SE3_points[:3, 3]
        return finite(moved.astype(np.float32))


def _cloud_of(values: dict[str, Any]) -> SimpleNamespace:
    """A foxglove.PointCloud with the fields of sensor_msgs/PointCloud2."""
    data, stride = np.frombuffer(values["data"], np.uint8), values["point_stride"]
    fields = [
        SimpleNamespace(name=one["name"], offset=one["offset"], datatype=_ROS_DATATYPES.get(one["type"], 0), count=1)
        for one in values["fields"]
    ]
    return SimpleNamespace(
        width=data.size // max(stride, 1),
        height=1,
        point_step=stride,
        row_step=data.size,
        fields=fields,
        data=data,
        is_bigendian=False,
    )


class FoxgloveCameraCalibrationDecoder(FoxgloveMessages):
    """foxglove.CameraCalibration; without R there is no rotation, without P there is K without an offset."""

    kind: ClassVar[Literal["camera_info"]] = "camera_info"

    def camera_info(self, message: Message) -> CameraInfo:
        """The calibration. Raises DecodingError where a number is absurd or not finite."""
        values = self.decode(message)
        K = checked_matrix(values["K"], 3, message.topic)
        R = checked_matrix(values["R"], 3, message.topic) if values["R"] else np.eye(3)
        P = checked_matrix(values["P"], 4, message.topic) if values["P"] else np.hstack([K, np.zeros((3, 1))])
        header = self.header(message)
        model = str(values["distortion_model"])
        return CameraInfo(header, values["width"], values["height"], tuple(values["D"]), K, R, P, model)


class FoxgloveVideoDecoder(Videos, FoxgloveMessages):
    """foxglove.CompressedVideo."""

    kind: ClassVar[Literal["image"]] = "image"

    def __init__(self, types: RosTypes) -> None:
        Videos.__init__(self, self._video)
        FoxgloveMessages.__init__(self, types)

    def _video(self, message: Message) -> VideoData:
        values = self.decode(message)
        return VideoData(values["format"], bytes(values["data"]), stamp_ns(values) or message.log_time_ns)


class FoxgloveTransformsDecoder(FoxgloveMessages):
    """foxglove.FrameTransform and foxglove.FrameTransforms."""

    kind: ClassVar[Literal["transforms"]] = "transforms"

    def transforms(self, message: Message) -> tuple[Transform, ...]:
        """All of the message. Raises DecodingError where not one of them is a motion."""
        values = self.decode(message)
        entries = values["transforms"] if message.schema == FRAME_TRANSFORMS else [values]
        made = [
            transform_of(
                entry["parent_frame_id"],
                entry["child_frame_id"],
                _vector(entry, "rotation", _NO_ROTATION),
                _vector(entry, "translation", _NO_TRANSLATION),
            )
            for entry in entries
        ]
        return checked_transforms(made, message.topic)


def _vector(values: dict[str, Any], name: str, absent: dict[str, float]) -> tuple[float, ...]:
    """The numbers of a rotation or translation, in the order of `absent`, which stands for one that is not there."""
    numbers = values.get(name) or absent
    return tuple(numbers[axis] for axis in absent)


DECODERS: dict[str, Callable[[RosTypes], Decoder]] = {
    COMPRESSED_VIDEO: FoxgloveVideoDecoder,
    RAW_IMAGE: FoxgloveRawImageDecoder,
    COMPRESSED_IMAGE: FoxgloveCompressedImageDecoder,
    POINT_CLOUD: FoxglovePointCloudDecoder,
    CAMERA_CALIBRATION: FoxgloveCameraCalibrationDecoder,
    FRAME_TRANSFORM: FoxgloveTransformsDecoder,
    FRAME_TRANSFORMS: FoxgloveTransformsDecoder,
}
