"""The fields of the foxglove messages that are understood (source: foxglove's published schemas), by protobuf number.

Numbers and types of published protobuf fields never change: an embedded schema that says otherwise is another message
under a known name. The JSON form has the same field names; only a timestamp is spelt otherwise in it.
"""

from enum import IntEnum
from typing import NamedTuple


class Kind(IntEnum):
    """Types of fields; the numbers are those of google.protobuf.FieldDescriptorProto.Type."""

    DOUBLE = 1
    INT64 = 3
    INT32 = 5
    FIXED32 = 7
    STRING = 9
    MESSAGE = 11
    BYTES = 12
    ENUM = 14


class Field(NamedTuple):
    """One field; `message` names the layout of a MESSAGE."""

    name: str
    kind: Kind
    message: str = ""
    repeated: bool = False


TIMESTAMP = "google.protobuf.Timestamp"
RAW_IMAGE = "foxglove.RawImage"
COMPRESSED_IMAGE = "foxglove.CompressedImage"
COMPRESSED_VIDEO = "foxglove.CompressedVideo"
CAMERA_CALIBRATION = "foxglove.CameraCalibration"
POINT_CLOUD = "foxglove.PointCloud"
FRAME_TRANSFORM = "foxglove.FrameTransform"
FRAME_TRANSFORMS = "foxglove.FrameTransforms"

_STAMP = Field("timestamp", Kind.MESSAGE, TIMESTAMP)
_FRAME_ID = Field("frame_id", Kind.STRING)
_WIDTH = Field("width", Kind.FIXED32)
_HEIGHT = Field("height", Kind.FIXED32)
_DATA = Field("data", Kind.BYTES)
_FORMAT = Field("format", Kind.STRING)


def _doubles(*names: str, first: int = 1, repeated: bool = False) -> dict[int, Field]:
    return {number: Field(name, Kind.DOUBLE, repeated=repeated) for number, name in enumerate(names, first)}


LAYOUTS: dict[str, dict[int, Field]] = {
    TIMESTAMP: {1: Field("seconds", Kind.INT64), 2: Field("nanos", Kind.INT32)},
    "foxglove.Vector3": _doubles("x", "y", "z"),
    "foxglove.Quaternion": _doubles("x", "y", "z", "w"),
    "foxglove.Pose": {
        1: Field("position", Kind.MESSAGE, "foxglove.Vector3"),
        2: Field("orientation", Kind.MESSAGE, "foxglove.Quaternion"),
    },
    "foxglove.PackedElementField": {
        1: Field("name", Kind.STRING),
        2: Field("offset", Kind.FIXED32),
        3: Field("type", Kind.ENUM),
    },
    RAW_IMAGE: {
        1: _STAMP,
        2: _WIDTH,
        3: _HEIGHT,
        4: Field("encoding", Kind.STRING),
        5: Field("step", Kind.FIXED32),
        6: _DATA,
        7: _FRAME_ID,
    },
    COMPRESSED_IMAGE: {1: _STAMP, 2: _DATA, 3: _FORMAT, 4: _FRAME_ID},
    COMPRESSED_VIDEO: {1: _STAMP, 2: _FRAME_ID, 3: _DATA, 4: _FORMAT},
    CAMERA_CALIBRATION: {
        1: _STAMP,
        2: _WIDTH,
        3: _HEIGHT,
        4: Field("distortion_model", Kind.STRING),
        **_doubles("D", "K", "R", "P", first=5, repeated=True),
        9: _FRAME_ID,
    },
    POINT_CLOUD: {
        1: _STAMP,
        2: _FRAME_ID,
        3: Field("pose", Kind.MESSAGE, "foxglove.Pose"),
        4: Field("point_stride", Kind.FIXED32),
        5: Field("fields", Kind.MESSAGE, "foxglove.PackedElementField", repeated=True),
        6: _DATA,
    },
    FRAME_TRANSFORM: {
        1: _STAMP,
        2: Field("parent_frame_id", Kind.STRING),
        3: Field("child_frame_id", Kind.STRING),
        4: Field("translation", Kind.MESSAGE, "foxglove.Vector3"),
        5: Field("rotation", Kind.MESSAGE, "foxglove.Quaternion"),
    },
    FRAME_TRANSFORMS: {1: Field("transforms", Kind.MESSAGE, FRAME_TRANSFORM, repeated=True)},
}

DESCRIPTORS: dict[str, dict[int, Field]] = {
    "FileDescriptorSet": {1: Field("file", Kind.MESSAGE, "FileDescriptorProto", repeated=True)},
    "FileDescriptorProto": {
        2: Field("package", Kind.STRING),
        4: Field("message_type", Kind.MESSAGE, "DescriptorProto", repeated=True),
    },
    "DescriptorProto": {
        1: Field("name", Kind.STRING),
        2: Field("field", Kind.MESSAGE, "FieldDescriptorProto", repeated=True),
    },
    "FieldDescriptorProto": {
        1: Field("name", Kind.STRING),
        3: Field("number", Kind.INT32),
        4: Field("label", Kind.ENUM),
        5: Field("type", Kind.ENUM),
        6: Field("type_name", Kind.STRING),
    },
}
"""What of google.protobuf's descriptor.proto is needed to compare an embedded schema with LAYOUTS."""
