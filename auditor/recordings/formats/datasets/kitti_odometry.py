"""Sequences of KITTI's odometry benchmark, `sequences/NN`, read as they were published.

Format: the KITTI odometry development kit. calib.txt holds P0..P3 of the rectified cameras and Tr, which takes the
LiDAR's points into the frame of rectified camera 0; times.txt one time a line, in seconds since the sequence's start.
"""

from pathlib import Path

import numpy as np

from auditor.errors import DecodingError, RecordingError
from auditor.model.optics.geometry import Matrix
from auditor.recordings.content import Contents, FileContent
from auditor.recordings.decoding.picture_heads import inspect_picture
from auditor.recordings.formats.datasets.kitti_raw import (
    CAMERAS,
    PERIOD_NS,
    SCAN_TOPIC,
    KittiCalibration,
    KittiRecording,
    numbered_files,
    picture_topic,
    read_matrices,
    read_small_text,
)
from auditor.recordings.formats.folders import Stream

_CALIBRATION_FILE = "calib.txt"
_TIMES_FILE = "times.txt"
_DATA_FOLDERS = ("image_0", "image_1", "image_2", "image_3", "velodyne")
_HEADER_BYTES = 64
_MAX_SECONDS = 10**6


class KittiOdometryReader:
    """Recognises a sequence's folder."""

    def detects(self, path: Path) -> bool:
        """True for a folder with calib.txt beside pictures or scans."""
        return (path / _CALIBRATION_FILE).is_file() and any((path / name).is_dir() for name in _DATA_FOLDERS)

    def open(self, path: Path) -> KittiRecording:
        """Open it. Raises RecordingError where its calibration or its times are ill-formed."""
        contents = Contents()
        stamps = _read_times(path / _TIMES_FILE, contents)
        files = {number: numbered_files(path / f"image_{int(number)}", "*.png") for number in CAMERAS}
        first = {number: contents.of(found[0][1]) for number, found in files.items() if found}
        calibration = _read_calibration(contents.of(path / _CALIBRATION_FILE), first)
        streams = [Stream(picture_topic(number), _entries(files[number], stamps)) for number in calibration.cameras]
        streams.append(Stream(SCAN_TOPIC, _entries(numbered_files(path / "velodyne", "*.bin"), stamps)))
        others = (path / _TIMES_FILE,) if stamps is not None else ()
        return KittiRecording(path, path, calibration, streams, others, "relative", contents)


def _entries(files: list[tuple[int, Path]], stamps: list[int] | None) -> tuple[tuple[int, Path], ...]:
    for number, file in files:
        if stamps is not None and number >= len(stamps):
            raise RecordingError(f"there is no time for file {number}", where=file.parent.parent / _TIMES_FILE)
    return tuple((number * PERIOD_NS if stamps is None else stamps[number], file) for number, file in files)


def _read_times(path: Path, contents: Contents) -> list[int] | None:
    """Nanoseconds by line; None where there is no such file."""
    if not path.is_file():
        return None
    try:
        seconds = [float(line) for line in read_small_text(contents.of(path)).split()]
    except ValueError as error:
        raise RecordingError(f"a time is ill-formed ({error})", where=path) from error
    if not all(0 <= second < _MAX_SECONDS for second in seconds):
        raise RecordingError("a time is not a time since the start", where=path)
    return [round(second * 10**9) for second in seconds]


def _read_calibration(content: FileContent, first_pictures: dict[str, FileContent]) -> KittiCalibration:
    values = read_matrices(content)
    cameras: dict[str, dict[str, Matrix]] = {}
    for number, picture in first_pictures.items():
        projection = values.get(f"P{int(number)}", np.empty(0))
        if projection.size == 12:
            # calib.txt does not hold the size of the pictures: the first picture does.
            cameras[number] = {"P_rect": projection, "S_rect": np.array(_size_px(picture), np.float64)}
    if not cameras:
        raise RecordingError("it holds no P0 to P3 of any camera that has pictures", where=content.path)
    lidar = values.get("Tr", np.empty(0))
    cam0_SE3_lidar = np.vstack([lidar.reshape(3, 4), [0, 0, 0, 1]]) if lidar.size == 12 else None
    return KittiCalibration((content.path,), cameras, cam0_SE3_lidar)


def _size_px(picture: FileContent) -> tuple[int, int]:
    with picture.open() as stream:
        head = stream.read(_HEADER_BYTES)
    try:
        return inspect_picture(memoryview(head)).size_px
    except DecodingError as error:
        raise RecordingError(error.what, where=picture.path) from error
