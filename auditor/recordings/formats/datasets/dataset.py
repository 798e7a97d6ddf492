"""What all data sets have in common: sensors with files, stamps and places, which become messages of ROS 2."""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from auditor.errors import DecodingError, RecordingError
from auditor.model.frames import Message
from auditor.model.optics.geometry import Matrix
from auditor.recordings import schemas
from auditor.recordings.content import Contents
from auditor.recordings.formats.folders import FolderRecording, Stream
from auditor.recordings.recording import Clock, Damage, Topic
from auditor.recordings.writers.messages import MessageMaker
from auditor.safety.budget import MAX_BYTES, MAX_POINTS

TRANSFORMS_TOPIC = "/tf_static"
_VEHICLE = "vehicle"

ReadPoints = Callable[[bytes], NDArray[np.float32 | np.float64]]
"""The (N, 4) points of a file: x, y, z in metres, and intensity. Raises ValueError."""


class Pinhole(NamedTuple):
    """A camera whose pictures are without distortion: K, (3, 3), and their size."""

    K: Matrix
    width_px: int
    height_px: int


class Sensor(NamedTuple):
    """A sensor with its files by their stamps, and where it sits; a camera has a pinhole, a LiDAR reads points.

    Points are in the frame of the LiDAR, or in that of the world: then `sensor_SE3_world` is by the files' stamps.
    """

    name: str
    vehicle_SE3_sensor: Matrix
    entries: tuple[tuple[int, Path], ...]
    pinhole: Pinhole | None = None
    read: ReadPoints | None = None
    sensor_SE3_world: Mapping[int, Matrix] | None = None


class DatasetRecording(FolderRecording):
    """One drive; `files` are those that describe it, and `lacking` what of it is not there."""

    def __init__(
        self,
        path: Path,
        dataset: str,
        sensors: Sequence[Sensor],
        files: Iterable[Path],
        contents: Contents,
        *,
        clock: Clock = "utc",
        lacking: int = 0,
    ) -> None:
        self._dataset = dataset
        self._sensors = {self._topic(sensor).name: sensor for sensor in sensors if sensor.entries}
        streams = [Stream(self._topic(sensor), sensor.entries) for sensor in self._sensors.values()]
        super().__init__(path, path, streams, files, clock, contents)
        self._maker = MessageMaker("cdr")
        self.lacking = (Damage(f"{lacking} of the files that it names are not there"),) if lacking else ()

    def _topic(self, sensor: Sensor) -> Topic:
        kind, schema = ("image", schemas.COMPRESSED_IMAGE) if sensor.pinhole else ("points", schemas.POINT_CLOUD)
        return Topic(f"/{self._dataset}/{sensor.name}/{kind}", schema, "cdr")

    def _fixed_messages(self) -> Iterator[Message]:
        stamp_ns = min(sensor.entries[0][0] for sensor in self._sensors.values())
        places = {sensor.name: sensor.vehicle_SE3_sensor for sensor in self._sensors.values()}
        data = self._maker.transforms(_VEHICLE, places, stamp_ns)
        yield Message(TRANSFORMS_TOPIC, schemas.TRANSFORMS, "cdr", stamp_ns, data)
        for topic, sensor in self._sensors.items():
            if sensor.pinhole is not None:
                K, width_px, height_px = sensor.pinhole
                P = np.hstack([K, np.zeros((3, 1))])
                data = self._maker.camera_info(P, width_px, height_px, stamp_ns, sensor.name)
                name = f"{topic.rpartition('/')[0]}/camera_info"
                yield Message(name, schemas.CAMERA_INFO, "cdr", stamp_ns, data)

    def _message(self, stamp_ns: int, topic: Topic, file: Path) -> Message:
        sensor, data = self._sensors[topic.name], self._data(file)
        if data and sensor.read is None:
            data = self._maker.compressed_image(data, file.suffix[1:].lower(), stamp_ns, sensor.name)
        elif data and sensor.read is not None:
            try:
                poses = sensor.sensor_SE3_world
                points = _moved(sensor.read(data)[:MAX_POINTS], None if poses is None else poses[stamp_ns])
                data = self._maker.point_cloud(points, stamp_ns, sensor.name)
            except (ValueError, DecodingError) as error:
                self._note(file, f"its points cannot be read ({error})")
                data = b""  # its message is then damaged
        return Message(topic.name, topic.schema, topic.encoding, stamp_ns, data)


def _moved(points: NDArray[np.float32 | np.float64], dst_SE3_src: Matrix | None) -> NDArray[np.float32]:
    """The (N, 4) points in another frame, or as they are. Numbers that are no distances stay none."""
    if dst_SE3_src is None:
        return points.astype(np.float32, copy=False)
    with np.errstate(over="ignore", invalid="ignore"):
        xyz_m = points[:, :3] @ dst_SE3_src[:3, :3].T + dst_SE3_src[:3, 3]
        return np.column_stack([xyz_m, points[:, 3]]).astype(np.float32)


def load_table(file: Path, contents: Contents) -> Any:  # noqa: ANN401  # what JSON holds
    """What a file of JSON holds. Raises RecordingError."""
    content = contents.of(file)
    if content.size > MAX_BYTES:
        raise RecordingError(f"it has more than {MAX_BYTES} bytes", where=file)
    try:
        return json.loads(content.read())
    except (ValueError, RecursionError) as error:
        raise RecordingError(f"it is no JSON ({type(error).__name__})", where=file) from error


def existing(folder: Path, named: Iterable[tuple[int, str]]) -> tuple[tuple[tuple[int, Path], ...], int]:
    """Stamps and paths of the files below a folder that are named and there, in order, and how many are not there."""
    top, files, lacking = folder.resolve(), [], 0
    for stamp_ns, name in named:
        file = folder / name
        if file.resolve().is_relative_to(top) and file.is_file():
            files.append((stamp_ns, file))
        else:
            lacking += 1
    return tuple(sorted(files)), lacking


def numbered_by_stamp(folder: Path, pattern: str) -> tuple[tuple[int, Path], ...]:
    """The files of a folder whose names are their stamps, by these numbers."""
    return tuple(sorted((int(file.stem), file) for file in folder.glob(pattern) if file.stem.isdecimal()))


def quaternion_of(values: Mapping[str, Any]) -> tuple[float, float, float, float]:
    """(x, y, z, w) of numbers that are called qx, qy, qz and qw."""
    x, y, z, w = (float(values[name]) for name in ("qx", "qy", "qz", "qw"))
    return x, y, z, w
