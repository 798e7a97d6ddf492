"""The base of MCAP and ROS recordings: one file or several, read forward one after the other."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self, cast

from auditor.model.frames import Message
from auditor.model.verdict import AttackLabel
from auditor.recordings.formats.damage import DamageLog
from auditor.recordings.formats.topics import Channels, Names, total_counts
from auditor.recordings.formats.unpacking import Source, source_of
from auditor.recordings.recording import CLOCKS, EARLIEST_UTC_NS, Clock, Damage, Definition, Topic, content_id

_PEEK_BYTES = 32 * 2**20
_RECORD_BYTES = 64  # added to the size of each message: empty ones take work, too


class FileRead(Protocol):
    """One forward read of one file."""

    @property
    def channels(self) -> Channels:
        """The channels found so far, with their counts."""

    def messages(self) -> Iterator[Message]:
        """Every message of the requested topics, in file order."""


class FilesRecording(ABC):
    """Every read begins at the start; only unpacked content is held between reads. See recording.Recording.

    `files` are read one after the other, `journals` beside them; both are the recording's content.
    """

    def __init__(self, path: Path, files: tuple[Path, ...], journals: tuple[Path, ...] = ()) -> None:
        self.path = path
        self.files = (*files, *journals)
        self._sources = tuple(source_of(file) for file in files)
        self._names = Names()
        self._topics: tuple[Topic, ...] = ()
        self._damage = DamageLog()
        self._reads: Sequence[FileRead] = ()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Free the unpacked content."""
        for source in self._sources:
            source.close()

    @cached_property
    def recording_id(self) -> str:
        """sha256 (hex) of the content."""
        return content_id(self.path, self.files)

    @cached_property
    def clock(self) -> Clock:
        """The clock that the recording's metadata declares, else a guess from its first log time."""
        declared = self.metadata().get("clock")
        if declared in CLOCKS:
            return cast("Clock", declared)
        first = next(self._read(None, DamageLog())[1], None)
        if first is None:
            return "unknown"
        return "utc" if first.log_time_ns >= EARLIEST_UTC_NS else "relative"

    @property
    def counts(self) -> Mapping[str, int]:
        """Messages found by the last read, by topic."""
        return total_counts(self._names, [read.channels for read in self._reads])

    @property
    def damage(self) -> tuple[Damage, ...]:
        """The parts that the last read could not read."""
        return self._damage.entries

    def topics(self) -> tuple[Topic, ...]:
        """The topics of an index or summary, those at the beginning, and those found while reading."""
        if len(self._topics) != len(self._names.topics):  # topics are only ever added
            self._topics = tuple(topic for _, topic in sorted(self._names.topics.items()))
        return self._topics

    def definition(self, schema: str) -> Definition | None:
        """The first definition found under that name."""
        return self._names.definitions.get(schema)

    def messages(self, topics: Collection[str] | None = None) -> Iterator[Message]:
        """Every message of the topics (None: of all), in the order of the files."""
        self._damage = DamageLog()
        self._reads, stream = self._read(topics, self._damage)
        return stream

    def _begin(self, source: Source, damage: DamageLog) -> None:
        """Name the file of the damage noted from here on, and note what could not be unpacked of it."""
        damage.file = source.name if len(self._sources) > 1 else ""
        if source.problem:
            damage.add(source.problem)

    def _learn_from_beginning(self) -> None:
        """Learn topics where there is no index."""
        seen = 0
        for message in self._read(None, DamageLog())[1]:
            seen += _RECORD_BYTES + len(message.data)
            if seen > _PEEK_BYTES:
                break

    @abstractmethod
    def labels(self) -> tuple[AttackLabel, ...]:
        """Ground truth that the recording carries."""

    @abstractmethod
    def metadata(self) -> Mapping[str, str]:
        """The recording's own description by name."""

    @abstractmethod
    def _read(self, topics: Collection[str] | None, damage: DamageLog) -> tuple[Sequence[FileRead], Iterator[Message]]:
        """A new read of every file, and the messages of all."""
