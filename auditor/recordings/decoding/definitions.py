"""What a message type holds by its definition in the recording: raw bytes, a picture or points."""

import re

from auditor.errors import DecodingError
from auditor.recordings.decoding.foxglove_layouts import DESCRIPTORS, Kind
from auditor.recordings.decoding.protobuf import MAX_SCHEMA_BYTES, decode_protobuf
from auditor.recordings.decoding.ros import MAX_DEFINITION_BYTES
from auditor.recordings.recording import Definition

_SENSOR_NAMES = r"(?:Raw|Compressed)?Image|CompressedVideo|PointCloud2?|(?:MultiEcho)?LaserScan"
_SENSOR = re.compile(rf"\b(?:sensor_msgs|foxglove|foxglove_msgs)(?:/msg/|/|::msg::|::|\.)(?:{_SENSOR_NAMES})\b")
_BYTES = re.compile(
    r"\b(?:u?int8|byte|char)\s*\[(?:\s*|<=\s*\d+|\d{3,})\]|\bsequence\s*<\s*(?:u?int8|octet|char)\b"
    r"|\"contentEncoding\"\s*:\s*\"base64\""
)
_COMMENT = re.compile(r"#[^\n]*|//[^\n]*")


def raw_data_of(definition: Definition | None) -> str:
    """What of a type's definition may be a sensor's data: the type of a picture or cloud, or "raw bytes".

    Empty where it has none, or where there is no definition that can be read.
    """
    if definition is None:
        return ""
    if definition.encoding == "protobuf":
        return _of_protobuf(definition.data)
    if len(definition.data) > MAX_DEFINITION_BYTES:
        return ""
    text = _COMMENT.sub("", definition.text)
    sensor = _SENSOR.search(text)
    if sensor:
        return sensor.group()
    return "raw bytes" if _BYTES.search(text) else ""


def _of_protobuf(data: bytes) -> str:
    if len(data) > MAX_SCHEMA_BYTES:
        return ""
    try:
        files = decode_protobuf("FileDescriptorSet", memoryview(data), DESCRIPTORS)["file"]
    except DecodingError:
        return ""
    fields = [field for file in files for message in file["message_type"] for field in message["field"]]
    sensor = next((match.group() for field in fields if (match := _SENSOR.search(field["type_name"]))), "")
    return sensor or ("raw bytes" if any(field["type"] == Kind.BYTES for field in fields) else "")
