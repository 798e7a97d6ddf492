"""KITTI raw drives, read as they were published: synced and rectified, `<date>/<date>_drive_<number>_sync`.

Format: the KITTI raw data development kit. Every picture and scan is a message with the file's bytes; its stamp stands
in timestamps.txt on the line of its number (files may be missing). The times carry no zone: the clock is unknown.
Calibration files, beside a drive's folder or in it, are lines of a name and its numbers in all of KITTI's data sets.
"""

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np

from auditor.errors import RecordingError
from auditor.model.frames import Message
from auditor.model.optics.geometry import Matrix, camera_centre, motion
from auditor.recordings.content import Contents, FileContent
from auditor.recordings.decoding.kitti import CALIBRATION, LIDAR_FRAME, OXTS, PICTURE, SCAN, TRANSFORMS, camera_frame
from auditor.recordings.formats.folders import FolderRecording, Stream
from auditor.recordings.recording import Clock, Topic

CAMERAS = {"00": "camera_gray_left", "01": "camera_gray_right", "02": "camera_color_left", "03": "camera_color_right"}

_CAMERA_FILE = "calib_cam_to_cam.txt"
_LIDAR_FILE = "calib_velo_to_cam.txt"
_TIMES_FILE = "timestamps.txt"
_MAX_TEXT_BYTES = 16 * 2**20


class KittiCalibration(NamedTuple):
    """P_rect and S_rect by camera number, and the LiDAR in the frame of rectified camera 0."""

    files: tuple[Path, ...]
    cameras: Mapping[str, Mapping[str, Matrix]]
    cam0_SE3_lidar: Matrix | None

    def transforms(self) -> list[dict[str, object]]:
        """The places of cameras and LiDAR in the frame of rectified camera 0, whether or not it has pictures."""
        children = {
            CAMERAS[number]: motion(np.eye(3), camera_centre(camera["P_rect"].reshape(3, 4)))
            for number, camera in self.cameras.items()
        }
        parent = CAMERAS["00"]
        if self.cam0_SE3_lidar is not None:
            children[LIDAR_FRAME] = self.cam0_SE3_lidar
        return [
            {"parent": parent, "child": child, "parent_SE3_child": matrix.tolist()}
            for child, matrix in children.items()
            if child != parent
        ]


def read_calibration(drive: Path, contents: Contents) -> KittiCalibration:
    """The calibration of a raw drive. Raises RecordingError where it is missing or ill-formed."""
    folder = next(
        (folder for folder in (drive, drive / "calib", drive.parent) if (folder / _CAMERA_FILE).is_file()), None
    )
    if folder is None:
        raise RecordingError(f"{_CAMERA_FILE} is missing", where=drive, remedy="put it beside the drive's folder")
    values = read_matrices(contents.of(folder / _CAMERA_FILE))
    cameras = {
        number: {"P_rect": values[f"P_rect_{number}"], "S_rect": values[f"S_rect_{number}"]}
        for number in CAMERAS
        if values.get(f"P_rect_{number}", np.empty(0)).size == 12
        and values.get(f"S_rect_{number}", np.empty(0)).size == 2
    }
    if not cameras:
        raise RecordingError("it holds no P_rect and S_rect of any camera", where=folder / _CAMERA_FILE)
    files = [folder / _CAMERA_FILE]
    cam0_SE3_lidar = None
    if (folder / _LIDAR_FILE).is_file():
        files.append(folder / _LIDAR_FILE)
        lidar = read_matrices(contents.of(folder / _LIDAR_FILE))
        try:
            unrectified = motion(lidar["R"].reshape(3, 3), lidar["T"])
            cam0_SE3_lidar = motion(values["R_rect_00"].reshape(3, 3), np.zeros(3)) @ unrectified
        except (KeyError, ValueError) as error:
            raise RecordingError(f"R, T or R_rect_00 is ill-formed ({error})", where=folder / _LIDAR_FILE) from error
    return KittiCalibration(tuple(files), cameras, cam0_SE3_lidar)


def read_small_text(content: FileContent) -> str:
    """A calibration or time file. Raises RecordingError where it is too large to be one."""
    if content.size > _MAX_TEXT_BYTES:
        raise RecordingError(f"it has more than {_MAX_TEXT_BYTES} bytes", where=content.path)
    return content.read().decode("utf-8", "replace")


def read_matrices(content: FileContent) -> dict[str, Matrix]:
    """The numbers of every `name: numbers` line."""
    matrices = {}
    for line in read_small_text(content).splitlines():
        name, _, values = line.partition(":")
        try:
            matrices[name.strip()] = np.array([float(value) for value in values.split()])
        except ValueError:
            continue  # dates and other text
    return matrices


LIDAR_TOPIC = "/kitti/velo/pointcloud"
TRANSFORMS_TOPIC = "/tf_static"

PERIOD_NS = 10**8
"""Between frames of a drive without timestamps."""

SCAN_TOPIC = Topic(LIDAR_TOPIC, SCAN, "bin")
OXTS_TOPIC = Topic("/kitti/oxts", OXTS, "txt")
_NUMBER = re.compile(r"[0-9]{1,12}")

_DRIVE_BELOW = ("*_sync", "[0-9]*_[0-9]*_[0-9]*/*_sync")
"""Patterns of the drives in a date's folder, and in a folder with such folders."""


class KittiReader:
    """Recognises a drive's folder, and folders around it that hold no other drive."""

    def detects(self, path: Path) -> bool:
        """True where exactly one drive lies at the path, or one or two folders below it."""
        return path.is_dir() and len(_drives(path)) == 1

    def open(self, path: Path) -> "KittiRecording":
        """Open it. Raises RecordingError where its calibration is missing or ill-formed."""
        [folder, *_], contents = _drives(path), Contents()
        calibration = read_calibration(folder, contents)
        streams = [
            Stream(picture_topic(number), tuple(files_by_stamp(folder / f"image_{number}", "*.png", contents)))
            for number in CAMERAS
            if number in calibration.cameras
        ]
        streams.append(Stream(SCAN_TOPIC, tuple(files_by_stamp(folder / "velodyne_points", "*.bin", contents))))
        _refuse_some_without_times(folder)
        others = folder.glob(f"*/{_TIMES_FILE}")
        places = (Stream(OXTS_TOPIC, tuple(_places(folder / "oxts", contents))),)
        # The times are written without a zone, or not at all.
        return KittiRecording(path, folder, calibration, streams, others, "unknown", contents, places)


def _refuse_some_without_times(folder: Path) -> None:
    """Raises RecordingError where some sensors have times and another has none: they would be years apart."""
    timed = {data.parent: (data.parent / _TIMES_FILE).is_file() for data in sorted(folder.glob("[iv]*_*/data"))}
    if any(timed.values()) and not all(timed.values()):
        without = next(sensor for sensor, there in timed.items() if not there)
        raise RecordingError(
            "it is missing, and other sensors of the drive have theirs",
            where=without / _TIMES_FILE,
            remedy=f"put it back, or take {without.name} out of the drive",
        )


def _is_drive(path: Path) -> bool:
    return (path / "velodyne_points" / "data").is_dir() or any(path.glob("image_0[0-3]/data"))


def _drives(path: Path) -> list[Path]:
    if _is_drive(path):
        return [path]
    return [folder for pattern in _DRIVE_BELOW for folder in sorted(path.glob(pattern)) if _is_drive(folder)]


class KittiRecording(FolderRecording):
    """One KITTI drive or sequence; `places` are the files of its GPS."""

    def __init__(
        self,
        path: Path,
        folder: Path,
        calibration: KittiCalibration,
        streams: Sequence[Stream],
        others: Iterable[Path],
        clock: Clock,
        contents: Contents,
        places: Sequence[Stream] = (),
    ) -> None:
        super().__init__(path, folder, streams, (*others, *calibration.files), clock, contents, places)
        self._calibration = calibration

    def _fixed_messages(self) -> Iterator[Message]:
        stamp_ns = min(stream.entries[0][0] for stream in self._streams)
        there = {camera_frame(stream.topic.name) for stream in self._streams if stream.topic.schema == PICTURE}
        transforms = self._calibration.transforms()
        data = json.dumps([entry for entry in transforms if entry["child"] in there | {LIDAR_FRAME}]).encode()
        yield Message(TRANSFORMS_TOPIC, TRANSFORMS, "json", stamp_ns, data)
        for number, camera in self._calibration.cameras.items():
            if CAMERAS[number] in there:
                data = json.dumps({name: values.tolist() for name, values in camera.items()}).encode()
                yield Message(f"/kitti/{CAMERAS[number]}/camera_info", CALIBRATION, "json", stamp_ns, data)


def picture_topic(number: str) -> Topic:
    """The topic of a camera, '00' to '03'."""
    return Topic(f"/kitti/{CAMERAS[number]}/image_rect", PICTURE, "png")


def numbered_files(folder: Path, pattern: str) -> list[tuple[int, Path]]:
    """Data files and their numbers, in order."""
    return sorted((int(file.stem), file) for file in folder.glob(pattern) if _NUMBER.fullmatch(file.stem))


def files_by_stamp(folder: Path, pattern: str, contents: Contents, within: str = "data") -> Iterator[tuple[int, Path]]:
    """Stamp and path of every data file, by number."""
    numbered = numbered_files(folder / within, pattern)
    stamps = _read_stamps(folder / _TIMES_FILE, contents)
    for number, file in numbered:
        if stamps is None:
            yield number * PERIOD_NS, file
        elif number < len(stamps) and stamps[number] is not None:
            yield stamps[number] or 0, file
        else:
            raise RecordingError(f"there is no time for file {number}", where=folder / _TIMES_FILE)


def _places(folder: Path, contents: Contents) -> Iterator[tuple[int, Path]]:
    """Stamp and path of the files of places; without a time a place is of no use, and no reason to read nothing."""
    try:
        stamps = _read_stamps(folder / _TIMES_FILE, contents) or []
    except RecordingError:
        return
    for number, file in numbered_files(folder / "data", "*.txt"):
        stamp_ns = stamps[number] if number < len(stamps) else None
        if stamp_ns is not None:
            yield stamp_ns, file


def _read_stamps(path: Path, contents: Contents) -> list[int | None] | None:
    """Nanoseconds since 1970 by line; None for an empty line (never recorded); None where there is no such file."""
    if not path.is_file():
        return None
    try:
        return [_parse_time(line.strip()) for line in read_small_text(contents.of(path)).splitlines()]
    except ValueError as error:
        raise RecordingError(f"a time is ill-formed ({error})", where=path) from error


def _parse_time(text: str) -> int | None:
    if not text:
        return None
    seconds, _, fraction = text.partition(".")
    moment = datetime.strptime(seconds, "%Y-%m-%d %H:%M:%S").replace(tzinfo=UTC)
    return int(moment.timestamp()) * 10**9 + int(fraction.ljust(9, "0")[:9] or "0")
