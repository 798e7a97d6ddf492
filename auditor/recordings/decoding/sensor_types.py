"""Message types that carry camera pictures or LiDAR points, those that cannot be read included.

Each that cannot be read has a sentence on what to install or how to convert it, so that the sensor can be audited.
"""

import re
from collections.abc import Mapping
from typing import Literal, NamedTuple

from auditor.recordings import schemas
from auditor.recordings.decoding.foxglove_layouts import COMPRESSED_VIDEO
from auditor.recordings.decoding.images import DEPTH_PICTURE
from auditor.recordings.decoding.points import ouster

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
