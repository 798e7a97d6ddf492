"""Message types that carry no camera pictures and no LiDAR points, by the names that their packages give them.

The list is for types that are common and may be large. Types that hold whatever somebody puts into them are not in it:
std_msgs/String and arrays of bytes or numbers. A type that is not in it is judged by its data (`coverage`), and by what
its definition in the recording holds: raw bytes, a picture or points.
"""

import re

from auditor.errors import DecodingError
from auditor.recordings.decoding.foxglove_layouts import DESCRIPTORS, Kind
from auditor.recordings.decoding.protobuf import MAX_SCHEMA_BYTES, decode_protobuf
from auditor.recordings.decoding.ros import MAX_DEFINITION_BYTES
from auditor.recordings.recording import Definition

_NUMBERS = r"(Bool|Byte|Char|ColorRGBA|Duration|Empty|Float\d+|Header|U?Int\d+|Time)"
_SENSORS = (
    r"(BatteryState|CameraInfo|FluidPressure|Illuminance|Imu|JointState|Joy|JoyFeedback|JoyFeedbackArray|MagneticField"
    r"|MultiDOFJointState|NavSatFix|NavSatStatus|Range|RegionOfInterest|RelativeHumidity|Temperature|TimeReference)"
)
_FOXGLOVE = (
    r"(CameraCalibration|CompressedAudio|FrameTransforms?|GeoJSON|Grid|ImageAnnotations|ImageMarkerArray|JointStates?"
    r"|KeyValuePair|LocationFix(es)?|Log|Odometry|Point[23s]*|PoseInFrame|PosesInFrame|RawAudio|SceneEntity"
    r"|SceneUpdate|VoxelGrid)"
)

_ROS = (
    "action_msgs",
    "actionlib_msgs",
    "audio_common_msgs",
    "bond",
    "builtin_interfaces",
    "composition_interfaces",
    "control_msgs",
    "costmap_2d",
    "diagnostic_msgs",
    "dynamic_reconfigure",
    "geographic_msgs",
    "geometry_msgs",
    "grid_map_msgs",
    "lifecycle_msgs",
    "map_msgs",
    "moveit_msgs",
    "nav2_msgs",
    "nav_msgs",
    "octomap_msgs",
    "pcl_msgs",
    "rcl_interfaces",
    "rosbag2_interfaces",
    "rosgraph_msgs",
    "service_msgs",
    "shape_msgs",
    "statistics_msgs",
    "tf",
    "tf2_msgs",
    "trajectory_msgs",
    "type_description_interfaces",
    "unique_identifier_msgs",
    "vision_msgs",
    "visualization_msgs",
)
"""Packages of ROS itself, and of its maps, navigation, control and what was found in pictures."""

_VEHICLES = (
    "ackermann_msgs",
    "can_msgs",
    "dbw_[a-z0-9_]+_msgs",
    "derived_object_msgs",
    "gps_common",
    "gps_msgs",
    "mavros_msgs",
    "nmea_msgs",
    "novatel_[a-z0-9_]+_msgs",
    "px4_msgs",
    "rtcm_msgs",
    "septentrio_gnss_driver",
    "ublox_msgs",
    "ublox_ubx_msgs",
    "autoware_[a-z0-9_]*(adapi|auto|common|control|localization|map|perception|planning|system|v2x|vehicle)_[a-z0-9_]*"
    "msgs",
    "tier4_[a-z0-9_]+_msgs",
)
"""Packages of vehicles: buses, satellite receivers, control, and what others perceived and planned."""

_OTHER = re.compile(
    rf"({'|'.join((*_ROS, *_VEHICLES))})/msg/\w+"
    rf"|std_msgs/msg/{_NUMBERS}|sensor_msgs/msg/{_SENSORS}|stereo_msgs/msg/DisparityImage"
    rf"|(foxglove\.|foxglove_msgs/msg/){_FOXGLOVE}|kitti/Oxts"
)

_SENSOR_NAMES = r"(?:Raw|Compressed)?Image|CompressedVideo|PointCloud2?|(?:MultiEcho)?LaserScan"
_SENSOR = re.compile(rf"\b(?:sensor_msgs|foxglove|foxglove_msgs)(?:/msg/|/|::msg::|::|\.)(?:{_SENSOR_NAMES})\b")
_BYTES = re.compile(
    r"\b(?:u?int8|byte|char)\s*\[(?:\s*|<=\s*\d+|\d{3,})\]|\bsequence\s*<\s*(?:u?int8|octet|char)\b"
    r"|\"contentEncoding\"\s*:\s*\"base64\""
)
_COMMENT = re.compile(r"#[^\n]*|//[^\n]*")


def is_other(schema: str) -> bool:
    """True for a type that is known to carry neither pictures of cameras nor points of LiDARs."""
    return _OTHER.fullmatch(schema) is not None


def is_of_radar(schema: str) -> bool:
    """True where the type's own name says radar, which its driver chose; a topic's name is whoever recorded it's."""
    return "radar" in schema.lower()


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
