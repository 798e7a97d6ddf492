"""The fields of the foxglove messages that are supported (source: foxglove's published schemas), by protobuf number.

Numbers and types of published protobuf fields never change: an embedded schema that differs is another message
under a known name. The JSON form has the same field names, except those of a timestamp.
"""

import json
from binascii import Error as Base64Error
from binascii import a2b_base64
from collections.abc import Collection
from enum import IntEnum
from typing import Any, NamedTuple

from auditor.errors import DecodingError

TIMESTAMP = "google.protobuf.Timestamp"
RAW_IMAGE = "foxglove.RawImage"
COMPRESSED_IMAGE = "foxglove.CompressedImage"
COMPRESSED_VIDEO = "foxglove.CompressedVideo"
CAMERA_CALIBRATION = "foxglove.CameraCalibration"
POINT_CLOUD = "foxglove.PointCloud"
FRAME_TRANSFORM = "foxglove.FrameTransform"
FRAME_TRANSFORMS = "foxglove.FrameTransforms"
LOCATION_FIX = "foxglove.LocationFix"
POSE_IN_FRAME = "foxglove.PoseInFrame"
POSES_IN_FRAME = "foxglove.PosesInFrame"
MAX_BYTES = 48 * 2**20

MAX_PARTS = 100_000
"""Parsed lists and objects take 20 times their text: they are counted first. Pixels and points are one text."""

_TIMES = {"seconds": "sec", "nanos": "nsec"}


class FieldType(IntEnum):
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
    kind: FieldType
    message: str = ""
    repeated: bool = False


_STAMP = Field("timestamp", FieldType.MESSAGE, TIMESTAMP)
_FRAME_ID = Field("frame_id", FieldType.STRING)
_WIDTH = Field("width", FieldType.FIXED32)
_HEIGHT = Field("height", FieldType.FIXED32)
_DATA = Field("data", FieldType.BYTES)
_FORMAT = Field("format", FieldType.STRING)


def _doubles(*names: str, first: int = 1, repeated: bool = False) -> dict[int, Field]:
    return {number: Field(name, FieldType.DOUBLE, repeated=repeated) for number, name in enumerate(names, first)}


LAYOUTS: dict[str, dict[int, Field]] = {
    TIMESTAMP: {1: Field("seconds", FieldType.INT64), 2: Field("nanos", FieldType.INT32)},
    "foxglove.Vector3": _doubles("x", "y", "z"),
    "foxglove.Quaternion": _doubles("x", "y", "z", "w"),
    "foxglove.Pose": {
        1: Field("position", FieldType.MESSAGE, "foxglove.Vector3"),
        2: Field("orientation", FieldType.MESSAGE, "foxglove.Quaternion"),
    },
    "foxglove.PackedElementField": {
        1: Field("name", FieldType.STRING),
        2: Field("offset", FieldType.FIXED32),
        3: Field("type", FieldType.ENUM),
    },
    RAW_IMAGE: {
        1: _STAMP,
        2: _WIDTH,
        3: _HEIGHT,
        4: Field("encoding", FieldType.STRING),
        5: Field("step", FieldType.FIXED32),
        6: _DATA,
        7: _FRAME_ID,
    },
    COMPRESSED_IMAGE: {1: _STAMP, 2: _DATA, 3: _FORMAT, 4: _FRAME_ID},
    COMPRESSED_VIDEO: {1: _STAMP, 2: _FRAME_ID, 3: _DATA, 4: _FORMAT},
    CAMERA_CALIBRATION: {
        1: _STAMP,
        2: _WIDTH,
        3: _HEIGHT,
        4: Field("distortion_model", FieldType.STRING),
        **_doubles("D", "K", "R", "P", first=5, repeated=True),
        9: _FRAME_ID,
    },
    POINT_CLOUD: {
        1: _STAMP,
        2: _FRAME_ID,
        3: Field("pose", FieldType.MESSAGE, "foxglove.Pose"),
        4: Field("point_stride", FieldType.FIXED32),
        5: Field("fields", FieldType.MESSAGE, "foxglove.PackedElementField", repeated=True),
        6: _DATA,
    },
    FRAME_TRANSFORM: {
        1: _STAMP,
        2: Field("parent_frame_id", FieldType.STRING),
        3: Field("child_frame_id", FieldType.STRING),
        4: Field("translation", FieldType.MESSAGE, "foxglove.Vector3"),
        5: Field("rotation", FieldType.MESSAGE, "foxglove.Quaternion"),
    },
    FRAME_TRANSFORMS: {1: Field("transforms", FieldType.MESSAGE, FRAME_TRANSFORM, repeated=True)},
    LOCATION_FIX: {  # what is read of it; older schemas lack some of the rest
        **_doubles("latitude", "longitude", "altitude"),
        6: _STAMP,
        7: _FRAME_ID,
    },
    POSE_IN_FRAME: {1: _STAMP, 2: _FRAME_ID, 3: Field("pose", FieldType.MESSAGE, "foxglove.Pose")},
    POSES_IN_FRAME: {1: _STAMP, 2: _FRAME_ID, 3: Field("poses", FieldType.MESSAGE, "foxglove.Pose", repeated=True)},
}


DESCRIPTORS: dict[str, dict[int, Field]] = {
    "FileDescriptorSet": {1: Field("file", FieldType.MESSAGE, "FileDescriptorProto", repeated=True)},
    "FileDescriptorProto": {
        2: Field("package", FieldType.STRING),
        4: Field("message_type", FieldType.MESSAGE, "DescriptorProto", repeated=True),
    },
    "DescriptorProto": {
        1: Field("name", FieldType.STRING),
        2: Field("field", FieldType.MESSAGE, "FieldDescriptorProto", repeated=True),
    },
    "FieldDescriptorProto": {
        1: Field("name", FieldType.STRING),
        3: Field("number", FieldType.INT32),
        4: Field("label", FieldType.ENUM),
        5: Field("type", FieldType.ENUM),
        6: Field("type_name", FieldType.STRING),
    },
}
"""The part of google.protobuf's descriptor.proto that is needed to compare an embedded schema with LAYOUTS."""


_NUMBERS = {FieldType.INT64, FieldType.INT32, FieldType.FIXED32, FieldType.ENUM}


def decode_json(name: str, data: bytes, without: Collection[str] = ()) -> dict[str, Any]:
    """The fields of a message by name, as `decode_protobuf` gives them, but for some left out. Raises DecodingError."""
    if len(data) > MAX_BYTES or sum(data.count(mark) for mark in (b",", b"[", b"{")) > MAX_PARTS:
        raise DecodingError("the JSON message is too large or has too many parts")
    if not data.isascii() and len(data) > 2**20:
        # One character beyond ASCII makes the whole text take up to four times its bytes.
        raise DecodingError("the JSON message is large and not plain ASCII")
    try:
        parsed = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise DecodingError("the message is not JSON") from error
    return _message(name, parsed, without)


def _message(name: str, parsed: object, without: Collection[str] = ()) -> dict[str, Any]:
    if not isinstance(parsed, dict):
        raise DecodingError(f"the message holds no {name}")
    values: dict[str, Any] = {}
    for field in LAYOUTS[name].values():
        if field.name in without:
            continue
        value = parsed.get(_TIMES[field.name] if name == TIMESTAMP else field.name)
        if field.repeated:
            if not isinstance(value, list | None):
                raise DecodingError(f"the field {field.name!r} of {name} is not a list")
            values[field.name] = [_value(field, part) for part in value or ()]
        else:
            values[field.name] = _value(field, value)
    return values


def _value(field: Field, value: object) -> Any:  # noqa: ANN401  # what the field's kind holds
    if field.kind is FieldType.MESSAGE:
        return None if value is None else _message(field.message, value)
    if field.kind in {FieldType.STRING, FieldType.BYTES}:
        if not isinstance(value, str | None):
            raise DecodingError(f"the field {field.name!r} is not a text")
        return value or "" if field.kind is FieldType.STRING else _bytes(value or "")
    if not isinstance(value, int | float | None) or (field.kind in _NUMBERS and not isinstance(value, int | None)):
        raise DecodingError(f"the field {field.name!r} is not a number")
    try:
        number = float(value or 0) if field.kind is FieldType.DOUBLE else int(value or 0)
    except OverflowError as error:
        raise DecodingError(f"the field {field.name!r} is too large") from error
    if field.kind is FieldType.FIXED32 and not 0 <= number < 2**32:
        raise DecodingError(f"the field {field.name!r} is out of range")
    return number


def _bytes(text: str) -> memoryview:
    try:
        return memoryview(a2b_base64(text, strict_mode=True))
    except (Base64Error, ValueError) as error:
        raise DecodingError("its data are not base64") from error
