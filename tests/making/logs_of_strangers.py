"""Recordings as other people's recorders write them, by mcap and rosbags alone: nothing of auditor makes them.

A log is a list of messages that have no bytes yet. Whatever somebody does to a log is done to that list; `write` then
makes bytes of it, in one of three containers.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Rosbag2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from tests.making.vehicles_of_strangers import LIDAR_FRAME, Seen, Vehicle, see, with_spot, with_wall

START_NS = 1_317_042_145_964_389_445
"""A real clock counts nanoseconds: 2011-09-26, 13:02:25.964389445 UTC."""
PERIOD_NS = 103_217_889
DAY_NS = 86_400 * 10**9
_FLOAT32 = 7
_TF = "tf2_msgs/TFMessage"


@dataclass(frozen=True, eq=False)
class Picture:
    """An image, raw or as a file of a form; of a file only the first share of its bytes is kept."""

    pixels: NDArray[np.uint8]
    form: str
    kept: float = 1.0


@dataclass(frozen=True, eq=False)
class Cloud:
    """(N, 3) points; `width` is how many the message says there are."""

    xyz_m: NDArray[np.float32]
    width: int | None = None


@dataclass(frozen=True, eq=False)
class Calibration:
    """What a camera info holds: P, (3, 4), and the size of the images."""

    projection: NDArray[np.float64]
    size_px: tuple[int, int]


@dataclass(frozen=True, eq=False)
class Mounts:
    """By frame where it sits in the parent frame, (4, 4)."""

    places: Mapping[str, NDArray[np.float64]]
    parent: str


@dataclass(frozen=True)
class Unknown:
    """A message of a type that only its maker knows."""

    schema: str
    data: bytes


@dataclass(frozen=True, eq=False)
class Sent:
    """One message: the stamp in its header, and when the recorder wrote it."""

    topic: str
    frame_id: str
    stamp_ns: int
    log_ns: int
    body: Picture | Cloud | Calibration | Mounts | Unknown
    moment: int = 0

    def restamped(self, stamp_ns: int) -> "Sent":
        return replace(self, stamp_ns=stamp_ns)


Log = list[Sent]


@dataclass(frozen=True)
class Attack:
    """A laser's spot on some cameras and a wall in the cloud, so far ahead, in some moments."""

    cameras: tuple[str, ...] = ()
    wall: bool = False
    moments: range = range(0)
    ahead_m: float = 5.0

    def on(self, seen: Seen, moment: int) -> Seen:
        if moment not in self.moments:
            return seen
        spots = {camera: with_spot(seen.images[camera], moment) for camera in self.cameras}
        return Seen(seen.images | spots, with_wall(seen.xyz_m, self.ahead_m) if self.wall else seen.xyz_m)


NO_ATTACK = Attack()


def record(
    vehicle: Vehicle,
    moments: range,
    *,
    attack: Attack = NO_ATTACK,
    seed: int = 0,
    start_ns: int = START_NS,
    scene: Callable[[int], Seen] | None = None,
    clock: Callable[[str, int], int] | None = None,
) -> Log:
    """What a recorder writes of some moments: the mounts once, then the sensors, each at a time of its own.

    `scene` gives what is seen at a moment, `clock` when a sensor sees it, in place of the vehicle's synthetic ones.
    """

    def synthetic_clock(sensor: str, moment: int) -> int:
        offset_ns = list(vehicle.cameras).index(sensor) * 811_003 if sensor in vehicle.cameras else -17_000_123
        return start_ns + vehicle.ahead_ns + moment * PERIOD_NS + offset_ns

    clock = clock or synthetic_clock
    begin_ns = clock(LIDAR_FRAME, moments[0])
    log = [Sent("/tf_static", vehicle.parent, begin_ns, begin_ns, Mounts(vehicle.mounts(), vehicle.parent))]
    for moment in moments:
        seen = attack.on(scene(moment) if scene else see(vehicle, moment, seed), moment)
        for camera, pixels in seen.images.items():
            stamp_ns = clock(camera, moment)
            frame = f"{camera}_optical"
            info = Calibration(vehicle.projection(camera), vehicle.size_px)
            log.append(Sent(vehicle.info(camera), frame, stamp_ns, stamp_ns + 21_000_017, info, moment))
            picture = Picture(pixels, vehicle.form)
            log.append(Sent(vehicle.topic(camera), frame, stamp_ns, stamp_ns + 23_000_041, picture, moment))
        swept_ns = clock(LIDAR_FRAME, moment)
        log.append(Sent(vehicle.lidar_topic, LIDAR_FRAME, swept_ns, swept_ns + 60_000_029, Cloud(seen.xyz_m), moment))
    return log


def write(path: Path, log: Iterable[Sent]) -> Path:
    """The log in the container of the path's ending: .mcap (ROS 2), .bag (ROS 1) or .db3 (a rosbag2 folder).

    Nothing is compressed: logs of equal messages in other bytes are files of equal size.
    """
    {".mcap": _write_mcap, ".bag": _write_bag, ".db3": _write_db3}[path.suffix](path, list(log))
    return path


def _write_mcap(path: Path, log: Sequence[Sent]) -> None:
    maker = _Maker(ros1=False)
    channels: dict[str, int] = {}
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start(profile="ros2", library="a stranger's recorder")
        for sent in log:
            schema, data = maker.bytes_of(sent)
            if sent.topic not in channels:
                name = schema.replace("/", "/msg/")
                made = writer.register_schema(name=name, encoding="ros2msg", data=maker.definition(schema).encode())
                channels[sent.topic] = writer.register_channel(sent.topic, "cdr", made)
            writer.add_message(channels[sent.topic], sent.log_ns, data, sent.log_ns)
        writer.finish()


def _write_bag(path: Path, log: Sequence[Sent]) -> None:
    with BagWriter(path) as writer:
        _write_with(writer, _Maker(ros1=True), log)


def _write_db3(path: Path, log: Sequence[Sent]) -> None:
    with Rosbag2Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        _write_with(writer, _Maker(ros1=False), log)


def _write_with(writer: Any, maker: "_Maker", log: Sequence[Sent]) -> None:
    connections: dict[str, Any] = {}
    for sent in log:
        schema, data = maker.bytes_of(sent)
        if sent.topic not in connections:
            name = schema.replace("/", "/msg/")
            connections[sent.topic] = writer.add_connection(sent.topic, name, typestore=maker.types)
        writer.write(connections[sent.topic], sent.log_ns, data)


class _Maker:
    """Makes the bytes of messages for one of the two versions of ROS."""

    def __init__(self, *, ros1: bool) -> None:
        self._ros1 = ros1
        self.types = _ros1_types() if ros1 else _ros2_types()

    def definition(self, schema: str) -> str:
        name = schema.replace("/", "/msg/")
        if name not in self.types.types:
            return "uint8[] data"
        return self.types.generate_msgdef(name, ros_version=1 if self._ros1 else 2)[0]

    def bytes_of(self, sent: Sent) -> tuple[str, bytes]:
        if isinstance(sent.body, Unknown):
            return sent.body.schema, sent.body.data
        schema, message = self._message(sent)
        name = schema.replace("/", "/msg/")
        serialise = self.types.serialize_ros1 if self._ros1 else self.types.serialize_cdr
        return schema, bytes(serialise(message, name))

    def _message(self, sent: Sent) -> tuple[str, object]:
        head = self._header(sent.stamp_ns, sent.frame_id)
        match sent.body:
            case Picture() as picture:
                return self._picture(picture, head)
            case Cloud() as cloud:
                return "sensor_msgs/PointCloud2", self._cloud(cloud, head)
            case Calibration() as calibration:
                return "sensor_msgs/CameraInfo", self._info(calibration, head)
            case Mounts() as mounts:
                made = [self._mount(head, mounts.parent, *one) for one in mounts.places.items()]
                return _TF, self._made(_TF, transforms=made)
        raise TypeError(sent.body)

    def _made(self, schema: str, **fields: object) -> Any:  # rosbags generates the classes
        return self.types.types[schema.replace("/", "/msg/")](**fields)

    def _header(self, stamp_ns: int, frame_id: str) -> object:
        seconds, nanoseconds = divmod(stamp_ns, 10**9)
        stamp = self._made("builtin_interfaces/Time", sec=seconds, nanosec=nanoseconds)
        return self._made("std_msgs/Header", **({"seq": 0} if self._ros1 else {}), stamp=stamp, frame_id=frame_id)

    def _picture(self, picture: Picture, head: object) -> tuple[str, object]:
        pixels = picture.pixels
        if picture.form == "raw":
            height, width = pixels.shape[:2]
            fields = {"encoding": "mono8" if pixels.ndim == 2 else "bgr8", "is_bigendian": 0}
            data = pixels.reshape(-1)
            return "sensor_msgs/Image", self._made(
                "sensor_msgs/Image",
                header=head,
                height=height,
                width=width,
                step=data.size // height,
                data=data,
                **fields,
            )
        data = cv2.imencode(f".{picture.form}", pixels)[1].reshape(-1)
        data = data[: round(picture.kept * len(data))]
        made = self._made("sensor_msgs/CompressedImage", header=head, format=picture.form, data=data)
        return "sensor_msgs/CompressedImage", made

    def _cloud(self, cloud: Cloud, head: object) -> object:
        points = np.zeros((len(cloud.xyz_m), 4), np.float32)
        points[:, :3] = cloud.xyz_m
        fields = [
            self._made("sensor_msgs/PointField", name=name, offset=4 * place, datatype=_FLOAT32, count=1)
            for place, name in enumerate(("x", "y", "z", "intensity"))
        ]
        width = len(points) if cloud.width is None else cloud.width
        return self._made(
            "sensor_msgs/PointCloud2",
            header=head,
            height=1,
            width=width,
            fields=fields,
            is_bigendian=False,
            point_step=16,
            row_step=16 * width,
            data=points.view(np.uint8).reshape(-1),
            is_dense=True,
        )

    def _info(self, calibration: Calibration, head: object) -> object:
        P, (width, height) = calibration.projection, calibration.size_px
        matrices = {"D": np.zeros(5), "K": P[:, :3].reshape(-1), "R": np.eye(3).reshape(-1), "P": P.reshape(-1)}
        named = {(name if self._ros1 else name.lower()): np.array(value) for name, value in matrices.items()}
        nothing = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0}
        return self._made(
            "sensor_msgs/CameraInfo",
            header=head,
            height=height,
            width=width,
            distortion_model="plumb_bob",
            binning_x=0,
            binning_y=0,
            roi=self._made("sensor_msgs/RegionOfInterest", do_rectify=False, **nothing),
            **named,
        )

    def _mount(self, head: Any, parent: str, child: str, place: NDArray[np.float64]) -> object:
        x, y, z = (float(value) for value in place[:3, 3])
        qx, qy, qz, qw = _quaternion(place[:3, :3])
        head = replace(head, frame_id=parent)
        return self._made(
            "geometry_msgs/TransformStamped",
            header=head,
            child_frame_id=child,
            transform=self._made(
                "geometry_msgs/Transform",
                translation=self._made("geometry_msgs/Vector3", x=x, y=y, z=z),
                rotation=self._made("geometry_msgs/Quaternion", x=qx, y=qy, z=qz, w=qw),
            ),
        )


def _quaternion(R: NDArray[np.float64]) -> tuple[float, float, float, float]:
    """x, y, z, w of a rotation by less than a half turn."""
    w = float(np.sqrt(max(0.0, 1 + np.trace(R)))) / 2
    x, y, z = ((R[2, 1] - R[1, 2]) / (4 * w), (R[0, 2] - R[2, 0]) / (4 * w), (R[1, 0] - R[0, 1]) / (4 * w))
    return float(x), float(y), float(z), w


@cache
def _ros2_types() -> Typestore:
    return get_typestore(Stores.ROS2_HUMBLE)


@cache
def _ros1_types() -> Typestore:
    types = get_typestore(Stores.ROS1_NOETIC)
    types.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
    return types
