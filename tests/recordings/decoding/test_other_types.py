"""Which types are plainly no sensor's, and what definitions hold."""

import pytest

from auditor.recordings import schemas
from auditor.recordings.decoding import DECODERS
from auditor.recordings.decoding.sensor_types import ONE_ROW, UNREAD, is_of_radar, is_other, raw_data_of
from auditor.recordings.recording import Definition
from auditor.recordings.writers.messages import descriptors


def test_no_type_of_a_camera_or_lidar_is_listed_as_another() -> None:
    sensors = {*UNREAD, *ONE_ROW} | {schema for schema in DECODERS if "Image" in schema}
    sensors |= {schemas.POINT_CLOUD, schemas.POINT_CLOUD_OLD, "kitti/Picture", "kitti/Scan", "foxglove.CompressedVideo"}
    assert not [schema for schema in sensors if is_other(schema)]


@pytest.mark.parametrize(
    "schema",
    ["std_msgs/msg/String", "std_msgs/msg/UInt8MultiArray", "std_msgs/msg/Float32MultiArray", "", "a/msg/Imu", "Imu"],
)
def test_types_that_may_hold_anything_are_not_listed(schema: str) -> None:
    assert not is_other(schema)


@pytest.mark.parametrize(
    "schema",
    [
        "sensor_msgs/msg/Imu",
        "std_msgs/msg/Header",
        "foxglove.SceneUpdate",
        "foxglove_msgs/msg/SceneUpdate",
        "autoware_perception_msgs/msg/PredictedObjects",
        "autoware_auto_perception_msgs/msg/TrackedObjects",
        "can_msgs/msg/Frame",
        "tf2_msgs/msg/TFMessage",
    ],
)
def test_common_types_of_other_things_are_listed(schema: str) -> None:
    assert is_other(schema)


def test_a_radar_is_one_by_its_type() -> None:
    assert is_of_radar("radar_msgs/msg/RadarScan")
    assert not is_of_radar("acme/msg/Scan")


@pytest.mark.parametrize(
    ("encoding", "text", "holds"),
    [
        ("ros1msg", "uint8[] data", "raw bytes"),
        ("ros2msg", "byte[<=100000] data", "raw bytes"),
        ("ros2msg", "uint8[1206] data", "raw bytes"),
        ("ros2msg", "uint8[8] data", ""),
        ("ros2msg", "# uint8[] data\nint32 x  # sensor_msgs/Image", ""),
        ("ros2msg", "sensor_msgs/msg/PointCloud2 cloud", "sensor_msgs/msg/PointCloud2"),
        ("ros1msg", "sensor_msgs/CompressedImage[] pictures", "sensor_msgs/CompressedImage"),
        ("ros1msg", "sensor_msgs/Imu imu", ""),
        ("ros2idl", "sequence<uint8> data;", "raw bytes"),
        ("ros2idl", "sensor_msgs::msg::Image rgb;", "sensor_msgs::msg::Image"),
        ("jsonschema", '{"data": {"contentEncoding": "base64"}}', "raw bytes"),
        ("protobuf", "no descriptor", ""),
    ],
)
def test_what_a_definition_holds_is_found(encoding: str, text: str, holds: str) -> None:
    assert raw_data_of(Definition(encoding, text.encode())) == holds


def test_what_a_protobuf_definition_holds_is_found() -> None:
    assert raw_data_of(Definition("protobuf", descriptors("foxglove.CompressedImage"))) == "raw bytes"
    assert raw_data_of(Definition("protobuf", descriptors("foxglove.FrameTransform"))) == ""
    assert raw_data_of(None) == ""
