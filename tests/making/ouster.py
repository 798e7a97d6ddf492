"""Packets of an Ouster whose beams all see something at one distance, and the text that describes it."""

import json
from collections.abc import Iterator

import numpy as np

from auditor.model.frames import Message
from auditor.recordings import schemas
from auditor.recordings.decoding.ros import known_types

BEAMS, COLUMNS, PER_PACKET = 16, 512, 16
PACKETS = COLUMNS // PER_PACKET
TOPIC, METADATA_TOPIC = "/ouster/lidar_packets", "/ouster/metadata"


def metadata(profile: str = "RNG19_RFL8_SIG16_NIR16", **form: object) -> str:
    """A sensor whose beams look to the sides of a column, as those of an OS-1."""
    return json.dumps(
        {
            "beam_intrinsics": {
                "beam_altitude_angles": np.linspace(4.0, -24.0, BEAMS).tolist(),
                "beam_azimuth_angles": [4.2, -1.4] * (BEAMS // 2),
                "beam_to_lidar_transform": [1, 0, 0, 27.67, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1],
            },
            "lidar_data_format": {
                "columns_per_frame": COLUMNS,
                "columns_per_packet": PER_PACKET,
                "pixels_per_column": BEAMS,
                "udp_profile_lidar": profile,
                **form,
            },
            "lidar_intrinsics": {"lidar_to_sensor_transform": [-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 36.18, 0, 0, 0, 1]},
        }
    )


def packets(begins_ns: int, range_m: float = 10.0, period_ns: int = 10**8) -> Iterator[tuple[int, bytes]]:
    """The packets of a revolution, each with the time of its first column."""
    column = np.dtype([("ns", "<u8"), ("number", "<u2"), ("status", "<u2"), ("pixels", "<u4", (BEAMS, 3))])
    for first in range(0, COLUMNS, PER_PACKET):
        columns = np.zeros(PER_PACKET, column)
        columns["number"] = np.arange(first, first + PER_PACKET)
        columns["ns"] = begins_ns + columns["number"].astype(np.int64) * period_ns // COLUMNS
        columns["status"] = 1
        columns["pixels"][:, :, 0] = round(range_m * 1000)
        yield int(columns["ns"][0]), b"\1\0" + bytes(30) + columns.tobytes() + bytes(32)


def packet_message(packet: bytes, log_time_ns: int = 5, encoding: str = "cdr", topic: str = TOPIC) -> Message:
    """A packet as its driver publishes it."""
    schema = schemas.OUSTER[0 if encoding == "ros1" else 2]
    store = known_types(encoding)
    made = store.types[schema](buf=np.frombuffer(packet, np.uint8))
    serialise = store.serialize_ros1 if encoding == "ros1" else store.serialize_cdr
    return Message(topic, schema, encoding, log_time_ns, bytes(serialise(made, schema)))
