"""Sequences of PandaSet: one folder a sequence, whose clouds are pickled tables.

Format: scaleapi/pandaset-devkit, README and geometry. camera/NAME/NN.jpg with intrinsics.json (K; pictures are without
distortion), poses.json (world_SE3_camera) and timestamps.json; lidar/NN.pkl.gz with the columns x, y, z (in the frame
of the world, each point where it was when it was measured), i, t and d (0 the Pandar64, 1 the PandarGT).

lidar/poses.json is where the vehicle was at the end of a sweep, and no pose of a LiDAR. Sweep NN is half done when
picture NN of the front camera is taken: it is told for that moment, by that picture's pose and the published place of
the Pandar64 in the front camera (docs/static_extrinsic_calibration.yaml there).
"""

import zlib
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from auditor.errors import DecodingError, RecordingError
from auditor.model.optics.geometry import Matrix, compose, invert, quaternion_from_rotation
from auditor.recordings.content import Contents
from auditor.recordings.decoding.geometry import motion_of
from auditor.recordings.decoding.picture_heads import inspect_picture
from auditor.recordings.formats.datasets.dataset import DatasetRecording, Pinhole, Sensor, existing, load_table
from auditor.recordings.formats.datasets.pickles import columns_of
from auditor.safety.budget import CHUNKS, OverBudgetError, Spending

_FRONT = "front_camera"
_DESCRIBED_BY = ("intrinsics.json", "poses.json", "timestamps.json")
_AHEAD = motion_of((0.0, 0.0, -(0.5**0.5), 0.5**0.5), (0.0, 0.0, 0.0))
"""The Pandar64's own frame has x to the left and y to the back: from one with x ahead and y to the left into it."""

FRONT_SE3_LIDAR = compose(
    motion_of(
        (0.0030578899383849464, 0.7114721800418571, -0.7025205466606356, 0.016213200031258722),
        (0.0002585796504896516, -0.03907777167811011, -0.0440125762408362),
    ),
    _AHEAD,
)
"""Where the Pandar64 sits in the front camera, as published: 4 cm above and behind it; x ahead, y left, z up."""

_COLUMNS = ("x", "y", "z", "i", "d")
_PANDAR64 = 0
_MOST_ROWS = 1 << 21
_GZIP = b"\x1f\x8b"
_GZIP_FORM = 16 + zlib.MAX_WBITS


class PandaSetReader:
    """Recognises a sequence's folder."""

    def detects(self, path: Path) -> bool:
        """True for a folder with pickled clouds and cameras."""
        return (path / "camera").is_dir() and any((path / "lidar").glob("*.pkl*"))

    def open(self, path: Path) -> DatasetRecording:
        """Open it. Raises RecordingError where it lacks the front camera, or its calibration is ill-formed."""
        contents = Contents()
        folders = sorted(folder for folder in (path / "camera").iterdir() if (folder / _DESCRIBED_BY[0]).is_file())
        files = [folder / name for folder in folders for name in _DESCRIBED_BY]
        try:
            cameras = {folder.name: _camera(folder, contents) for folder in folders}
            if _FRONT not in cameras:
                raise RecordingError(f"it has no {_FRONT}, whose poses say where the LiDAR was", where=path)
            front = cameras[_FRONT]
            sensors, lacking = [], 0
            for name, camera in cameras.items():
                entries, missing = existing(path, camera.named(f"camera/{name}/{{:02d}}.jpg"))
                lacking += missing
                if entries:
                    size_px = inspect_picture(memoryview(contents.of(entries[0][1]).read())).size_px
                    lidar_SE3_camera = compose(invert(FRONT_SE3_LIDAR), _place(front, camera))
                    sensors.append(Sensor(name, lidar_SE3_camera, entries, Pinhole(camera.K, *size_px)))
            lidar, missing = _lidar(path, front)
        except (KeyError, TypeError, ValueError, AttributeError, OverflowError, DecodingError) as error:
            raise RecordingError(f"its calibration is ill-formed ({error!r})", where=path) from error
        return DatasetRecording(path, "pandaset", [*sensors, lidar], files, contents, lacking=lacking + missing)


class _Camera(NamedTuple):
    """A camera's K, its stamps, and where it was then: positions (N, 3) and quaternions (N, 4) x, y, z, w."""

    K: Matrix
    stamps_ns: tuple[int, ...]
    positions_m: Matrix
    quaternions: Matrix

    def pose(self, number: int) -> Matrix:
        """world_SE3_camera of a picture."""
        return motion_of(tuple(self.quaternions[number]), tuple(self.positions_m[number]))

    def pose_at(self, stamp_ns: int) -> Matrix:
        """world_SE3_camera between two pictures, as if it moved evenly from one to the next."""
        seconds = (np.array(self.stamps_ns) - self.stamps_ns[0]) / 1e9
        numbers = np.hstack([self.quaternions, self.positions_m]).T
        at = [float(np.interp((stamp_ns - self.stamps_ns[0]) / 1e9, seconds, row)) for row in numbers]
        return motion_of(at[:4], at[4:])

    def named(self, form: str) -> list[tuple[int, str]]:
        """The stamps, each with the name of the file of that number."""
        return [(stamp_ns, form.format(number)) for number, stamp_ns in enumerate(self.stamps_ns)]


def _camera(folder: Path, contents: Contents) -> _Camera:
    K, poses, stamps = (load_table(folder / name, contents) for name in _DESCRIBED_BY)
    matrix = np.array([[K["fx"], 0, K["cx"]], [0, K["fy"], K["cy"]], [0, 0, 1]], np.float64)
    if len(poses) != len(stamps) or not poses:
        raise ValueError(f"{folder.name} has {len(stamps)} times and {len(poses)} poses")
    stamps_ns = tuple(round(float(stamp) * 10**6) * 1000 for stamp in stamps)
    if any(later <= earlier for earlier, later in pairwise(stamps_ns)):
        raise ValueError(f"the times of {folder.name} do not follow one another")
    positions = np.array([_numbers(pose["position"], "xyz") for pose in poses])
    return _Camera(matrix, stamps_ns, positions, _alike([_numbers(pose["heading"], "xyzw") for pose in poses]))


def _numbers(values: Mapping[str, Any], names: str) -> list[float]:
    return [float(values[name]) for name in names]


def _alike(quaternions: Sequence[Sequence[float]]) -> Matrix:
    """(N, 4): of the two quaternions of each rotation that which is nearer to the one before."""
    turned = [np.array(quaternions[0])]
    for quaternion in quaternions[1:]:
        turned.append(np.array(quaternion) * (1 if np.dot(turned[-1], quaternion) >= 0 else -1))
    return np.array(turned)


def _place(front: _Camera, camera: _Camera) -> Matrix:
    """front_SE3_camera: the median over its pictures, each by where the front camera was when it was taken."""
    if camera is front:
        return np.eye(4)
    between = [n for n, t in enumerate(camera.stamps_ns) if front.stamps_ns[0] <= t <= front.stamps_ns[-1]]
    places = [
        compose(invert(front.pose_at(camera.stamps_ns[n])), camera.pose(n))
        for n in between or range(len(camera.stamps_ns))
    ]
    quaternions = _alike([quaternion_from_rotation(place[:3, :3]) for place in places])
    translation = np.median([place[:3, 3] for place in places], axis=0)
    return motion_of(tuple(np.median(quaternions, axis=0)), tuple(translation))


def _lidar(path: Path, front: _Camera) -> tuple[Sensor, int]:
    """The Pandar64, and how many of its files are not there."""
    ending = ".pkl.gz" if any((path / "lidar").glob("*.pkl.gz")) else ".pkl"
    entries, lacking = existing(path, front.named(f"lidar/{{:02d}}{ending}"))
    poses = {stamp_ns: invert(compose(front.pose(n), FRONT_SE3_LIDAR)) for n, stamp_ns in enumerate(front.stamps_ns)}
    return Sensor("pandar64", np.eye(4), entries, read=points_of_pickle, sensor_SE3_world=poses), lacking


def points_of_pickle(data: bytes) -> NDArray[np.float64]:
    """(N, 4) of a pickled table, packed by gzip or not: x, y, z and intensity of the Pandar64. Raises ValueError."""
    columns = columns_of(_unpacked(data) if data.startswith(_GZIP) else data, _COLUMNS)
    lacking = [name for name in _COLUMNS[:3] if name not in columns]
    if lacking:
        raise ValueError(f"its table lacks {', '.join(lacking)}")
    if len(columns["x"]) > _MOST_ROWS:
        raise ValueError(f"its table has {len(columns['x'])} rows")
    points = np.zeros((len(columns["x"]), 4))
    with np.errstate(invalid="ignore"):  # of numbers that are none there are those that warn
        for place, name in enumerate(_COLUMNS[:4]):
            if name in columns:
                points[:, place] = columns[name]
    return points[columns["d"] == _PANDAR64] if "d" in columns else points


def _unpacked(data: bytes) -> bytes:
    declared = int.from_bytes(data[-4:], "little")
    try:
        Spending(CHUNKS).allow(len(data), declared)
        unpacker = zlib.decompressobj(_GZIP_FORM)
        unpacked = unpacker.decompress(data, declared + 1)
    except OverBudgetError as error:
        raise ValueError(f"it {error}") from error
    except zlib.error as error:
        raise ValueError("its gzip data are damaged") from error
    if not unpacker.eof or unpacker.unused_data or len(unpacked) != declared:
        raise ValueError("its gzip data are cut, or more than they declare")
    return unpacked
