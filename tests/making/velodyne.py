"""Packets of a Velodyne VLP-16."""

import struct

import numpy as np

from auditor.model.frames import Message
from auditor.recordings import schemas
from auditor.recordings.decoding.standard_types import known_types


def header(store: object, frame_id: str, *, ros1: bool) -> object:
    types = store.types
    stamp = types["builtin_interfaces/msg/Time"](sec=7, nanosec=9)
    return types["std_msgs/msg/Header"](**({"seq": 0} if ros1 else {}), stamp=stamp, frame_id=frame_id)


def velodyne_scan(count: int = 76, model: int = 0x22, encoding: str = "cdr", data: bytes | None = None) -> Message:
    """A revolution of a VLP-16 whose returns all lie at 10 m; bytes as in its manual, section 9."""
    store = known_types(encoding)
    packets = []
    for number in range(count):
        blocks = b"".join(
            struct.pack("<HH", 0xEEFF, (480 * number + 40 * block) % 36_000) + struct.pack("<HB", 5000, 100) * 32
            for block in range(12)
        )
        packet = data or blocks + struct.pack("<IBB", 1000, 0x37, model)
        stamp = store.types["builtin_interfaces/msg/Time"](sec=7, nanosec=number)
        packets.append(
            store.types["velodyne_msgs/msg/VelodynePacket"](stamp=stamp, data=np.frombuffer(packet, np.uint8))
        )
    scan = store.types[schemas.VELODYNE](header=header(store, "top", ros1=encoding == "ros1"), packets=packets)
    serialise = store.serialize_ros1 if encoding == "ros1" else store.serialize_cdr
    return Message("/packets", schemas.VELODYNE, encoding, 5, bytes(serialise(scan, schemas.VELODYNE)))
