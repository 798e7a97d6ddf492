"""Message types that carry camera pictures or LiDAR points, those that cannot be read included.

Each that cannot be read has a sentence on what to install or how to convert it, so that the sensor can be audited.
"""

import re
from collections.abc import Mapping
from typing import Literal, NamedTuple

from auditor.recordings import schemas
from auditor.recordings.decoding.foxglove_layouts import COMPRESSED_VIDEO

SensorKind = Literal["camera", "LiDAR"]

CAMERA: SensorKind = "camera"
LIDAR: SensorKind = "LiDAR"
KINDS: Mapping[str, SensorKind] = {"image": CAMERA, "cloud": LIDAR}
"""The kind of sensor by the kind of decoder."""


class SensorType(NamedTuple):
    """The kind of sensor that a message type carries, and how its data become readable."""

    kind: SensorKind
    remedy: str


def _packets(driver: str) -> SensorType:
    return SensorType(LIDAR, f"play it through {driver} and record its sensor_msgs/PointCloud2")


_LIVOX = SensorType(LIDAR, "record with the driver's xfer_format 0, or convert it to sensor_msgs/PointCloud2")
_OUSTER = _packets("ouster_ros (replay)")
_HESAI = _packets("hesai_ros_driver (source_type 3)")
_PANDAR = _packets("hesai_lidar (data_type rosbag)")
_ROBOSENSE = _packets("rslidar_sdk (msg_source 2)")
_REPUBLISH = "republish it as sensor_msgs/Image with image_transport's republish and record that"
_OF_ROS_2 = "record it as MCAP with Foxglove's own schemas, or as sensor_msgs"

UNREAD: Mapping[str, SensorType] = {
    "livox_ros_driver/msg/CustomMsg": _LIVOX,
    "livox_ros_driver2/msg/CustomMsg": _LIVOX,
    "livox_interfaces/msg/CustomMsg": _LIVOX,
    "velodyne_msgs/msg/VelodyneScan": _packets("velodyne_pointcloud"),
    "ouster_ros/msg/PacketMsg": _OUSTER,
    "ouster_msgs/msg/PacketMsg": _OUSTER,
    "ouster_sensor_msgs/msg/PacketMsg": _OUSTER,
    "hesai_ros_driver/msg/UdpFrame": _HESAI,
    "hesai_ros_driver/msg/UdpPacket": _HESAI,
    "hesai_lidar/msg/PandarScan": _PANDAR,
    "hesai_lidar/msg/PandarPacket": _PANDAR,
    "pandar_msgs/msg/PandarScan": _packets("nebula_ros or pandar_pointcloud"),
    "nebula_msgs/msg/NebulaPackets": _packets("nebula_ros (launch_hw false)"),
    "rslidar_msg/msg/RslidarPacket": _ROBOSENSE,
    "rslidar_msg/msg/RslidarScan": _ROBOSENSE,
    "rslidar_msgs/msg/rslidarPacket": _ROBOSENSE,
    "rslidar_msgs/msg/rslidarScan": _ROBOSENSE,
    "point_cloud_interfaces/msg/CompressedPointCloud2": SensorType(
        LIDAR, "republish it as sensor_msgs/PointCloud2 with point_cloud_transport's republish and record that"
    ),
    "theora_image_transport/msg/Packet": SensorType(CAMERA, _REPUBLISH),
    "ffmpeg_image_transport_msgs/msg/FFMPEGPacket": SensorType(CAMERA, _REPUBLISH),
    "foxglove_msgs/msg/RawImage": SensorType(CAMERA, _OF_ROS_2),
    "foxglove_msgs/msg/CompressedImage": SensorType(CAMERA, _OF_ROS_2),
    "foxglove_msgs/msg/CompressedVideo": SensorType(CAMERA, _OF_ROS_2),
    "foxglove_msgs/msg/PointCloud": SensorType(LIDAR, _OF_ROS_2),
}
"""Types without a decoder. A decoder of the entry points group `auditor.decoders` goes before this table."""

_VIDEO = "install auditor[video] where it is H.264; convert other videos to it"

_REMEDIES: Mapping[str, str] = {
    COMPRESSED_VIDEO: _VIDEO,
    schemas.IMAGE: "record an encoding of 8 or 16 bits a value, such as mono8, bgr8 or bayer_rggb8",
    schemas.COMPRESSED_IMAGE: "record JPEG, PNG, or H.264 with auditor[video] installed",
    schemas.POINT_CLOUD: "record a whole sensor_msgs/PointCloud2 with the fields x, y and z",
}
"""What helps where a type can be decoded and its messages cannot."""

_OTHER_SCHEMAS_REMEDY = "record or convert it so that its messages can be decoded"

_NO_CAMERA_OR_LIDAR = (
    "depth",
    "disparity",
    "mask",
    "segment",
    "semantic",
    "label",
    "occupancy",
    "costmap",
    "radar",
    "sonar",
    "imu",
    "visual",
    "debug",
    "overlay",
    "annotat",
)
"""Parts of the names of topics that carry images or points, and not those of a camera or LiDAR."""

_MEASURED_VALUES = re.compile(r"'(8S|16S|32S|32F|64F)C\d*'")
"""Encodings of depths and labels in the reason why an image cannot be read: no camera gives negative values."""


def remedy_of(schema: str) -> str:
    """What to do about messages of a decodable type that cannot be decoded."""
    return _REMEDIES.get(schema, _OTHER_SCHEMAS_REMEDY)


def other_content(topic: str, reason: str) -> str:
    """Why an unreadable topic is plainly no camera and no LiDAR; empty where it may be one."""
    if _MEASURED_VALUES.search(reason):
        return f"no camera picture: {reason}"
    name = next((part for part in _NO_CAMERA_OR_LIDAR if part in topic.lower()), "")
    return f"by its name ({name}) no picture of a camera and no points of a LiDAR" if name else ""
