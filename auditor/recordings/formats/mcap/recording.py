"""MCAP recordings: one file or several, chunked or not, whole or cut, with an index or without."""

from collections.abc import Collection, Mapping, Sequence
from functools import cached_property
from pathlib import Path

from mcap.records import Metadata

from auditor.model.verdict import AttackLabel
from auditor.recordings.formats.damage import DamageLog
from auditor.recordings.formats.files import FilesRecording, Streams
from auditor.recordings.formats.mcap.reader import McapRead, attached_in_summary, attached_to
from auditor.recordings.formats.mcap.records import MAGIC, Record, read_ending
from auditor.recordings.formats.unpacking import Source
from auditor.recordings.recording import LABELS_NAME, METADATA_NAME, labels_from_json


class McapReader:
    """Recognises .mcap files."""

    def detects(self, path: Path) -> bool:
        """True for a file with that extension."""
        return path.suffix.lower() == ".mcap" and path.is_file()

    def open(self, path: Path) -> "McapRecording":
        """Open it. Raises RecordingError where it does not begin as an MCAP file does."""
        return McapRecording(path, ((path,),))


class McapRecording(FilesRecording):
    """One MCAP file or several; CRCs are checked, one chunk of a stream is in memory."""

    def __init__(self, path: Path, streams: Streams) -> None:
        super().__init__(path, streams)
        self._attached: dict[Source, Sequence[Record]] = {}
        self._listed: dict[Source, Sequence[Record]] = {}
        for source in self._sources:
            with source.open() as stream:
                if stream.read(len(MAGIC)) != MAGIC:
                    self._unreadable[source] = source.problem or "this is not an MCAP file, or its beginning is cut"
        self._refuse_unreadable("check how it was copied, or give the file its correct extension")
        self._learn_topics()

    def _file_read(self, source: Source, topics: Collection[str] | None, damage: DamageLog) -> McapRead:
        return McapRead(source, topics, self._names, damage, self._attached)

    def _learn_topics(self) -> None:
        """Learn topics from the summaries where there are any, else from the beginning."""
        for source in self._sources:
            with source.open() as stream:
                ending = read_ending(stream, source.size)
            if ending:
                McapRead(source, None, self._names, DamageLog()).learn_summary(ending.summary)
                self._listed[source] = attached_in_summary(ending.summary)
        if not self._names.topics:
            self._learn_from_beginning()

    def labels(self) -> tuple[AttackLabel, ...]:
        """Ground truth from the attachments named auditor-labels.json. Raises RecordingError where ill-formed."""
        return self._extras[0]

    def metadata(self) -> Mapping[str, str]:
        """The metadata record named 'auditor'."""
        return self._extras[1]

    def calibrations(self) -> Mapping[str, str]:
        """Attachments of YAML and JSON, and metadata's values of several lines, that its files' summaries list."""
        found: dict[str, str] = {}
        for source in self._sources:
            for attached in attached_to(source, self._listed.get(source, ())):
                if isinstance(attached, Metadata):
                    texts = {f"{attached.name} {key}": text for key, text in attached.metadata.items() if "\n" in text}
                    found.update(texts)
                elif attached.name.lower().endswith((".yaml", ".yml", ".json")):
                    found[attached.name] = attached.data.decode("utf-8", "replace")
        return found

    @cached_property
    def _extras(self) -> tuple[tuple[AttackLabel, ...], Mapping[str, str]]:
        labels: list[AttackLabel] = []
        metadata: dict[str, str] = {}
        for source in self._sources:
            if source in self._unreadable:
                continue
            for attached in attached_to(source, self._attached.get(source)):
                if isinstance(attached, Metadata):
                    metadata.update(attached.metadata if attached.name == METADATA_NAME else {})
                elif attached.name == LABELS_NAME:
                    labels.extend(labels_from_json(attached.data, self.path))
        return tuple(labels), metadata
