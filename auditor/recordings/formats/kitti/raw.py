"""KITTI raw drives, read as they were published: synced and rectified, `<date>/<date>_drive_<number>_sync`.

Format: the KITTI raw data development kit. Every picture and scan is a message with the file's bytes; its stamp stands
in timestamps.txt on the line of its number (files may be missing). The times carry no zone: the clock is unknown.
"""

import json
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from functools import cached_property
from itertools import chain
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

from auditor.errors import RecordingError
from auditor.model.frames import Message
from auditor.model.verdict import AttackLabel
from auditor.recordings.content import Contents
from auditor.recordings.decoding.kitti import CALIBRATION, LIDAR_FRAME, OXTS, PICTURE, SCAN, TRANSFORMS, camera_frame
from auditor.recordings.formats.kitti.calibration import CAMERAS, Calibration, read_calibration, read_small_text
from auditor.recordings.recording import Clock, Damage, Definition, Topic, Traffic
from auditor.safety.budget import MAX_BYTES

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
            Stream(picture_topic(number), tuple(_entries(folder / f"image_{number}", "*.png", contents)))
            for number in CAMERAS
            if number in calibration.cameras
        ]
        streams.append(Stream(SCAN_TOPIC, tuple(_entries(folder / "velodyne_points", "*.bin", contents))))
        others = folder.glob("*/timestamps.txt")
        places = Stream(OXTS_TOPIC, tuple(_places(folder / "oxts", contents)))
        # The times are written without a zone, or not at all.
        return KittiRecording(path, folder, calibration, streams, others, "unknown", contents, places)


def _is_drive(path: Path) -> bool:
    return (path / "velodyne_points" / "data").is_dir() or any(path.glob("image_0[0-3]/data"))


def _drives(path: Path) -> list[Path]:
    if _is_drive(path):
        return [path]
    return [folder for pattern in _DRIVE_BELOW for folder in sorted(path.glob(pattern)) if _is_drive(folder)]


class Stream(NamedTuple):
    """The files of one sensor with their stamps, in order."""

    topic: Topic
    entries: tuple[tuple[int, Path], ...]


NO_PLACES = Stream(OXTS_TOPIC, ())


class KittiRecording:
    """One KITTI drive or sequence. See recording.Recording.

    `others` are the files with stamps, and `contents` has what was read of the folder. `places` are the files of its
    GPS. They are no part of its id: they decide nothing that is counted.
    """

    def __init__(
        self,
        path: Path,
        folder: Path,
        calibration: Calibration,
        streams: Sequence[Stream],
        others: Iterable[Path],
        clock: Clock,
        contents: Contents,
        places: Stream = NO_PLACES,
    ) -> None:
        self.path = path
        self.clock: Clock = clock
        self._drive = folder
        self._calibration = calibration
        self.damage: tuple[Damage, ...] = ()
        self._counts: dict[str, int] = {}
        self._streams = tuple(stream for stream in streams if stream.entries)
        self._places = places
        if not self._streams:
            raise RecordingError("the drive holds no pictures and no scans", where=path)
        data = (file for stream in self._streams for _, file in stream.entries)
        self.files = tuple(sorted(chain(data, others, calibration.files)))
        self._contents = contents
        for file in self.files:
            contents.of(file)  # as it is now: what changes from here on is found

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Nothing stays open between reads."""

    @cached_property
    def recording_id(self) -> str:
        """The hash of its files; what nobody has read of them is read. Raises RecordingError."""
        # Calibration files may lie beside the drive's folder: paths are relative to the folder that holds all.
        folder = self._drive
        top = folder if all(folder in file.parents for file in self.files) else folder.parent
        return self._contents.recording_id(top, self.files)

    def check_unchanged(self) -> None:
        """Raise ChangedError where a file is not what it was when it was opened."""
        self._contents.check_unchanged()

    @property
    def counts(self) -> Mapping[str, int]:
        """Messages found by the last read, by topic."""
        return self._counts

    @property
    def traffic(self) -> Mapping[Topic, Traffic]:
        """Messages found by the last read, by topic; their bytes are not counted, for all types are known."""
        return {topic: Traffic(self._counts.get(topic.name, 0)) for topic in self.topics()}

    def topics(self) -> tuple[Topic, ...]:
        """The topics that have files."""
        topics = [stream.topic for stream in (*self._streams, self._places) if stream.entries]
        topics += [Topic(message.topic, message.schema, message.encoding) for message in self._calibration_messages()]
        return tuple(sorted(topics, key=lambda topic: topic.name))

    def definition(self, schema: str) -> Definition | None:  # noqa: ARG002  # given by the protocol
        """None: KITTI's formats are defined by its development kit."""
        return None

    def labels(self) -> tuple[AttackLabel, ...]:
        """None."""
        return ()

    def metadata(self) -> Mapping[str, str]:
        """The drive's name."""
        return {"drive": self._drive.name}

    def messages(self, topics: Collection[str] | None = None) -> Iterator[Message]:
        """Calibration first, then pictures and scans in the order of their stamps."""
        self._counts = dict.fromkeys((topic.name for topic in self.topics()), 0)
        self.damage = ()
        return self._read(None if topics is None else frozenset(topics), self._counts)

    def _read(self, wanted: frozenset[str] | None, counts: dict[str, int]) -> Iterator[Message]:
        for message in self._calibration_messages():
            counts[message.topic] += 1
            if wanted is None or message.topic in wanted:
                yield message
        for stamp_ns, topic, file in self._in_order():
            counts[topic.name] += 1
            if wanted is None or topic.name in wanted:
                data = self._place(file) if topic == OXTS_TOPIC else self._data(file)
                yield Message(topic.name, topic.schema, topic.encoding, stamp_ns, data)

    def _place(self, file: Path) -> bytes:
        """The bytes of a file of places; none where it cannot be read, which is no damage of what is measured."""
        try:
            content = self._contents.of(file)
            return content.read() if content.size <= MAX_BYTES else b""
        except (OSError, RecordingError):
            return b""

    def _data(self, file: Path) -> bytes:
        """The bytes of a file; none, noting the damage, where it cannot be read: its message is then damaged."""
        try:
            content = self._contents.of(file)
            if content.size <= MAX_BYTES:
                return content.read()
            self.damage += (Damage(f"it has more than {MAX_BYTES} bytes", file=file.name),)
        except OSError as error:
            self.damage += (Damage(f"it cannot be read ({error.strerror})", file=file.name),)
        return b""

    def _in_order(self) -> list[tuple[int, Topic, Path]]:
        streams = (*self._streams, self._places)
        entries = [(stamp_ns, stream.topic, file) for stream in streams for stamp_ns, file in stream.entries]
        return sorted(entries, key=lambda entry: (entry[0], entry[1].name))

    def _calibration_messages(self) -> Iterator[Message]:
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


def _entries(folder: Path, pattern: str, contents: Contents) -> Iterator[tuple[int, Path]]:
    """Stamp and path of every data file, by number."""
    numbered = numbered_files(folder / "data", pattern)
    stamps = _read_stamps(folder / "timestamps.txt", contents)
    for number, file in numbered:
        if stamps is None:
            yield number * PERIOD_NS, file
        elif number < len(stamps) and stamps[number] is not None:
            yield stamps[number] or 0, file
        else:
            raise RecordingError(f"there is no time for file {number}", where=folder / "timestamps.txt")


def _places(folder: Path, contents: Contents) -> Iterator[tuple[int, Path]]:
    """Stamp and path of the files of places; without a time a place is of no use, and no reason to read nothing."""
    try:
        stamps = _read_stamps(folder / "timestamps.txt", contents) or []
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
