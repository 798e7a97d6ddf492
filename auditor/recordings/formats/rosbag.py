"""ROS 1 .bag files, and ROS 2 recordings (.db3 files and rosbag2 folders)."""

from collections.abc import Collection, Iterable, Mapping
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Any

from auditor.errors import RecordingError
from auditor.model.verdict import AttackLabel
from auditor.recordings.content import ChangedError
from auditor.recordings.formats.bag_metadata import METADATA, listed_and_there
from auditor.recordings.formats.files import NO_JOURNALS, FilesRecording, Streams
from auditor.recordings.formats.found import DamageLog
from auditor.recordings.formats.mcap import McapRecording
from auditor.recordings.formats.part_names import BAG, DB3, MCAP, file_kind, part_name
from auditor.recordings.formats.rosbag1 import BagRead
from auditor.recordings.formats.rosbag2 import Db3Read, journal_of
from auditor.recordings.formats.unpacking import Source, kind_of
from auditor.recordings.recording import METADATA_TOPIC, Recording, label_from_dict, load_json
from auditor.recordings.schemas import STRING

_ACTIVE = ".bag.active"
"""The ending of a bag's name until its recorder has closed it."""


class Ros1Reader:
    """Recognises .bag files."""

    def detects(self, path: Path) -> bool:
        """True for a file with that extension, also one that its recorder has not closed."""
        return path.name.lower().endswith((".bag", _ACTIVE)) and path.is_file()

    def open(self, path: Path) -> "RosbagRecording":
        """Open it. Raises RecordingError."""
        return RosbagRecording(path, ((path,),), BagRead)


class Ros2Reader:
    """Recognises .db3 files, rosbag2 folders, and files that rosbag2 compressed."""

    def detects(self, path: Path) -> bool:
        """True for a .db3 file, or a packed one or .mcap, and for a folder that is one recording, see folder_files."""
        if path.is_dir():
            return bool(folder_files(path))
        return kind_of(path) in {".db3", ".mcap"} and path.is_file()

    def open(self, path: Path) -> Recording:
        """Open it; the files of a folder are in the order of their names. Raises RecordingError."""
        files = folder_files(path) if path.is_dir() else (path,)
        if kind_of(files[0]) == ".mcap":
            return McapRecording(path, (files,))
        # The files are opened one by one: metadata.yaml may be missing, or name files that are missing.
        return RosbagRecording(path, (files,), Db3Read)


def open_streams(path: Path, streams: Streams) -> Recording:
    """Open files of one kind as one recording. Raises RecordingError where none of them can be read."""
    kind = file_kind(streams[0][0])
    if kind == MCAP:
        return McapRecording(path, streams)
    return RosbagRecording(path, streams, BagRead if kind == BAG else Db3Read)


def folder_files(folder: Path) -> tuple[Path, ...]:
    """The files that are the recording of a rosbag2 folder, in order; none where it is no such folder.

    They are those that its metadata.yaml lists and the other parts of their series, which a recorder that was killed
    has not listed. A list that names none of the files says nothing. A folder without it is one recording where it
    holds no folder, and of recordings the .db3 files of one series alone.
    """
    entries = [entry for entry in folder.iterdir() if not entry.name.startswith(".")]
    files = [entry for entry in entries if file_kind(entry) and entry.is_file()]
    if (folder / METADATA).is_file():
        files = [file for file in files if file_kind(file) != BAG]
        series = {_series(file) for file in listed_and_there(files)}
        files = [file for file in files if _series(file) in series] or files
        first = min((file_kind(file) for file in files), default="")  # .db3 before .mcap
        files = [file for file in files if file_kind(file) == first]
    elif (
        {file_kind(file) for file in files} != {DB3}
        or len({_series(file) for file in files}) > 1
        or any(entry.is_dir() for entry in entries)
    ):
        return ()
    # "_10" comes after "_9": recorders number the files of a folder without leading zeros.
    return tuple(sorted(files, key=lambda file: (len(file.name), file.name)))


def _series(file: Path) -> object:
    """What the parts of one drive have in common by their names; a file without a number is one by itself."""
    name = part_name(file)
    return name.key if name else file


def _journals(files: Iterable[Path]) -> Mapping[Path, Path]:
    """The write-ahead logs by the files that they belong to."""
    return {file: journal for file in files if (journal := journal_of(file)) is not None}


class RosbagRecording(FilesRecording):
    """The files of one ROS recording."""

    def __init__(self, path: Path, streams: Streams, kind: type[BagRead] | type[Db3Read]) -> None:
        super().__init__(path, streams, _journals(chain.from_iterable(streams)) if kind is Db3Read else NO_JOURNALS)
        self._kind = kind
        for source in self._sources:
            try:
                kind(source, None, self._names, DamageLog()).learn_topics()
            except ChangedError:
                self.close()
                raise
            except RecordingError as error:
                self._unreadable[source] = source.problem or error.what
        self._refuse_unreadable("repair it with its recorder's own tools")
        if not self._names.topics:
            self._learn_from_beginning()

    def _file_read(self, source: Source, topics: Collection[str] | None, damage: DamageLog) -> BagRead | Db3Read:
        return self._kind(source, topics, self._names, damage)

    def labels(self) -> tuple[AttackLabel, ...]:
        """Ground truth from the topic /auditor/metadata. Raises RecordingError where it is ill-formed."""
        try:
            return tuple(label_from_dict(entry) for entry in self._carried.get("labels", ()))
        except (KeyError, TypeError, ValueError) as error:
            raise RecordingError(f"its ground truth is ill-formed ({error})", where=self.path) from error

    def metadata(self) -> Mapping[str, str]:
        """The metadata from the topic /auditor/metadata."""
        declared = self._carried.get("metadata", {})
        return {str(name): str(value) for name, value in declared.items()} if isinstance(declared, dict) else {}

    @cached_property
    def _carried(self) -> dict[str, Any]:
        declared: dict[str, Any] = {}
        if METADATA_TOPIC not in {topic.name for topic in self.topics() if topic.schema == STRING}:
            return declared
        for message in self._read([METADATA_TOPIC], DamageLog())[1]:
            # A std_msgs/String: its length, then its text; CDR has 4 bytes before it and a zero at its end.
            start = 4 if self._kind is BagRead else 8
            try:
                part = load_json(bytes(message.data[start:]).rstrip(b"\0"))
            except (ValueError, RecursionError) as error:
                raise RecordingError(f"its {METADATA_TOPIC} is ill-formed ({error})", where=self.path) from error
            declared.update(part if isinstance(part, dict) else {})
        return declared
