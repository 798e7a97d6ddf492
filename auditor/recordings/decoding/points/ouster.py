"""PacketMsg of ouster_ros: packets of Ouster's LiDARs, some columns of a revolution in each.

A packet has ranges by beam and column. The angles of the beams are each sensor's own and stand in its metadata, a text
in JSON that the driver publishes beside the packets (Ouster's Sensor User Manual, "Lidar Data Packet Format" and
"Lidar Range to XYZ"). Of two returns the first is taken, the stronger one, as of the driver's own /ouster/points.
"""

import json
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from auditor.errors import DecodingError
from auditor.model.arrays import Floats
from auditor.model.frames import Message
from auditor.recordings.decoding.clouds import PointCloudDecoder
from auditor.recordings.decoding.interface import Header
from auditor.recordings.decoding.ros import RosTypes

FRAME = "os_sensor"
"""The driver's name of the frame in which the points are: packets name none."""

LEAST_BYTES = 256
"""Packets of the sensor's IMU have 48 bytes, or some more, and the same type."""

NO_POINTS = "holds no points"

MAX_METADATA = 2**17
"""Characters of a sensor's metadata: those of 128 beams have 11,000."""

_MOST_BEAMS, _MOST_COLUMNS, _MOST_IN_PACKET, _FARTHEST_MM = 256, 8192, 64, 1e4
_LEGACY = "LEGACY"
_PIXEL_BYTES = {
    _LEGACY: 12,
    "RNG19_RFL8_SIG16_NIR16": 12,
    "RNG19_RFL8_SIG16_NIR16_DUAL": 16,
    "RNG19_RFL8_SIG16_NIR16_ZONE16": 12,
    "RNG19_RFL8_SIG16_NIR16_RGB16": 16,
    "RNG19_RFL8_SIG16_NIR16_RGB16_DUAL": 20,
    "RNG19_RFL8_SIG16_ZONE16_DUAL": 16,
    "RNG15_RFL8_NIR8": 4,
    "RNG15_RFL8_WIN8": 4,
    "RNG15_RFL8_NIR8_DUAL": 8,
    "RNG15_RFL8_NIR8_ZONE16": 8,
    "FUSA_RNG15_RFL8_NIR8_DUAL": 8,
}
"""Bytes of a pixel by the profile of the packets; each begins with the range."""

_USUAL_MM = 15.806
"""From the middle of an OS-1 to where its beams begin, which firmware before 2.0 does not say: as ouster-sdk has it."""

_PACKET_HEAD = _PACKET_FOOT = 32
_STATUS_LEGACY = 0xFFFF_FFFF


class OusterSensor(NamedTuple):
    """What the metadata say: the form of a packet, and the beams' angles (H,) in radians and offsets in mm."""

    profile: str
    columns: int
    column: np.dtype[np.void]
    per_packet: int
    azimuth: Floats
    altitude: Floats
    beam_mm: tuple[float, float]
    sensor_SE3_lidar: Floats

    @property
    def head_bytes(self) -> int:
        """Bytes of a packet before its columns."""
        return 0 if self.profile == _LEGACY else _PACKET_HEAD

    @property
    def packet_bytes(self) -> int:
        """Bytes of a packet."""
        both = 0 if self.profile == _LEGACY else _PACKET_HEAD + _PACKET_FOOT
        return both + self.per_packet * self.column.itemsize


@lru_cache(maxsize=16)
def sensor_of(metadata: str) -> OusterSensor:
    """The sensor that a text describes, as its firmware or the driver write it. Raises DecodingError."""
    if len(metadata) > MAX_METADATA:
        raise DecodingError(f"metadata of {len(metadata)} characters are not accepted")
    try:
        return _sensor(json.loads(metadata))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError, OverflowError) as error:
        raise DecodingError(f"the sensor's metadata are no description of an Ouster ({str(error)[:80]})") from error


def _sensor(metadata: Any) -> OusterSensor:  # noqa: ANN401  # JSON
    beams = metadata.get("beam_intrinsics", metadata)
    form = next(
        (metadata[key] for key in ("lidar_data_format", "data_format") if isinstance(metadata.get(key), dict)), None
    )
    form = form or _form_of_mode(metadata.get("lidar_mode") or metadata["config_params"]["lidar_mode"])
    place = metadata.get("lidar_intrinsics", metadata)["lidar_to_sensor_transform"]
    profile = form.get("udp_profile_lidar", _LEGACY)
    if profile not in _PIXEL_BYTES:
        raise ValueError(f"packets of the profile {str(profile)[:40]!r} are not read")
    height, columns, per_packet = (
        _whole(form[key], most)
        for key, most in (
            ("pixels_per_column", _MOST_BEAMS),
            ("columns_per_frame", _MOST_COLUMNS),
            ("columns_per_packet", _MOST_IN_PACKET),
        )
    )
    azimuth, altitude = (
        np.radians(_numbers(beams[key], height, 360.0)) for key in ("beam_azimuth_angles", "beam_altitude_angles")
    )
    lens = beams.get("beam_to_lidar_transform")
    if lens is None:
        line = str(metadata.get("sensor_info", metadata).get("prod_line", ""))
        usual = {} if not line.startswith("OS-1") else {"lidar_origin_to_beam_origin_mm": _USUAL_MM}
        beam_mm = (float(_numbers([(usual | beams)["lidar_origin_to_beam_origin_mm"]], 1)[0]), 0.0)
    else:
        matrix = _numbers(lens, 16)
        beam_mm = float(matrix[3]), float(matrix[11])
    sensor_SE3_lidar = _numbers(place, 16).reshape(4, 4)
    return OusterSensor(
        profile, columns, _column(profile, height), per_packet, azimuth, altitude, beam_mm, sensor_SE3_lidar
    )


def _form_of_mode(mode: str) -> dict[str, int]:
    """The form of packets of firmware before 2.0, which does not describe it: `mode` is 1024x10, or another one."""
    return {"pixels_per_column": 64, "columns_per_frame": int(mode.partition("x")[0]), "columns_per_packet": 16}


def _column(profile: str, height: int) -> np.dtype[np.void]:
    """One column of a packet: its time in ns, its number in the revolution, whether it is valid, and its pixels."""
    pixels = ("pixels", "u1", (height, _PIXEL_BYTES[profile]))
    if profile == _LEGACY:
        return np.dtype([("ns", "<u8"), ("number", "<u2"), ("other", "V6"), pixels, ("status", "<u4")])
    return np.dtype([("ns", "<u8"), ("number", "<u2"), ("status", "<u2"), pixels])


def _whole(value: object, most: int) -> int:
    if not isinstance(value, int) or not 0 < value <= most:
        raise ValueError(f"{str(value)[:40]} is not a number from 1 to {most}")
    return value


def _numbers(values: Any, count: int, largest: float = _FARTHEST_MM) -> Floats:  # noqa: ANN401  # JSON
    numbers = np.array(values, np.float64)
    if numbers.shape != (count,) or not np.all(np.abs(numbers) <= largest):
        raise ValueError(f"one of its lists does not hold {count} numbers")
    return numbers


class OusterDecoder(PointCloudDecoder):
    """Decodes packets of the topics whose sensors' metadata are known, by topic, as texts."""

    def __init__(self, types: RosTypes) -> None:
        super().__init__(types)
        self.metadata: Mapping[str, str] = {}

    def header(self, message: Message) -> Header:
        """When its first column was measured, by the sensor's clock; packets have no header of ROS."""
        packet = self._packet(message)
        begins = 0 if len(packet) < LEAST_BYTES or packet[:2].tobytes() != b"\1\0" else _PACKET_HEAD
        if message.topic in self.metadata and len(packet) >= LEAST_BYTES:
            begins = sensor_of(self.metadata[message.topic]).head_bytes
        if len(packet) < begins + 8:
            raise DecodingError("the packet is cut in its header", where=message.topic)
        stamp_ns = int(packet[begins : begins + 8].view("<u8")[0])
        return Header(stamp_ns if stamp_ns < 1 << 63 else 0, FRAME)

    def xyz_m(self, message: Message) -> NDArray[np.float32]:
        """The points of the packet, (N, 3) float32 metres, in the sensor's frame."""
        return points_of_packet(*self._described(message))

    def looks(self, message: Message) -> NDArray[np.float32]:
        """(N, 3): the directions of its columns. Beams look to the sides of them, farther than a packet is wide."""
        columns, turned = _columns(*(described := self._described(message)))
        ahead = np.column_stack([np.cos(turned), np.sin(turned), np.zeros(len(columns))])
        return (ahead @ described[1].sensor_SE3_lidar[:3, :3].T).astype(np.float32)

    def _described(self, message: Message) -> tuple[NDArray[np.uint8], OusterSensor]:
        """A packet, and the sensor that it is from. Raises DecodingError."""
        packet = self._packet(message)
        if len(packet) < LEAST_BYTES:
            raise DecodingError(f"a packet of {len(packet)} bytes {NO_POINTS}", where=message.topic)
        text = self.metadata.get(message.topic)
        if text is None:
            raise DecodingError("its packets need the sensor's metadata, and the recording has none of them")
        sensor = sensor_of(text)
        # Older drivers write one byte more.
        if not sensor.packet_bytes <= len(packet) <= sensor.packet_bytes + 1:
            raise DecodingError(
                f"a packet of {len(packet)} bytes is none of {sensor.packet_bytes}, as the sensor's metadata have it",
                where=message.topic,
            )
        return packet, sensor

    def _packet(self, message: Message) -> NDArray[np.uint8]:
        packet: NDArray[np.uint8] = np.asarray(self._types.decode(message).buf, np.uint8)
        return packet


def points_of_packet(packet: NDArray[np.uint8], sensor: OusterSensor) -> NDArray[np.float32]:
    """(N, 3) points in metres of the valid columns: ranges of 0 are no returns."""
    columns, turned = _columns(packet, sensor)
    range_mm = _ranges_mm(np.ascontiguousarray(columns["pixels"]), sensor.profile)
    place, beam = np.nonzero(range_mm)
    out_mm, up_mm = sensor.beam_mm
    along_mm = range_mm[place, beam] - np.hypot(out_mm, up_mm)
    level_mm = along_mm * np.cos(sensor.altitude)[beam]
    angle = turned[place] - sensor.azimuth[beam]
    x = level_mm * np.cos(angle) + (out_mm * np.cos(turned))[place]
    y = level_mm * np.sin(angle) + (out_mm * np.sin(turned))[place]
    z = along_mm * np.sin(sensor.altitude)[beam] + up_mm
    xyz_mm = np.column_stack([x, y, z]) @ sensor.sensor_SE3_lidar[:3, :3].T + sensor.sensor_SE3_lidar[:3, 3]
    xyz_m: NDArray[np.float32] = (xyz_mm / 1000).astype(np.float32)
    return xyz_m


def _columns(packet: NDArray[np.uint8], sensor: OusterSensor) -> tuple[NDArray[np.void], Floats]:
    """The valid columns of a packet, and the angles of the sensor's turn at them, in radians."""
    end = sensor.head_bytes + sensor.per_packet * sensor.column.itemsize
    columns = np.ascontiguousarray(packet[sensor.head_bytes : end]).view(sensor.column)
    valid = columns["status"] == _STATUS_LEGACY if sensor.profile == _LEGACY else (columns["status"] & 1) == 1
    columns = columns[valid & (columns["number"] < sensor.columns)]
    return columns, 2 * np.pi * (1 - columns["number"].astype(np.float64) / sensor.columns)


def _ranges_mm(pixels: NDArray[np.uint8], profile: str) -> NDArray[np.int64]:
    """(columns, beams) ranges in mm."""
    wide = pixels[:, :, :4].copy().view("<u4")[:, :, 0].astype(np.int64)
    if "RNG15" in profile:
        return (wide & 0x7FFF) << 3
    return wide & (0xFFFFF if profile == _LEGACY else 0x7FFFF)
