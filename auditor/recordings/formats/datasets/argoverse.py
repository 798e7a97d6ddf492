"""Logs of Argoverse 2's sensor data set: one folder a log.

Format: the Argoverse 2 user guide, "Sensor Dataset". calibration/egovehicle_SE3_sensor.feather says where the sensors
sit, intrinsics.feather K (pictures are published without distortion, so k1 to k3 are not used).
sensors/cameras/NAME/STAMP.jpg, and sensors/lidar/STAMP.feather with points in the frame of the vehicle, which are taken
back into that of the upper LiDAR. Stamps are ns of an epoch that is not said.
"""

import re
from collections.abc import Mapping
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auditor.errors import RecordingError
from auditor.model.optics.geometry import Matrix, invert
from auditor.recordings.content import Contents
from auditor.recordings.decoding.geometry import motion_of
from auditor.recordings.formats.datasets.dataset import (
    DatasetRecording,
    Pinhole,
    Sensor,
    numbered_by_stamp,
    quaternion_of,
)
from auditor.safety.budget import CHUNKS, OverBudgetError, Spending

_PLACES, _INTRINSICS = "calibration/egovehicle_SE3_sensor.feather", "calibration/intrinsics.feather"
_LIDAR = "up_lidar"
_FRAMES = re.compile(rb"\x28\xb5\x2f\xfd|\x04\x22\x4d\x18[\x40-\x7f][\x40\x50\x60\x70]")
_ALIGNED = 8
"""A buffer of Arrow begins at a multiple of so many bytes, with its unpacked size, and a frame of zstd or lz4."""

_MOST_ROWS = 100


class ArgoverseReader:
    """Recognises a log's folder."""

    def detects(self, path: Path) -> bool:
        """True for a folder with Argoverse 2's calibration files."""
        return (path / _PLACES).is_file() and (path / _INTRINSICS).is_file()

    def open(self, path: Path) -> DatasetRecording:
        """Open it. Raises RecordingError where its calibration is ill-formed."""
        contents, files = Contents(), (path / _PLACES, path / _INTRINSICS)
        try:
            places, intrinsics = (_rows(contents.of(file).read()) for file in files)
            at = {str(row["sensor_name"]): _motion(row) for row in places}
            sensors = [_camera(path, row, at) for row in intrinsics if str(row["sensor_name"]) in at]
            if _LIDAR in at:
                read = partial(_points, lidar_SE3_vehicle=invert(at[_LIDAR]))
                entries = numbered_by_stamp(path / "sensors" / "lidar", "*.feather")
                sensors.append(Sensor("lidar", at[_LIDAR], entries, read=read))
        except (KeyError, TypeError, ValueError) as error:
            raise RecordingError(f"its calibration is ill-formed ({error!r})", where=path) from error
        return DatasetRecording(path, "argoverse", sensors, files, contents, clock="unknown")


def _camera(folder: Path, row: Mapping[str, Any], at: Mapping[str, Matrix]) -> Sensor:
    name = Path(str(row["sensor_name"])).name
    K = np.array([[row["fx_px"], 0, row["cx_px"]], [0, row["fy_px"], row["cy_px"]], [0, 0, 1]], np.float64)
    pinhole = Pinhole(K, int(row["width_px"]), int(row["height_px"]))
    return Sensor(name, at[name], numbered_by_stamp(folder / "sensors" / "cameras" / name, "*.jpg"), pinhole)


def _motion(row: Mapping[str, Any]) -> Matrix:
    return motion_of(quaternion_of(row), [float(row[f"t{axis}_m"]) for axis in "xyz"])


def _points(data: bytes, lidar_SE3_vehicle: Matrix) -> NDArray[np.float32]:
    table = table_of(data)
    columns = [np.asarray(table.column(name).to_numpy(), np.float32) for name in ("x", "y", "z", "intensity")]
    points = np.column_stack(columns)
    points[:, :3] = points[:, :3] @ lidar_SE3_vehicle[:3, :3].T + lidar_SE3_vehicle[:3, 3]
    return points


def _rows(data: bytes) -> list[dict[str, Any]]:
    table = table_of(data)
    if table.num_rows > _MOST_ROWS:
        raise ValueError(f"{table.num_rows} sensors are not accepted")
    rows: list[dict[str, Any]] = table.to_pylist()
    return rows


def table_of(data: bytes) -> Any:  # noqa: ANN401  # a library without types
    """The table of a feather file. Raises ValueError."""
    import pyarrow  # noqa: PLC0415  # of what is read elsewhere nothing needs it
    import pyarrow.feather  # noqa: PLC0415

    begins = [frame.start() for frame in _FRAMES.finditer(data) if frame.start() % _ALIGNED == 0]
    sizes = [int.from_bytes(data[max(at - _ALIGNED, 0) : at], "little", signed=True) for at in begins]
    try:
        Spending(CHUNKS).allow(len(data), len(data) + sum(size for size in sizes if size > 0))
        table = pyarrow.feather.read_table(BytesIO(data))
        table.validate(full=True)
    except OverBudgetError as error:
        raise ValueError(f"it {error}") from error
    except (pyarrow.ArrowException, OSError, MemoryError, KeyError) as error:
        raise ValueError(f"it is no feather file ({type(error).__name__})") from error
    return table
