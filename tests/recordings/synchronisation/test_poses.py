"""Each frame gets the nearest pose of each topic, whatever the recording holds besides."""

from collections.abc import Iterable
from dataclasses import replace
from math import cos, inf, nan, radians, sin
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Rosbag2Writer

from auditor.model.frames import FramePose, Pose, PoseTopic
from auditor.recordings import FramePoses, FrameTimes, convert, open_recording, read_poses, schemas
from auditor.recordings.decoding import poses as decoding
from auditor.recordings.recording import Definition, Topic
from auditor.recordings.synchronisation import poses as synchronisation
from auditor.recordings.writers.mcap_file import mcap_file
from auditor.recordings.writers.messages import MessageMaker
from tests.making.foxglove_messages import FoxgloveMessage, stamp, write_json, write_protobuf

START_NS = 1_700_000_000 * 10**9
S_NS = 10**9


class RosPose(NamedTuple):
    """One message; `values` are latitude, longitude and altitude of a fix, else x, y, z; `status` is that of a fix."""

    topic: str
    schema: str
    stamp_ns: int
    values: tuple[float, float, float]
    frame_id: str = "map"
    turn_deg: float = 0.0
    status: int = 0
    child: str = "base_link"


def quaternion(turn_deg: float) -> dict[str, float]:
    half = radians(turn_deg) / 2
    return {"x": 0.0, "y": 0.0, "z": sin(half), "w": cos(half)}


def ros_message(maker: MessageMaker, one: RosPose) -> bytes:
    """The bytes of a message of any of the types of ROS."""
    made = maker._made
    header = maker.header(one.stamp_ns, one.frame_id)
    if one.schema == schemas.GPS_FIX:
        latitude, longitude, altitude = one.values
        status = made("sensor_msgs/msg/NavSatStatus", status=one.status, service=1)
        rest = {"position_covariance": np.zeros(9), "position_covariance_type": 0}
        where = {"latitude": latitude, "longitude": longitude, "altitude": altitude}
        return maker.serialise(one.schema, made(one.schema, header=header, status=status, **where, **rest))
    xyz = dict(zip("xyz", one.values, strict=True))
    turn = made("geometry_msgs/msg/Quaternion", **quaternion(one.turn_deg))
    if one.schema in {schemas.TRANSFORM, schemas.TRANSFORMS}:
        moved = made("geometry_msgs/msg/Transform", translation=made("geometry_msgs/msg/Vector3", **xyz), rotation=turn)
        stamped = made(schemas.TRANSFORM, header=header, child_frame_id=one.child, transform=moved)
        whole = stamped if one.schema == schemas.TRANSFORM else made(one.schema, transforms=[stamped])
        return maker.serialise(one.schema, whole)
    pose = made("geometry_msgs/msg/Pose", position=made("geometry_msgs/msg/Point", **xyz), orientation=turn)
    if one.schema == schemas.POSE:
        return maker.serialise(one.schema, made(one.schema, header=header, pose=pose))
    uncertain = made("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=np.zeros(36))
    if one.schema == schemas.POSE_WITH_COVARIANCE:
        return maker.serialise(one.schema, made(one.schema, header=header, pose=uncertain))
    still = made("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
    twist = made("geometry_msgs/msg/Twist", linear=still, angular=still)
    moving = made("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=np.zeros(36))
    odometry = made(one.schema, header=header, child_frame_id=one.child, pose=uncertain, twist=moving)
    return maker.serialise(one.schema, odometry)


def write_ros(path: Path, poses: Iterable[RosPose], encoding: str = "cdr", *, cut: int | None = None) -> Path:
    """A recording of these messages, by the path's ending; each is cut to so many bytes where that is given."""
    maker = MessageMaker("ros1" if path.suffix == ".bag" or encoding == "ros1" else "cdr")
    if path.suffix == ".mcap":
        kind = "ros1msg" if encoding == "ros1" else "ros2msg"
        with mcap_file(path, profile="ros1" if encoding == "ros1" else "ros2", compression="zstd") as file:
            for one in poses:
                name = one.schema.replace("/msg/", "/") if encoding == "ros1" else one.schema
                definition = Definition(kind, maker.definition(one.schema).encode())
                file.write(Topic(one.topic, name, encoding), definition, log_time(one), ros_message(maker, one)[:cut])
        return path
    writer: Any = (
        BagWriter(path)
        if path.suffix == ".bag"
        else Rosbag2Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3)
    )
    with writer:
        connections: dict[str, Any] = {}
        for one in poses:
            if one.topic not in connections:
                connections[one.topic] = writer.add_connection(one.topic, one.schema, typestore=maker.store)
            writer.write(connections[one.topic], log_time(one), ros_message(maker, one))
    return path


def log_time(one: RosPose) -> int:
    """When a message was recorded: 5 ms behind its stamp."""
    return one.stamp_ns + 5_000_000


def foxglove_pose(topic: str, schema: str, stamp_ns: int, values: tuple[float, float, float]) -> FoxgloveMessage:
    """One message of any of Foxglove's types, turned by 90 degrees where it can be."""
    head = {"timestamp": stamp(stamp_ns), "frame_id": "map"}
    if schema == "foxglove.LocationFix":
        where = dict(zip(("latitude", "longitude", "altitude"), values, strict=True))
        return FoxgloveMessage(topic, schema, stamp_ns, {**head, **where})
    xyz, turn = dict(zip("xyz", values, strict=True)), quaternion(90.0)
    if schema.startswith("foxglove.FrameTransform"):
        names = {"parent_frame_id": "odom", "child_frame_id": "base_link"}
        one = {"timestamp": stamp(stamp_ns), **names, "translation": xyz, "rotation": turn}
        return FoxgloveMessage(topic, schema, stamp_ns, {"transforms": [one]} if schema.endswith("s") else one)
    pose = {"position": xyz, "orientation": turn}
    return FoxgloveMessage(
        topic, schema, stamp_ns, {**head, **({"poses": [pose]} if schema.endswith("PosesInFrame") else {"pose": pose})}
    )


MS_NS = 10**6
HERE = (49.0, 8.4, 115.0)
FRAMES = FrameTimes([0, 1, 2], [START_NS, START_NS + S_NS, START_NS + 2 * S_NS])
PLACED = (schemas.ODOMETRY, schemas.POSE, schemas.POSE_WITH_COVARIANCE, schemas.TRANSFORM, schemas.TRANSFORMS)


def read(path: Path, frames: FrameTimes = FRAMES) -> FramePoses:
    with open_recording(path) as recording:
        return read_poses(recording, frames)


def fix(stamp_ns: int, values: tuple[float, float, float] = HERE, topic: str = "/fix", status: int = 0) -> RosPose:
    return RosPose(topic, schemas.GPS_FIX, stamp_ns, values, "gps", status=status)


def by_frame(poses: FramePoses) -> dict[int, tuple[int, Pose]]:
    return {one.frame: (one.offset_ns, one.pose) for one in poses}


# Types and containers


@pytest.mark.parametrize("name", ["a.mcap", "ros1 a.mcap", "a.bag", "a"])
def test_every_type_of_ros_is_read_in_every_container(tmp_path: Path, name: str) -> None:
    at = START_NS + 20 * MS_NS
    made = [RosPose(f"/of{n}", schema, at, (1.0, 2.0, 3.0), turn_deg=90.0) for n, schema in enumerate(PLACED)]
    encoding, _, file = name.rpartition(" ")
    found = read(write_ros(tmp_path / file, [*made, fix(at)], encoding or "cdr"))
    poses = {one.topic: one for one in found if one.frame == 0}
    assert set(poses) == {"/fix", *(one.topic for one in made)}
    geographic = Pose("gps", 49.0, 8.4, 115.0)
    assert poses["/fix"] == FramePose(0, START_NS, 20 * MS_NS, "/fix", schemas.GPS_FIX, geographic)
    for one in made:
        assert poses[one.topic].schema == one.schema
        assert poses[one.topic].offset_ns == 20 * MS_NS
        heading = poses[one.topic].pose.heading_deg
        assert heading == pytest.approx(90)
        assert replace(poses[one.topic].pose, heading_deg=None) == Pose("map", x_m=1.0, y_m=2.0, z_m=3.0)


@pytest.mark.parametrize("write", [write_protobuf, write_json])
def test_every_type_of_foxglove_is_read(tmp_path: Path, write) -> None:
    names = ("LocationFix", "PoseInFrame", "PosesInFrame", "FrameTransform", "FrameTransforms")
    made = [foxglove_pose(f"/{name}", f"foxglove.{name}", START_NS, (1.0, 2.0, 3.0)) for name in names]
    write(tmp_path / "a.mcap", iter(made))
    poses = {one.topic: one.pose for one in read(tmp_path / "a.mcap") if one.frame == 0}
    assert poses.pop("/LocationFix") == Pose("map", 1.0, 2.0, 3.0)
    assert len(poses) == 4
    for topic, pose in poses.items():
        assert (pose.x_m, pose.y_m, pose.z_m, pose.heading_deg) == (1, 2, 3, pytest.approx(90))
        assert pose.frame_id == ("odom" if "Transform" in topic else "map")


def test_the_places_of_a_kitti_drive_are_read_and_converted(real_data: Path, tmp_path: Path) -> None:
    drive = real_data / "kitti_raw_2011_09_26_drive_0001"
    with open_recording(drive) as recording:
        stamps = [m.log_time_ns for m in recording.messages({"/kitti/oxts"})]
        frames = FrameTimes([*range(len(stamps))], stamps)
        found = read_poses(recording, frames)
        convert(recording, tmp_path / "a.mcap")
    assert found.topics == (PoseTopic("/kitti/oxts", "kitti/Oxts", read=5, frames=5),)
    first = next(iter(found)).pose
    assert (first.latitude_deg, first.longitude_deg) == (49.015003823272, 8.4342971002335)
    assert first.heading_deg == pytest.approx(-149.468, abs=1e-3)  # -2.6087 rad
    converted = [one.pose.latitude_deg for one in read(tmp_path / "a.mcap", frames)]
    assert converted == [one.pose.latitude_deg for one in found]


# Which pose


def test_the_nearest_pose_counts_before_or_behind_the_frame_and_nothing_is_interpolated(tmp_path: Path) -> None:
    times_ms = (-400, -100, 300, 900, 1500, 2600, 2450)
    made = [fix(START_NS + ms * MS_NS, (float(n), 0.0, 0.0)) for n, ms in enumerate(times_ms)]
    found = by_frame(read(write_ros(tmp_path / "a.mcap", made)))
    assert {frame: (offset // MS_NS, pose.latitude_deg) for frame, (offset, pose) in found.items()} == {
        0: (-100, 1.0),
        1: (-100, 3.0),
        2: (450, 6.0),
    }


def test_one_pose_is_that_of_all_frames_around_it_and_of_none_far_away(tmp_path: Path) -> None:
    frames = FrameTimes([7, 5, 6], [START_NS + 30 * S_NS, START_NS, START_NS + S_NS])
    made = [fix(START_NS + S_NS), fix(START_NS - 300 * S_NS)]
    found = read(write_ros(tmp_path / "a.mcap", made), frames)
    assert {frame: offset for frame, (offset, _) in by_frame(found).items()} == {5: S_NS, 6: 0}
    assert found.topics == (PoseTopic("/fix", schemas.GPS_FIX, 2, 2, {"far from every frame": 1}),)


def test_a_pose_without_a_stamp_has_its_time_of_recording(tmp_path: Path) -> None:
    path = write_ros(tmp_path / "a.mcap", [fix(0)])
    assert by_frame(read(path, FrameTimes([0], [0]))) == {0: (5 * MS_NS, Pose("gps", *HERE))}


def test_of_tf_only_the_vehicle_in_map_and_odom_is_a_pose_and_each_is_kept(tmp_path: Path) -> None:
    pairs = (("map", "base_link"), ("/odom", "base_link"), ("map", "odom"), ("base_link", "cam"))
    made = [
        RosPose("/tf", schemas.TRANSFORMS, START_NS, (float(n), 0, 0), parent, child=child)
        for n, (parent, child) in enumerate(pairs)
    ]
    fixed = RosPose("/tf_static", schemas.TRANSFORMS, START_NS, (9, 9, 9))
    found = read(write_ros(tmp_path / "a.mcap", [*made, fixed]), FrameTimes([0], [START_NS]))
    assert [(one.topic, one.pose.frame_id, one.pose.x_m) for one in found] == [("/tf", "map", 0), ("/tf", "odom", 1)]
    assert [topic.topic for topic in found.topics] == ["/tf"]


# Bad input


@pytest.mark.parametrize(
    ("values", "status", "reason"),
    [
        ((nan, 8.0, 0.0), 0, decoding.OUT_OF_RANGE),
        ((49.0, inf, 0.0), 0, decoding.OUT_OF_RANGE),
        ((90.1, 8.0, 0.0), 0, decoding.OUT_OF_RANGE),
        ((49.0, -180.1, 0.0), 0, decoding.OUT_OF_RANGE),
        (HERE, -1, decoding.NO_FIX),
    ],
)
def test_a_fix_that_is_none_is_dropped_and_counted_and_the_next_ones_are_kept(
    tmp_path: Path, values: tuple[float, float, float], status: int, reason: str
) -> None:
    made = [fix(START_NS, values, status=status), fix(START_NS + 50 * MS_NS)]
    found = read(write_ros(tmp_path / "a.mcap", made), FrameTimes([0], [START_NS]))
    assert by_frame(found) == {0: (50 * MS_NS, Pose("gps", *HERE))}
    assert found.topics == (PoseTopic("/fix", schemas.GPS_FIX, 2, 1, {reason: 1}),)


def test_an_unknown_altitude_or_turn_is_null_and_an_endless_place_is_dropped(tmp_path: Path) -> None:
    made = [
        fix(START_NS, (49.0, 8.4, nan)),
        RosPose("/odom", schemas.ODOMETRY, START_NS, (1.0, 2.0, 3.0), turn_deg=nan),
        RosPose("/odom", schemas.ODOMETRY, START_NS + 1, (inf, 2.0, 3.0)),
    ]
    found = read(write_ros(tmp_path / "a.mcap", made), FrameTimes([0], [START_NS]))
    assert [one.pose for one in found] == [Pose("gps", 49.0, 8.4), Pose("map", x_m=1.0, y_m=2.0, z_m=3.0)]
    assert {topic.topic: topic.dropped for topic in found.topics} == {"/fix": {}, "/odom": {decoding.OUT_OF_RANGE: 1}}


def test_cut_messages_are_damaged(tmp_path: Path) -> None:
    found = read(write_ros(tmp_path / "a.mcap", [fix(START_NS), fix(START_NS + 1)], cut=40))
    assert list(found) == []
    assert found.topics == (PoseTopic("/fix", schemas.GPS_FIX, 2, 0, {decoding.DAMAGED: 2}),)


def test_several_poses_of_one_moment_are_a_path_and_no_place(tmp_path: Path) -> None:
    one = foxglove_pose("/path", "foxglove.PosesInFrame", START_NS, (1.0, 2.0, 3.0))
    write_json(tmp_path / "a.mcap", iter([one._replace(fields={**one.fields, "poses": one.fields["poses"] * 2})]))
    assert read(tmp_path / "a.mcap").topics[0].dropped == {decoding.SEVERAL: 1}


def test_a_recording_of_very_many_topics_keeps_the_gps_first_and_no_more_than_its_budget(tmp_path: Path) -> None:
    odometry = [RosPose(f"/a{n:03d}", schemas.ODOMETRY, START_NS, (0.0, 0.0, 0.0)) for n in range(60)]
    found = read(write_ros(tmp_path / "a.mcap", [*odometry, fix(START_NS)]))
    kept = {one.topic for one in found}
    assert kept == {"/fix", *(f"/a{n:03d}" for n in range(7))}
    dropped = {topic.topic: topic.dropped for topic in found.topics if topic.dropped}
    assert len(dropped) == 53
    assert dropped["/a007"] == {synchronisation.MANY_TOPICS: 1}


def test_a_new_frame_of_reference_in_each_message_does_not_grow_what_is_kept(tmp_path: Path) -> None:
    made = [RosPose("/odom", schemas.ODOMETRY, START_NS + n, (0, 0, 0), "x" * 400 + str(n)) for n in range(30)]
    others = [RosPose("/odom", schemas.ODOMETRY, START_NS + n, (0, 0, 0), f"y{n}") for n in range(30)]
    found = read(write_ros(tmp_path / "a.mcap", [*made, *others]), FrameTimes([0], [START_NS]))
    assert len(list(found)) == 8
    assert max(len(one.pose.frame_id) for one in found) == 256
    assert found.topics[0].dropped == {synchronisation.MANY_FRAMES: 23}


def test_with_very_many_frames_fewer_topics_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(synchronisation, "_MOST_PLACES", 7)
    frames = FrameTimes([*range(4)], [START_NS + n for n in range(4)])
    made = [fix(START_NS), RosPose("/odom", schemas.ODOMETRY, START_NS, (0.0, 0.0, 0.0))]
    found = read(write_ros(tmp_path / "a.mcap", made), frames)
    assert [one.topic for one in found] == ["/fix"] * 4
    longer = FrameTimes([*range(9)], [START_NS + n for n in range(9)])
    assert len(list(read(tmp_path / "a.mcap", longer))) == 7


def test_a_recording_without_poses_is_not_read_again(tmp_path: Path) -> None:
    fixed = RosPose("/tf_static", schemas.TRANSFORMS, START_NS, (9, 9, 9))
    with open_recording(write_ros(tmp_path / "a.mcap", [fixed])) as recording:
        recording.messages = None  # type: ignore[method-assign]
        assert read_poses(recording, FRAMES) == FramePoses()
