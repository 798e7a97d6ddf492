"""Recordings of LiDARs without cameras: rendered streets with several, and real scans split in two by their rings."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap.writer import Writer

from auditor.lab.attacks.kinds import OnLidar
from auditor.model.arrays import Integers, Mask
from auditor.model.frames import Frame, PointCloud, Presence, SensorState
from auditor.model.optics.geometry import motion
from auditor.model.rig import LIDAR, Lidar, Rig
from auditor.recordings import find_rigs, located, open_recording, survey, synchronise
from tests.making.published_rigs import PublishedLidar, PublishedRig
from tests.making.ring_drives import make_ring_drive

ROOF = PublishedLidar("roof", (0.6, 0.0, 1.9), 40, -22, 8)
REAR = PublishedLidar("rear", (-1.0, 0.0, 1.9), 32, -25, 8)
BUMPER = PublishedLidar("bumper", (2.1, 0.0, 0.5), 16, -15, 15, wide_deg=240)
LEFT = PublishedLidar("left", (1.8, 0.9, 0.8), 32, -16, 15)
RIGHT = PublishedLidar("right", (1.8, -0.9, 0.8), 32, -16, 15)

SCAN_NS = 10**8

_UPRIGHT = motion(np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]), np.zeros(3))


def rig_of(*lidars: PublishedLidar) -> Rig:
    first, *others = (Lidar(one.name, f"/{one.name}/points", _UPRIGHT @ one.vehicle_SE3_lidar) for one in lidars)
    return Rig(first, (), tuple(others))


def street(
    lidars: Sequence[PublishedLidar], seed: int, frames: int, *, style: str = "city", standing: bool = False
) -> Iterator[Frame]:
    """The frames of a drive along a street, all scans of one moment."""
    drive = make_ring_drive(PublishedRig("", (), tuple(lidars)), seed, frames, style=style, standing=standing)
    for number in range(frames):
        at = (number + 1) * SCAN_NS
        scans = (drive.points(number, lidar).astype(np.float32) for lidar in lidars)
        yield frame_of(number, at, [PointCloud(at, points) for points in scans])


def frame_of(number: int, stamp_ns: int, clouds: Iterable[PointCloud | None]) -> Frame:
    there = {sensor: cloud for sensor, cloud in enumerate(clouds) if cloud is not None}
    presence = {sensor: Presence(SensorState.PRESENT, 0) for sensor in there}
    return Frame(number, stamp_ns, presence, there.pop(0, None), {}, there)


def attacked(frame: Frame, rig: Rig, sensor: int, attack: OnLidar) -> Frame:
    clouds = frame.clouds
    clouds[sensor] = attack.apply(clouds[sensor], rig.alone(sensor))
    return replace(frame, cloud=clouds.pop(0), others=clouds)


def split_by_rings(drive: Path, chosen: Callable[[Integers], Mask]) -> tuple[Rig, list[Frame]]:
    """A KITTI drive as if two LiDARs at one place had recorded it: `chosen` says which rings are the first one's."""
    with open_recording(located(drive)) as recording:
        surveyed = survey(recording)
        rig = find_rigs(surveyed)[0].alone(LIDAR)  # pictures would be decoded for nothing
        frames = [one for one in synchronise(recording, rig, surveyed) if isinstance(one, Frame)]
    assert rig.lidar
    first, second = (replace(rig.lidar, name=name, topic=f"/{name}/points") for name in ("first", "second"))
    halves = []
    for frame in frames:
        assert frame.cloud
        own = chosen(rings_of(frame.cloud))
        clouds = [replace(frame.cloud, xyz_m=frame.cloud.xyz_m[mask]) for mask in (own, ~own)]
        halves.append(frame_of(frame.number, frame.stamp_ns, clouds))
    return Rig(first, (), (second,)), halves


def rings_of(cloud: PointCloud) -> Integers:
    """(N,) the ring of each point: KITTI writes one after the other, each from straight ahead on."""
    azimuth = np.arctan2(cloud.xyz_m[:, 1], cloud.xyz_m[:, 0])
    return np.concatenate([[0], np.cumsum((azimuth[1:] >= 0) & (azimuth[:-1] < 0))])


def merged(target: Path, *sources: Path) -> Path:
    """One MCAP file of all messages of several, in the order of time."""
    messages = []
    for source in sources:
        with source.open("rb") as stream:
            messages += list(make_reader(stream).iter_messages())
    with target.open("wb") as out:
        writer = Writer(out)
        writer.start("ros2")
        channels: dict[tuple[str, int], int] = {}
        for schema, channel, message in sorted(messages, key=lambda one: one[2].log_time):
            assert schema
            key = channel.topic, len(schema.data)
            if key not in channels:
                known = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[key] = writer.register_channel(channel.topic, channel.message_encoding, known)
            writer.add_message(channels[key], message.log_time, message.data, message.publish_time)
        writer.finish()
    return target
