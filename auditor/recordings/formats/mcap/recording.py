"""MCAP recordings: one file or several, chunked or not, whole or cut, with an index or without."""

from collections.abc import Collection, Iterator, Mapping
from functools import cached_property
from pathlib import Path

from mcap.records import Metadata

from auditor.errors import RecordingError
from auditor.model.frames import Message
from auditor.model.verdict import AttackLabel
from auditor.recordings.formats.damage import DamageLog
from auditor.recordings.formats.files import FilesRecording
from auditor.recordings.formats.mcap.reader import FileRead, attached_to
from auditor.recordings.formats.mcap.records import MAGIC, read_ending
from auditor.recordings.recording import LABELS_NAME, METADATA_NAME, labels_from_json


class McapReader:
    """Recognises .mcap files."""

    def detects(self, path: Path) -> bool:
        """True for a file with that extension."""
        return path.suffix.lower() == ".mcap" and path.is_file()

    def open(self, path: Path) -> "McapRecording":
        """Open it. Raises RecordingError where it does not begin as an MCAP file does."""
        return McapRecording(path, (path,))


class McapRecording(FilesRecording):
    """One MCAP file, or the files of a rosbag2 folder in their order; CRCs are checked, one chunk is in memory."""

    def __init__(self, path: Path, files: tuple[Path, ...]) -> None:
        super().__init__(path, files)
        for file, source in zip(files, self._sources, strict=True):
            with source.open() as stream:
                if stream.read(len(MAGIC)) != MAGIC:
                    self.close()
                    raise RecordingError(
                        source.problem or "this is not an MCAP file, or its beginning is cut",
                        where=file,
                        remedy="check how it was copied, or give the file its correct extension",
                    )
        self._learn_topics()

    def _read(self, topics: Collection[str] | None, damage: DamageLog) -> tuple[list[FileRead], Iterator[Message]]:
        reads = [FileRead(source, topics, self._names, damage) for source in self._sources]
        return reads, self._one_by_one(reads, damage)

    def _one_by_one(self, reads: list[FileRead], damage: DamageLog) -> Iterator[Message]:
        for source, read in zip(self._sources, reads, strict=True):
            self._begin(source, damage)
            yield from read.messages()

    def _learn_topics(self) -> None:
        """Learn topics from the summaries where there are any, else from the beginning."""
        for source in self._sources:
            with source.open() as stream:
                ending = read_ending(stream, source.size)
            if ending:
                FileRead(source, None, self._names, DamageLog()).learn_summary(ending.summary)
        if not self._names.topics:
            self._learn_from_beginning()

    def labels(self) -> tuple[AttackLabel, ...]:
        """Ground truth from the attachments named auditor-labels.json. Raises RecordingError where ill-formed."""
        return self._extras[0]

    def metadata(self) -> Mapping[str, str]:
        """The metadata record named 'auditor'."""
        return self._extras[1]

    @cached_property
    def _extras(self) -> tuple[tuple[AttackLabel, ...], Mapping[str, str]]:
        labels: list[AttackLabel] = []
        metadata: dict[str, str] = {}
        for source in self._sources:
            for attached in attached_to(source):
                if isinstance(attached, Metadata):
                    metadata.update(attached.metadata if attached.name == METADATA_NAME else {})
                elif attached.name == LABELS_NAME:
                    labels.extend(labels_from_json(attached.data, self.path))
        return tuple(labels), metadata
