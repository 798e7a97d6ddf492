"""Scenes of DDAD and others in the layout of TRI's Dataset Governance Policy (DGP): one folder a scene.

Format: TRI-ML/dgp, its protocol files scene, sample and geometry. scene_*.json has the files with their stamps, and
calibration/*.json where the sensors sit on the vehicle, and K; DDAD's pictures are without distortion. Clouds are .npz.
DDAD's stamps count units of 100 ns as microseconds, and so lie in the year 2463.
"""

from collections.abc import Iterator, Mapping
from datetime import UTC, datetime, timedelta
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auditor.errors import RecordingError
from auditor.recordings.content import Contents
from auditor.recordings.decoding.geometry import motion_of
from auditor.recordings.formats.datasets.dataset import (
    DatasetRecording,
    Pinhole,
    Sensor,
    existing,
    load_table,
    quaternion_of,
)
from auditor.safety.budget import CHUNKS
from auditor.safety.zips import UnsafeZipError, opened

_SCENES = "scene_*.json"
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_LATEST_YEAR = 2100
_COLUMNS = 4


class DgpReader:
    """Recognises a scene's folder."""

    def detects(self, path: Path) -> bool:
        """True for a folder with the description of one scene and its calibrations."""
        return (path / "calibration").is_dir() and len(list(path.glob(_SCENES))) == 1

    def open(self, path: Path) -> DatasetRecording:
        """Open it. Raises RecordingError where its description is ill-formed."""
        [scene_file], contents = path.glob(_SCENES), Contents()
        try:
            scene = load_table(scene_file, contents)
            keys = {sample["calibration_key"] for sample in scene["samples"]}
            if len(keys) != 1:
                raise RecordingError(f"it has {len(keys)} calibrations", where=scene_file)
            calibration_file = path / "calibration" / f"{Path(*keys).name}.json"
            calibration = load_table(calibration_file, contents)
            sensors, lacking = [], 0
            for name, place, K in zip(
                *(calibration[key] for key in ("names", "extrinsics", "intrinsics")), strict=True
            ):
                sensor, missing = _sensor(path, scene["data"], str(name), place, K)
                sensors.append(sensor)
                lacking += missing
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise RecordingError(f"the scene is ill-formed ({error!r})", where=scene_file) from error
        return DatasetRecording(path, "dgp", sensors, (scene_file, calibration_file), contents, lacking=lacking)


def _sensor(
    folder: Path, data: list[Any], name: str, place: Mapping[str, Any], K: Mapping[str, float]
) -> tuple[Sensor, int]:
    """The sensor, and how many of its files are not there."""
    records = list(_files(data, name))
    entries, lacking = existing(folder, [(stamp_ns, str(datum["filename"])) for stamp_ns, datum in records])
    translation = [float(place["translation"][axis]) for axis in "xyz"]
    vehicle_SE3_sensor = motion_of(quaternion_of(place["rotation"]), translation)
    pictures = [datum for _, datum in records if "width" in datum]
    if not pictures:
        return Sensor(name, vehicle_SE3_sensor, entries, read=points_of_npz), lacking
    matrix = np.array([[K["fx"], K["skew"], K["cx"]], [0, K["fy"], K["cy"]], [0, 0, 1]], np.float64)
    pinhole = Pinhole(matrix, int(pictures[0]["width"]), int(pictures[0]["height"]))
    return Sensor(name, vehicle_SE3_sensor, entries, pinhole), lacking


def _files(data: list[Any], name: str) -> Iterator[tuple[int, Mapping[str, Any]]]:
    for record in data:
        datum = record["datum"].get("image") or record["datum"].get("point_cloud")
        if record["id"]["name"] == name and datum is not None:
            yield _stamp_ns(str(record["id"]["timestamp"])), datum


def _stamp_ns(text: str) -> int:
    moment = datetime.fromisoformat(text.replace("Z", "+00:00"))
    units = (moment - _EPOCH) // timedelta(microseconds=1)
    return units * 1000 if moment.year < _LATEST_YEAR else units * 100


def points_of_npz(data: bytes) -> NDArray[np.float32]:
    """(N, 4) of the only array of an .npz, whose first columns are x, y, z and intensity. Raises ValueError."""
    try:
        with opened(BytesIO(data), CHUNKS) as archive:
            [name] = archive.namelist()
            member = BytesIO(archive.read(name))
    except UnsafeZipError as error:
        raise ValueError(str(error)) from error
    version = np.lib.format.read_magic(member)
    read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, fortran_order, dtype = read_header(member)
    held = len(member.getbuffer()) - member.tell()
    if len(shape) != 2 or shape[1] < _COLUMNS or fortran_order or dtype.kind != "f":
        raise ValueError("it is no array of points")
    if shape[0] * shape[1] * dtype.itemsize != held:
        raise ValueError(f"it declares {shape[0]} points, and holds {held} bytes")
    values = np.frombuffer(member.getbuffer(), dtype, offset=member.tell()).reshape(shape)
    with np.errstate(over="ignore"):
        return values[:, :_COLUMNS].astype(np.float32)
