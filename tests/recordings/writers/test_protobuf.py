"""What is written as protobuf is read by Foxglove's own classes, and by classes of its descriptors."""

from typing import Any

import pytest
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory  # type: ignore[import-untyped]

from auditor.recordings.decoding.protobuf import check_schema, decode_protobuf
from auditor.recordings.writers.messages import FLOAT32, descriptors, protobuf

STAMP = {"seconds": 1_700_000_000, "nanos": 123_456_789}
POSE = {"position": {"x": 1.5, "y": -2.0, "z": 0.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
FIELDS = [{"name": axis, "offset": 4 * place, "type": FLOAT32} for place, axis in enumerate("xyz")]
CLOUD = {
    "timestamp": STAMP,
    "frame_id": "lidar",
    "pose": POSE,
    "point_stride": 12,
    "fields": FIELDS,
    "data": bytes(300),
}
IMAGE = {"timestamp": {"seconds": -1, "nanos": 5}, "data": b"jpeg", "format": "jpeg", "frame_id": "S_2 \u202e"}


@pytest.mark.parametrize(
    ("name", "values", "known"),
    [("foxglove.PointCloud", CLOUD, PointCloud), ("foxglove.CompressedImage", IMAGE, CompressedImage)],
)
def test_a_message_is_read_by_foxglove_by_its_own_descriptor_and_by_auditor(
    name: str, values: dict[str, Any], known: Any
) -> None:
    written, described = protobuf(name, values), descriptors(name)
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(described).file:
        pool.Add(file)
    of_descriptor = message_factory.GetMessageClass(pool.FindMessageTypeByName(name)).FromString(written)
    assert str(of_descriptor) == str(known.FromString(written))
    check_schema(name, described)
    assert decode_protobuf(name, memoryview(written)) == values
