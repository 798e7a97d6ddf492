"""Small drives for tests, written by the real writers."""

import struct
from collections.abc import Collection, Mapping, Sequence
from io import BytesIO
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import CompressionType, Writer

from auditor.model.frames import CameraImage, Frame, PointCloud, Presence, SensorState, SkippedFrame
from auditor.model.optics.geometry import motion, rotation_from_quaternion
from auditor.model.rig import Camera, Lidar, Rig
from auditor.recordings import FrameStream, Recording, find_rigs, survey, synchronise

START_NS = 1_700_000_000 * 10**9
PERIOD_NS = 10**8
WIDTH, HEIGHT = 64, 48
FOOTER = struct.pack("<BQQQI", 0x02, 20, 0, 0, 0) + b"\x89MCAP0\r\n"
LIDAR_AT = motion(rotation_from_quaternion(0.5, -0.5, 0.5, -0.5), np.array([0.0, -0.1, -0.3]))


def make_rig(n: int = 3, *, lidar: bool = True) -> Rig:
    """S_1..S_n 0.2 m apart, S_n at the origin, so that S_1 has the largest offset in P."""
    cameras = []
    for number in range(1, n + 1):
        projection = np.array([[50.0, 0, 32, 0], [0, 50, 24, 0], [0, 0, 1, 0]])
        projection[0, 3] = -50.0 * 0.2 * (n - number)
        cameras.append(Camera(number, f"cam{number}", f"/cam{number}/image_rect", WIDTH, HEIGHT, projection))
    return Rig(Lidar("top", "/top/points", LIDAR_AT) if lidar else None, tuple(cameras))


def make_frame(
    rig: Rig,
    number: int,
    *,
    offsets: Mapping[int, int] | None = None,
    without: Collection[int] = (),
    colour: bool = False,
    stamp_ns: int | None = None,
) -> Frame:
    """A frame of random pixels and points, the same for the same number."""
    random = np.random.default_rng(number)
    at = START_NS + number * PERIOD_NS if stamp_ns is None else stamp_ns
    stamps = {sensor: at + (offsets or {}).get(sensor, 0) for sensor in rig.sensors}
    channels = (3,) if colour else ()
    images = {
        camera.number: CameraImage(
            camera.number,
            stamps[camera.number],
            random.integers(0, 256, (camera.height_px, camera.width_px, *channels), np.uint8),
        )
        for camera in rig.cameras
    }
    cloud = None
    if rig.lidar and 0 not in without:
        cloud = PointCloud(stamps[0], random.normal(0, 10, (50, 3)).astype(np.float32))
    there = {sensor: image for sensor, image in images.items() if sensor not in without}
    presence = {
        sensor: Presence(SensorState.MISSING if sensor in without else SensorState.PRESENT) for sensor in rig.sensors
    }
    return Frame(number, at, presence, cloud, there)


def make_frames(rig: Rig, count: int, **settings: object) -> list[Frame]:
    return [make_frame(rig, number, **settings) for number in range(count)]


def stream_of(recording: Recording, rig: Rig | None = None, *, colour: bool = False) -> FrameStream:
    known = survey(recording)
    return synchronise(recording, rig or find_rigs(known)[0], known, colour=colour)


def split(stream: FrameStream) -> tuple[list[Frame], list[SkippedFrame]]:
    out = list(stream)
    return [f for f in out if isinstance(f, Frame)], [s for s in out if isinstance(s, SkippedFrame)]


def same_frame(a: Frame, b: Frame) -> bool:
    return (
        a.images.keys() == b.images.keys()
        and all(np.array_equal(a.images[k].pixels, b.images[k].pixels) for k in a.images)
        and (a.cloud is None) == (b.cloud is None)
        and (a.cloud is None or b.cloud is None or np.array_equal(a.cloud.xyz_m, b.cloud.xyz_m))
    )


def rechunk(
    source: Path, target: Path, *, chunk_bytes: int = 8_000, compression: str = "NONE", **settings: object
) -> None:
    """The same messages in the same order by mcap's own writer, with its settings."""
    with source.open("rb") as stream, target.open("wb") as out:
        writer = Writer(out, chunk_size=chunk_bytes, compression=CompressionType[compression], **settings)
        writer.start("ros2")
        channels: dict[str, int] = {}
        for schema, channel, message in make_reader(stream).iter_messages(log_time_order=False):
            assert schema
            if channel.topic not in channels:
                schema_id = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(channel.topic, channel.message_encoding, schema_id)
            writer.add_message(channels[channel.topic], message.log_time, message.data, message.publish_time)
        writer.finish()


def chunk_ends(path: Path) -> list[tuple[int, int, int]]:
    """Start, end and number of messages of every chunk of an MCAP file."""
    ends, position = [], 8
    data = path.read_bytes()
    while position < len(data) - 8:
        opcode, length = struct.unpack_from("<BQ", data, position)
        end = position + 9 + length
        if opcode == 0x06:
            (chunk,) = list(
                StreamReader(BytesIO(data[position:end] + FOOTER), skip_magic=True, emit_chunks=True).records
            )[:1]
            assert isinstance(chunk, Chunk)
            inside = [record for record in breakup_chunk(chunk) if type(record).__name__ == "Message"]
            ends.append((position, end, len(inside)))
        position = end
    return ends


def mcap_file(path: Path, messages: Sequence[tuple[str, int, bytes]], **settings: object) -> None:
    """A file of raw messages (topic, log time, data) without a decodable schema."""
    with path.open("wb") as out:
        writer = Writer(out, **settings)
        writer.start("")
        schema = writer.register_schema("test/Raw", "jsonschema", b"{}")
        channels = {
            topic: writer.register_channel(topic, "json", schema) for topic in dict.fromkeys(m[0] for m in messages)
        }
        for topic, log_time, data in messages:
            writer.add_message(channels[topic], log_time, data, log_time)
        writer.finish()
