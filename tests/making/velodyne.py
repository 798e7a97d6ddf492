"""Packets of a Velodyne VLP-16."""

import struct

import numpy as np

from auditor.model.frames import Message
from auditor.recordings import schemas
from auditor.recordings.decoding.ros import known_types


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


def packets_of_hdl_64e(rounds: int = 2) -> list[bytes]:
    """Packets of an HDL-64E S2 whose returns lie at 10 m; the last bytes hold its calibration, a byte in each."""
    lasers = b"".join(
        struct.pack("<BhhhhhhhhhBB", n, 200 - 40 * n, 30 * (n % 4), 0, 0, 0, 200, 26, 0, 0, 0, 255) + bytes(7)
        for n in range(64)
    )
    calibrated = bytes([10, 1, 2, 3, 4, 5, 40])
    tail = struct.pack("<HHHH", 600, 0, 36_000, 9) + bytes(11) + struct.pack("<H", 1820)
    text = b"UNIT#" + bytes(2) + lasers[:-7] + calibrated + tail
    status = [(ord(kind), 1) for kind in "HMSDNYGTV"]
    values = [*status, *((ord("1") + place % 7, value) for place, value in enumerate(text))] * rounds
    made = []
    for number, (kind, value) in enumerate(values):
        angle = (20 * number) % 36_000
        blocks = b"".join(
            struct.pack("<HH", 0xEEFF if block % 2 == 0 else 0xDDFF, angle) + struct.pack("<HB", 5000, 100) * 32
            for block in range(12)
        )
        made.append(blocks + struct.pack("<IBB", 1000, kind, value))
    return made


def scan_of(packets: list[bytes], log_time_ns: int = 5) -> Message:
    """A message of packets."""
    store = known_types("cdr")
    stamp = store.types["builtin_interfaces/msg/Time"](sec=7, nanosec=0)
    made = [
        store.types["velodyne_msgs/msg/VelodynePacket"](stamp=stamp, data=np.frombuffer(packet, np.uint8))
        for packet in packets
    ]
    scan = store.types[schemas.VELODYNE](header=header(store, "top", ros1=False), packets=made)
    return Message("/packets", schemas.VELODYNE, "cdr", log_time_ns, bytes(store.serialize_cdr(scan, schemas.VELODYNE)))
