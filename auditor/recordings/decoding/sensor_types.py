"""Message types that carry camera pictures or LiDAR points, those that cannot be read included, and others that do not.

Each that cannot be read has a sentence on what to install or how to convert it, so that the sensor can be audited.

The list of others is for types that are common and may be large. Types that hold whatever somebody puts into them are
not in it: std_msgs/String and arrays of bytes or numbers. A type that is in neither list is judged by its data
(`coverage`), and by what its definition in the recording holds: raw bytes, a picture or points.
"""

import re
from collections.abc import Mapping
from typing import Literal, NamedTuple

from auditor.errors import DecodingError
from auditor.recordings import schemas
from auditor.recordings.decoding.foxglove_layouts import COMPRESSED_VIDEO, DESCRIPTORS, FieldType
from auditor.recordings.decoding.images import DEPTH_PICTURE
from auditor.recordings.decoding.points import ouster
from auditor.recordings.decoding.protobuf import MAX_SCHEMA_BYTES, decode_protobuf
from auditor.recordings.decoding.ros import MAX_DEFINITION_BYTES
from auditor.recordings.recording import Definition

SensorKind = Literal["camera", "LiDAR", "camera or LiDAR"]

CAMERA: SensorKind = "camera"
LIDAR: SensorKind = "LiDAR"
UNKNOWN: SensorKind = "camera or LiDAR"
"""The kind of a sensor whose message type nobody listed."""

KINDS: Mapping[str, SensorKind] = {"image": CAMERA, "cloud": LIDAR}
"""The kind of sensor by the kind of decoder."""


class SensorType(NamedTuple):
    """The kind of sensor that a message type carries, and how its data become readable."""

    kind: SensorKind
    remedy: str


def _packets(driver: str) -> SensorType:
    return SensorType(LIDAR, f"play it through {driver} and record its sensor_msgs/PointCloud2")


_HESAI = _packets("hesai_ros_driver (source_type 3)")
_PANDAR = _packets("hesai_lidar (data_type rosbag)")
_SEYOND = _packets("seyond_ros_driver")
_ROBOSENSE = _packets("rslidar_sdk (msg_source 2)")
_REPUBLISH_CLOUD = "republish it as sensor_msgs/PointCloud2 with point_cloud_transport's republish and record that"
_REPUBLISH = "republish it as sensor_msgs/Image with image_transport's republish and record that"
_OF_ROS_2 = "record it as MCAP with Foxglove's own schemas, or as sensor_msgs"

UNREAD: Mapping[str, SensorType] = {
    "hesai_ros_driver/msg/UdpFrame": _HESAI,
    "hesai_ros_driver/msg/UdpPacket": _HESAI,
    "hesai_lidar/msg/PandarScan": _PANDAR,
    "hesai_lidar/msg/PandarPacket": _PANDAR,
    "pandar_msgs/msg/PandarScan": _packets("nebula_ros or pandar_pointcloud"),
    "nebula_msgs/msg/NebulaPackets": _packets("nebula_ros (launch_hw false)"),
    "seyond/msg/SeyondScan": _SEYOND,
    "seyond/msg/SeyondPacket": _SEYOND,
    "seyond_decoder/msg/SeyondScan": _SEYOND,
    "velodyne_msgs/msg/VelodynePacket": _packets("velodyne_pointcloud"),
    "robosense_msgs/msg/RobosenseScan": _packets("nebula_ros (launch_hw false)"),
    "rslidar_msg/msg/RslidarPacket": _ROBOSENSE,
    "rslidar_msg/msg/RslidarScan": _ROBOSENSE,
    "rslidar_msgs/msg/rslidarPacket": _ROBOSENSE,
    "rslidar_msgs/msg/rslidarScan": _ROBOSENSE,
    "draco_point_cloud_transport/msg/CompressedPointCloud2": SensorType(LIDAR, _REPUBLISH_CLOUD),
    "theora_image_transport/msg/Packet": SensorType(CAMERA, _REPUBLISH),
    "foxglove_msgs/msg/RawImage": SensorType(CAMERA, _OF_ROS_2),
    "foxglove_msgs/msg/CompressedImage": SensorType(CAMERA, _OF_ROS_2),
    "foxglove_msgs/msg/PointCloud": SensorType(LIDAR, _OF_ROS_2),
}
"""Types without a decoder. A decoder of the entry points group `auditor.decoders` goes before this table."""

_VIDEO = "install auditor[video] where it is H.264, H.265, AV1, VP9 or VP8; convert other videos to one of them"

_OF_OUSTER = (
    "record the driver's topic metadata beside it, or attach the sensor's metadata to the MCAP (mcap add attachment "
    f"FILE.mcap --file METADATA.json); else {_packets('ouster_ros (replay)').remedy}"
)

_REMEDIES: Mapping[str, str] = {
    **dict.fromkeys((COMPRESSED_VIDEO, schemas.FFMPEG_PACKET, schemas.FOXGLOVE_VIDEO), _VIDEO),
    schemas.IMAGE: "record an encoding of 8 or 16 bits a value, such as mono8, bgr8 or bayer_rggb8",
    schemas.COMPRESSED_IMAGE: "record JPEG, PNG, WebP, BMP, TIFF, JPEG 2000, AVIF, or a video by auditor[video]",
    schemas.POINT_CLOUD_OLD: "record a whole sensor_msgs/PointCloud or PointCloud2",
    schemas.COMPRESSED_CLOUD: f"install auditor[lidar] where it is Draco; else {_REPUBLISH_CLOUD}",
    schemas.VELODYNE: (
        "install auditor[lidar]; of an HDL-64E S1, or a recording of less than two seconds, "
        f"{_packets('velodyne_pointcloud').remedy}"
    ),
    **dict.fromkeys(schemas.OUSTER, _OF_OUSTER),
    **dict.fromkeys(schemas.LIVOX, "record with the driver's xfer_format 0, or convert it to sensor_msgs/PointCloud2"),
    schemas.POINT_CLOUD: "record a whole sensor_msgs/PointCloud2 with the fields x, y and z",
}
"""What helps where a type can be decoded and its messages cannot."""

LEAST_BYTES: Mapping[str, int] = dict.fromkeys(schemas.OUSTER, ouster.LEAST_BYTES)
"""Messages of fewer bytes are those of another sensor with the same type, as of the IMU in the LiDAR."""

_OTHER_SCHEMAS_REMEDY = "record or convert it so that its messages can be decoded"

ONE_ROW_REASON = "a scanner of one row gives no picture's worth of points to compare with cameras"

_MEASURED_VALUES = re.compile(r"'(8S|16S|32S|32F|64F)C\d*'")
"""Encodings of depths and labels in the reason why an image cannot be read: no camera gives negative values."""

ONE_ROW: Mapping[str, str] = dict.fromkeys(
    (f"sensor_msgs/msg/{name}" for name in ("LaserScan", "MultiEchoLaserScan")), ONE_ROW_REASON
) | {"foxglove.LaserScan": ONE_ROW_REASON}
"""Scanners of one row, which are left out, with the reason."""


def remedy_of(schema: str) -> str:
    """What to do about messages of a decodable type that cannot be decoded."""
    return _REMEDIES.get(schema, _OTHER_SCHEMAS_REMEDY)


def other_content(reason: str) -> str:
    """Why what cannot be read is plainly no camera's and no LiDAR's, by what it holds; empty where it may be."""
    if ouster.NO_POINTS in reason:
        return f"no points of a LiDAR: {reason}"
    return f"no camera picture: {reason}" if _MEASURED_VALUES.search(reason) or DEPTH_PICTURE in reason else ""


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
    return sensor or ("raw bytes" if any(field["type"] == FieldType.BYTES for field in fields) else "")
