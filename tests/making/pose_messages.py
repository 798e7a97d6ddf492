"""Messages that say where a vehicle was, in every type and container, by the real writers."""

from collections.abc import Iterable
from math import cos, radians, sin
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Rosbag2Writer

from auditor.recordings import schemas
from auditor.recordings.recording import Definition, Topic
from auditor.recordings.writers.mcap_file import mcap_file
from auditor.recordings.writers.messages import MessageMaker
from tests.making.foxglove_messages import FoxgloveMessage, stamp

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
