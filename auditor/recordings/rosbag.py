"""ROS 1 .bag files, and ROS 2 recordings (.db3 files and rosbag2 folders)."""

from collections.abc import Collection, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

from auditor.errors import RecordingError
from auditor.frames import Message
from auditor.recordings.bag_reading import BagRead
from auditor.recordings.damage_log import DamageLog
from auditor.recordings.db3_reading import Db3Read
from auditor.recordings.files_recording import FilesRecording
from auditor.recordings.interface import Recording
from auditor.recordings.labels import METADATA_TOPIC, label_from_dict, load_json
from auditor.recordings.mcap import McapRecording
from auditor.recordings.schemas import STRING
from auditor.results import AttackLabel

_ACTIVE = ".bag.active"
"""What a recorder calls a bag until it has closed it."""

FileRead = BagRead | Db3Read


class Ros1Reader:
    """Recognises .bag files."""

    def detects(self, path: Path) -> bool:
        """True for a file that is named so, also one that its recorder has not closed."""
        return path.name.lower().endswith((".bag", _ACTIVE)) and path.is_file()

    def open(self, path: Path) -> "RosbagRecording":
        """Open it. Raises RecordingError."""
        return RosbagRecording(path, (path,), BagRead)


class Ros2Reader:
    """Recognises .db3 files and rosbag2 folders."""

    def detects(self, path: Path) -> bool:
        """True for a .db3 file, and for a folder with metadata.yaml or .db3 files."""
        if path.is_dir():
            return bool(_storage_files(path)) and ((path / "metadata.yaml").is_file() or bool(_files(path, ".db3")))
        return path.suffix.lower() == ".db3" and path.is_file()

    def open(self, path: Path) -> Recording:
        """Open it; the order of a folder's files is that of their names. Raises RecordingError."""
        files = _storage_files(path) if path.is_dir() else (path,)
        if files[0].suffix.lower() == ".mcap":
            return McapRecording(path, files)
        # The files are opened one by one: metadata.yaml may be missing, or tell of files that are gone.
        return RosbagRecording(path, files, Db3Read)


def _files(folder: Path, suffix: str) -> tuple[Path, ...]:
    # "_10" comes after "_9": recorders number the files of a folder without leading zeros.
    found = (file for file in folder.iterdir() if file.suffix.lower() == suffix and file.is_file())
    return tuple(sorted(found, key=lambda file: (len(file.name), file.name)))


def _storage_files(folder: Path) -> tuple[Path, ...]:
    return _files(folder, ".db3") or _files(folder, ".mcap")


class RosbagRecording(FilesRecording):
    """The files of one ROS recording, read one after the other."""

    def __init__(self, path: Path, files: tuple[Path, ...], kind: type[BagRead] | type[Db3Read]) -> None:
        super().__init__(path, files)
        self._kind = kind
        self._unreadable: dict[Path, str] = {}
        for file in files:
            try:
                kind(file, None, self._names, DamageLog()).look()
            except RecordingError as error:
                self._unreadable[file] = error.what
        if len(self._unreadable) == len(files):
            what = next(iter(self._unreadable.values()))
            raise RecordingError(what, where=path, remedy="repair it with its recorder's own tools")
        if not self._names.topics:
            self._learn_from_beginning()

    def _read(self, topics: Collection[str] | None, damage: DamageLog) -> tuple[list[FileRead], Iterator[Message]]:
        readable = [file for file in self.files if file not in self._unreadable]
        reads: list[FileRead] = [self._kind(file, topics, self._names, damage) for file in readable]
        return reads, self._one_by_one(dict(zip(readable, reads, strict=True)), damage)

    def _one_by_one(self, reads: Mapping[Path, FileRead], damage: DamageLog) -> Iterator[Message]:
        for file in self.files:
            damage.file = file.name if len(self.files) > 1 else ""
            if file in reads:
                yield from reads[file].messages()
            else:
                damage.add(f"it cannot be read ({self._unreadable[file]})")

    def labels(self) -> tuple[AttackLabel, ...]:
        """Ground truth from the topic /auditor/metadata. Raises RecordingError where it is ill-formed."""
        try:
            return tuple(label_from_dict(entry) for entry in self._said.get("labels", ()))
        except (KeyError, TypeError, ValueError) as error:
            raise RecordingError(f"its ground truth is ill-formed ({error})", where=self.path) from error

    def metadata(self) -> Mapping[str, str]:
        """What the topic /auditor/metadata says."""
        said = self._said.get("metadata", {})
        return {str(name): str(value) for name, value in said.items()} if isinstance(said, dict) else {}

    @cached_property
    def _said(self) -> dict[str, Any]:
        said: dict[str, Any] = {}
        if METADATA_TOPIC not in {topic.name for topic in self.topics() if topic.schema == STRING}:
            return said
        for message in self._read([METADATA_TOPIC], DamageLog())[1]:
            # A std_msgs/String: its length, then its text; CDR has 4 bytes before it and a zero at its end.
            start = 4 if self._kind is BagRead else 8
            try:
                part = load_json(bytes(message.data[start:]).rstrip(b"\0"))
            except (ValueError, RecursionError) as error:
                raise RecordingError(f"its {METADATA_TOPIC} is ill-formed ({error})", where=self.path) from error
            said.update(part if isinstance(part, dict) else {})
        return said
