"""MCAP recordings, read forward within bounds: chunked or not, whole or cut, with an index or without."""

from collections.abc import Collection, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Self, cast

from mcap.records import Metadata

from auditor.errors import RecordingError
from auditor.frames import Message
from auditor.recordings.channels import total_counts
from auditor.recordings.content import content_id
from auditor.recordings.damage_log import DamageLog
from auditor.recordings.interface import CLOCKS, EARLIEST_UTC_NS, Clock, Damage, Definition, Topic
from auditor.recordings.labels import LABELS_NAME, METADATA_NAME, labels_from_json
from auditor.recordings.mcap_reading import FileRead, attached_to
from auditor.recordings.mcap_stream import MAGIC, read_ending
from auditor.recordings.names import Names
from auditor.results import AttackLabel

_PEEK_BYTES = 32 * 2**20


class McapReader:
    """Recognises .mcap files."""

    def detects(self, path: Path) -> bool:
        """True for a file that is named so."""
        return path.suffix.lower() == ".mcap" and path.is_file()

    def open(self, path: Path) -> "McapRecording":
        """Open it. Raises RecordingError where it does not begin as an MCAP file does."""
        return McapRecording(path, (path,))


class McapRecording:
    """One MCAP file, or the files of a rosbag2 folder in their order. See interface.Recording."""

    def __init__(self, path: Path, files: tuple[Path, ...]) -> None:
        self.path = path
        self.files = files
        self._names = Names()
        self._damage = DamageLog()
        self._reads: list[FileRead] = []
        for file in files:
            with file.open("rb") as stream:
                if stream.read(len(MAGIC)) != MAGIC:
                    raise RecordingError(
                        "this is no MCAP file, or one cut at its very start",
                        where=file,
                        remedy="check how it was copied, or give its true ending",
                    )
        self._look()

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
        """sha256 (hex) of the content."""
        return content_id(self.path, self.files)

    @cached_property
    def clock(self) -> Clock:
        """What the file says of its own clock, else a guess from its first log time."""
        said = self.metadata().get("clock")
        if said in CLOCKS:
            return cast("Clock", said)
        first = next(self._read(None, DamageLog())[1], None)
        if first is None:
            return "unknown"
        return "utc" if first.log_time_ns >= EARLIEST_UTC_NS else "relative"

    @property
    def counts(self) -> Mapping[str, int]:
        """Messages met by the last read, by topic."""
        return total_counts(self._names, [read.channels for read in self._reads])

    @property
    def damage(self) -> tuple[Damage, ...]:
        """What the last read could not read."""
        return self._damage.entries

    def topics(self) -> tuple[Topic, ...]:
        """Those of the summaries, those at the beginning, and those met while reading."""
        return tuple(topic for _, topic in sorted(self._names.topics.items()))

    def definition(self, schema: str) -> Definition | None:
        """The first definition met under that name."""
        return self._names.definitions.get(schema)

    def messages(self, topics: Collection[str] | None = None) -> Iterator[Message]:
        """Every message in file order, CRCs checked, at most one chunk in memory."""
        self._damage = DamageLog()
        self._reads, stream = self._read(topics, self._damage)
        return stream

    def _read(self, topics: Collection[str] | None, damage: DamageLog) -> tuple[list[FileRead], Iterator[Message]]:
        reads = [FileRead(file, topics, self._names, damage) for file in self.files]
        return reads, self._one_by_one(reads, damage)

    def _one_by_one(self, reads: list[FileRead], damage: DamageLog) -> Iterator[Message]:
        for file, read in zip(self.files, reads, strict=True):
            damage.file = file.name if len(self.files) > 1 else ""
            yield from read.messages()

    def _look(self) -> None:
        """Learn topics: from the summaries where there are any, else from the beginning."""
        for file in self.files:
            with file.open("rb") as stream:
                ending = read_ending(stream, file.stat().st_size)
            if ending:
                FileRead(file, None, self._names, DamageLog()).learn_summary(ending.summary)
        if not self._names.topics:
            seen = 0
            for message in self._read(None, DamageLog())[1]:
                seen += len(message.data)
                if seen > _PEEK_BYTES:
                    break

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
        for file in self.files:
            for attached in attached_to(file):
                if isinstance(attached, Metadata):
                    metadata.update(attached.metadata if attached.name == METADATA_NAME else {})
                elif attached.name == LABELS_NAME:
                    labels.extend(labels_from_json(attached.data, file))
        return tuple(labels), metadata
