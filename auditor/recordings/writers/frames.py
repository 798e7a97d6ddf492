"""Writes a rig and its frames as an MCAP file, a .bag or a rosbag2 folder, as a vehicle's recorder would.

Images go to the rig's topics with a camera info beside each, the point cloud to the LiDAR's; /tf_static places every
camera at its own centre and the LiDAR in the rig frame, while P keeps its offsets, as converters of KITTI do. A camera
that is not rectified has K, D and its place in tf, and no offset.
"""

import json
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple, TypedDict, Unpack

import numpy as np
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Rosbag2Writer

from auditor.model.frames import Frame, Pose
from auditor.model.optics.geometry import Matrix, motion
from auditor.model.rig import Camera, Rig
from auditor.model.verdict import AttackLabel
from auditor.recordings import schemas
from auditor.recordings.recording import METADATA_TOPIC, Definition, Topic, label_to_dict
from auditor.recordings.writers.mcap_file import Compression, mcap_file, whole_file, whole_folder
from auditor.recordings.writers.messages import Form, MessageMaker

RIG_FRAME = "rig"
TRANSFORMS_TOPIC = "/tf_static"
FIX_TOPIC = "/gps/fix"

Place = Callable[[int], Pose]
"""The vehicle's pose in degrees at a stamp in nanoseconds."""


class _Outgoing(NamedTuple):
    topic: str
    schema: str
    stamp_ns: int
    data: bytes


class RecorderStyle(TypedDict, total=False):
    """What a recorder does: the vehicle's name, the form of its images (raw), and where it is.

    With a `place`, which gives the vehicle's pose in degrees at a stamp, a GPS fix is written with each frame.
    """

    vehicle: str | None
    image: Form
    place: Place | None


def write_mcap(
    path: Path,
    rig: Rig,
    frames: Iterable[Frame],
    labels: Iterable[AttackLabel] = (),
    *,
    compression: Compression = "zstd",
    **how: Unpack[RecorderStyle],
) -> None:
    """Write an MCAP file of ROS 2 messages. `labels` is called after the last frame.

    Raises RecordingError where it cannot be written.
    """
    maker = MessageMaker("cdr")
    last_ns = 0
    with mcap_file(path, profile="ros2", compression=compression) as file:
        for topic, schema, stamp_ns, data in _messages(maker, rig, frames, how):
            definition = Definition("ros2msg", maker.definition(schema).encode())
            file.write(Topic(topic, schema, "cdr"), definition, stamp_ns, data)
            last_ns = max(last_ns, stamp_ns)
        file.add_labels(labels, last_ns)
        file.add_metadata(_metadata(how))


def write_bag(
    path: Path, rig: Rig, frames: Iterable[Frame], labels: Iterable[AttackLabel] = (), **how: Unpack[RecorderStyle]
) -> None:
    """Write a ROS 1 .bag; ground truth and vehicle go to a topic, since it has no attachments. See write_mcap."""
    maker = MessageMaker("ros1")
    with whole_file(path) as beside, BagWriter(beside) as writer:
        _write_all(writer, maker, _with_metadata(maker, _messages(maker, rig, frames, how), labels, how))


def write_db3(
    path: Path, rig: Rig, frames: Iterable[Frame], labels: Iterable[AttackLabel] = (), **how: Unpack[RecorderStyle]
) -> None:
    """Write a rosbag2 folder with a .db3 file. Raises RecordingError where the folder exists. See write_bag."""
    maker = MessageMaker("cdr")
    with (
        whole_folder(path) as beside,
        Rosbag2Writer(beside, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer,
    ):
        _write_all(writer, maker, _with_metadata(maker, _messages(maker, rig, frames, how), labels, how))


def _metadata(how: RecorderStyle) -> dict[str, str]:
    vehicle = how.get("vehicle")
    return {"vehicle": vehicle} if vehicle else {}


def _write_all(writer: Any, maker: MessageMaker, outgoing: Iterable[_Outgoing]) -> None:  # noqa: ANN401  # two writers
    connections: dict[str, Any] = {}
    for topic, schema, stamp_ns, data in outgoing:
        if topic not in connections:
            connections[topic] = writer.add_connection(topic, schema, typestore=maker.store)
        writer.write(connections[topic], stamp_ns, data)


def _with_metadata(
    maker: MessageMaker, messages: Iterable[_Outgoing], labels: Iterable[AttackLabel], how: RecorderStyle
) -> Iterator[_Outgoing]:
    last_ns = 0
    for message in messages:
        last_ns = max(last_ns, message.stamp_ns)
        yield message
    declared = {"labels": [label_to_dict(label) for label in labels], "metadata": _metadata(how)}
    yield _Outgoing(METADATA_TOPIC, schemas.STRING, last_ns, maker.string(json.dumps(declared)))


def _messages(maker: MessageMaker, rig: Rig, frames: Iterable[Frame], how: RecorderStyle) -> Iterator[_Outgoing]:
    form, place = how.get("image", "raw"), how.get("place")
    frame_ids, info_topics = _frame_ids(rig), _info_topics(rig)
    placed = False
    for frame in frames:
        if not placed:
            yield _transforms(maker, rig, frame_ids, frame.stamp_ns)
            placed = True
        if place is not None:
            fix = maker.fix(place(frame.stamp_ns), frame.stamp_ns)
            yield _Outgoing(FIX_TOPIC, schemas.GPS_FIX, frame.stamp_ns, fix)
        for number, image in sorted(frame.images.items()):
            camera, frame_id = rig.camera(number), frame_ids[number]
            size, at = (camera.width_px, camera.height_px), (image.stamp_ns, frame_id)
            info = maker.camera_info(_projection(camera), *size, *at, camera.lens)
            yield _Outgoing(info_topics[number], schemas.CAMERA_INFO, image.stamp_ns, info)
            schema, data = maker.image(image.pixels, image.stamp_ns, frame_id, form)
            yield _Outgoing(camera.topic, schema, image.stamp_ns, data)
        for number, cloud in frame.clouds.items() if rig.lidar else ():
            points = np.zeros((len(cloud.xyz_m), 4), np.float32)
            points[:, :3] = cloud.xyz_m
            data = maker.point_cloud(points, cloud.stamp_ns, frame_ids[number])
            yield _Outgoing(rig.topic(number), schemas.POINT_CLOUD, cloud.stamp_ns, data)


def _transforms(maker: MessageMaker, rig: Rig, frame_ids: dict[int, str], stamp_ns: int) -> _Outgoing:
    children = {frame_ids[camera.number]: motion(camera.rotation.T, camera.centre_m) for camera in rig.cameras}
    children |= {frame_ids[number]: lidar.rig_SE3_lidar for number, lidar in rig.lidars.items()}
    return _Outgoing(TRANSFORMS_TOPIC, schemas.TRANSFORMS, stamp_ns, maker.transforms(RIG_FRAME, children, stamp_ns))


def _projection(camera: Camera) -> Matrix:
    """P in the rig's frame; cameras that look elsewhere than along the rig have none: tf holds their places."""
    return camera.projection if camera.rectified else np.hstack([camera.intrinsics, np.zeros((3, 1))])


def _frame_ids(rig: Rig) -> dict[int, str]:
    """The frame ids: names of the sensors where all differ, else their numbers."""
    names = {sensor: rig.name(sensor) for sensor in rig.sensors}
    if len({*names.values(), RIG_FRAME}) == len(names) + 1 and all(names.values()):
        return names
    return {sensor: f"sensor_{sensor}" for sensor in rig.sensors}


def _info_topics(rig: Rig) -> dict[int, str]:
    """The camera info stands beside its image, or below it where two images would share it."""
    beside = Counter(_namespace(camera) for camera in rig.cameras)
    return {
        camera.number: f"{_namespace(camera) if beside[_namespace(camera)] == 1 else camera.topic}/camera_info"
        for camera in rig.cameras
    }


def _namespace(camera: Camera) -> str:
    return camera.topic.rpartition("/")[0]
