"""A scene of nuScenes: a folder with its tables (`v1.0-*`), and with the files that they name.

Format: nuScenes' schema (nutonomy/nuscenes-devkit, docs/schema_nuscenes.md). sample_data has the files with their
stamps in us, calibrated_sensor where each sensor sits and K; pictures are without distortion. A cloud is N x (x, y, z,
intensity, ring), float32. One recording is one scene: `recipes/nuscenes_scene.py` makes a folder of one out of many.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auditor.errors import RecordingError
from auditor.recordings.content import Contents
from auditor.recordings.decoding.geometry import motion_of
from auditor.recordings.formats.datasets.dataset import DatasetRecording, Pinhole, Sensor, existing, load_table

_TABLES = ("scene", "sample_data", "calibrated_sensor", "sensor")
_POINT_NUMBERS = 5


class NuscenesReader:
    """Recognises a folder with tables."""

    def detects(self, path: Path) -> bool:
        """True where exactly one folder of tables lies in it."""
        return len(list(path.glob("v1.0-*/sample_data.json"))) == 1

    def open(self, path: Path) -> DatasetRecording:
        """Open it. Raises RecordingError where it has several scenes, or its tables are ill-formed."""
        [folder], contents = (file.parent for file in path.glob("v1.0-*/sample_data.json")), Contents()
        files = [folder / f"{name}.json" for name in _TABLES]
        lacking_tables = [file.name for file in files if not file.is_file()]
        if lacking_tables:
            raise RecordingError(f"it lacks {', '.join(lacking_tables)}", where=folder)
        try:
            scenes = load_table(files[0], contents)
            if len(scenes) != 1:
                raise RecordingError(
                    f"it holds {len(scenes)} scenes, and a recording is one",
                    where=path,
                    remedy="make a folder of one scene: python recipes/nuscenes_scene.py",
                )
            _, data, calibrated, sensor_rows = (load_table(file, contents) for file in files)
            sensors = list(_sensors(path, data, _by_token(calibrated), _by_token(sensor_rows)))
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise RecordingError(f"its tables are ill-formed ({error!r})", where=folder) from error
        lacking = sum(missing for _, missing in sensors)
        return DatasetRecording(path, "nuscenes", [one for one, _ in sensors], files, contents, lacking=lacking)


def _by_token(table: list[Mapping[str, Any]]) -> dict[str, Mapping[str, Any]]:
    return {str(row["token"]): row for row in table}


def _sensors(
    folder: Path,
    data: list[Mapping[str, Any]],
    calibrated: Mapping[str, Mapping[str, Any]],
    sensor_rows: Mapping[str, Mapping[str, Any]],
) -> Iterator[tuple[Sensor, int]]:
    """Each camera and LiDAR, and how many of its files are not there."""
    of_sensors: dict[str, list[Mapping[str, Any]]] = defaultdict(list)
    for row in data:
        of_sensors[str(row["calibrated_sensor_token"])].append(row)
    for token, rows in of_sensors.items():
        place = calibrated[token]
        sensor = sensor_rows[str(place["sensor_token"])]
        if sensor["modality"] not in {"camera", "lidar"}:
            continue
        entries, lacking = existing(folder, [(int(row["timestamp"]) * 1000, str(row["filename"])) for row in rows])
        w, x, y, z = (float(value) for value in place["rotation"])
        vehicle_SE3_sensor = motion_of((x, y, z, w), [float(value) for value in place["translation"]])
        name = str(sensor["channel"])
        if sensor["modality"] == "lidar":
            yield Sensor(name, vehicle_SE3_sensor, entries, read=_points), lacking
        else:
            K = np.array(place["camera_intrinsic"], np.float64).reshape(3, 3)
            pinhole = Pinhole(K, int(rows[0]["width"]), int(rows[0]["height"]))
            yield Sensor(name, vehicle_SE3_sensor, entries, pinhole), lacking


def _points(data: bytes) -> NDArray[np.float32]:
    if len(data) % (4 * _POINT_NUMBERS):
        raise ValueError(f"{len(data)} bytes are not whole points")
    return np.frombuffer(data, "<f4").reshape(-1, _POINT_NUMBERS)[:, :4]
