"""The base of MCAP and ROS recordings: one file or several, each read forward.

The parts of a split file are one stream: they are read one after the other. Files that were recorded at the same time
are several streams: they are read side by side, in the order of their log times.
"""

import zlib
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from heapq import merge
from itertools import chain, pairwise
from os.path import commonpath
from pathlib import Path
from types import TracebackType
from typing import IO, Self, cast

from auditor.errors import RecordingError
from auditor.model.frames import Message
from auditor.model.verdict import AttackLabel
from auditor.recordings.content import Contents
from auditor.recordings.formats.bag_metadata import listed_and_missing
from auditor.recordings.formats.found import Channels, DamageLog, Names, Span, total_traffic
from auditor.recordings.formats.part_names import follows_at_once, missing_between
from auditor.recordings.formats.unpacking import Source, source_of
from auditor.recordings.recording import CLOCKS, EARLIEST_UTC_NS, Clock, Damage, Definition, Topic, Traffic
from auditor.safety.budget import CHUNKS, Spending


class OpenedRecording:
    """A recording whose files are `contents`. See recording.Recording."""

    def __init__(self, contents: Contents) -> None:
        self._contents = contents

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Nothing stays open between reads, unless a format says otherwise."""

    def check_unchanged(self) -> None:
        """Raise ChangedError where a file is not what it was when it was opened."""
        self._contents.check_unchanged()


NO_JOURNALS: Mapping[Path, Path] = {}
_PEEK_BYTES = 32 * 2**20
_RECORD_BYTES = 64  # added to the size of each message: empty ones take work, too


class FileRead(ABC):
    """One forward read of one file: yields messages, counts all of them, notes damage."""

    def __init__(self, source: Source, wanted: Collection[str] | None, names: Names, damage: DamageLog) -> None:
        self._source = source
        self._names = names
        self._damage = damage
        self._spending = Spending(CHUNKS)
        self.channels = Channels(wanted, names, damage)
        """The channels found so far, with their counts."""

    @abstractmethod
    def messages(self) -> Iterator[Message]:
        """Every message of the requested topics, in file order."""

    @abstractmethod
    def span_ns(self) -> Span | None:
        """The first and last log time of the file; None where it has no messages."""


Streams = tuple[tuple[Path, ...], ...]
"""The files of a recording: those of one stream follow one another, streams run side by side."""


class FilesRecording(OpenedRecording, ABC):
    """Every read begins at the start; only unpacked content is held between reads. See recording.Recording.

    `journals` belong to some of the files; both are the recording's content. A file that cannot be read is damage;
    where none can be read, `_refuse_unreadable` raises.
    """

    def __init__(self, path: Path, streams: Streams, journals: Mapping[Path, Path] = NO_JOURNALS) -> None:
        super().__init__(Contents())
        self.path = path
        self.files = (*chain.from_iterable(streams), *journals.values())
        of = self._contents.of
        self._streams = tuple(
            tuple(source_of(of(file), of(journals[file]) if file in journals else None) for file in stream)
            for stream in streams
        )
        self._sources = tuple(chain.from_iterable(self._streams))
        self._unreadable: dict[Source, str] = {}
        self._names = Names()
        self._topics: tuple[Topic, ...] = ()
        self._damage = DamageLog()
        self._reads: Sequence[FileRead] = ()

    def close(self) -> None:
        """Free the unpacked content."""
        for source in self._sources:
            source.close()

    @cached_property
    def recording_id(self) -> str:
        """The hash of its files; what nobody has read of them is read. Raises RecordingError."""
        # Files given together have the id of the folder that holds them, folders that of the one above them.
        above = commonpath([file.parent for file in self.files])
        named = self.path if self.path in self.files else Path(above)
        return self._contents.recording_id(named, self.files)

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

    @cached_property
    def _missing(self) -> tuple[str, ...]:
        """A sentence for each file that a list names, or else the numbers of parts, and that is not there."""
        listed = tuple(listed_and_missing([source.path for source in self._sources]))
        holes = chain.from_iterable(map(self._holes, self._streams))
        return listed or tuple(holes)

    def _holes(self, stream: Sequence[Source]) -> Iterator[str]:
        for source, following in pairwise(stream):
            if (hole := missing_between(source.path, following.path)) and not self._follows_at_once(source, following):
                yield hole

    def _follows_at_once(self, source: Source, following: Source) -> bool:
        """True where no time is left between two parts in which another one may have been recorded."""
        with suppress(RecordingError, OSError):
            before, after = (self._file_read(one, None, DamageLog()).span_ns() for one in (source, following))
            return before is not None and after is not None and follows_at_once(before, after)
        return False

    @property
    def counts(self) -> Mapping[str, int]:
        """Messages found by the last read, by topic."""
        counts = dict.fromkeys(self._names.topics, 0)
        for topic, traffic in self.traffic.items():
            counts[topic.name] = counts.get(topic.name, 0) + traffic.messages
        return counts

    @property
    def traffic(self) -> Mapping[Topic, Traffic]:
        """Messages and bytes found by the last read, by topic and type."""
        return total_traffic([read.channels for read in self._reads])

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

    def _refuse_unreadable(self, remedy: str) -> None:
        """Raise RecordingError where not one of the files can be read."""
        if len(self._unreadable) == len(self._sources):
            self.close()
            source, problem = next(iter(self._unreadable.items()))
            where = self.files[0].with_name(source.name) if len(self._sources) == 1 else self.path
            raise RecordingError(problem, where=where, remedy=remedy)

    def _read(self, topics: Collection[str] | None, damage: DamageLog) -> tuple[Sequence[FileRead], Iterator[Message]]:
        """A new read of every file, and the messages of all."""
        logs = {source: damage.of(source.name if len(self._sources) > 1 else "") for source in self._sources}
        reads = {
            source: self._file_read(source, topics, logs[source])
            for source in self._sources
            if source not in self._unreadable
        }
        for missing in self._missing:
            damage.add(missing)
        streams = [self._in_turn(stream, reads, logs) for stream in self._streams]
        # Each stream holds one chunk of its file in memory.
        messages = merge(*streams, key=lambda message: message.log_time_ns) if len(streams) > 1 else streams[0]
        return list(reads.values()), messages

    def _in_turn(
        self, stream: Sequence[Source], reads: Mapping[Source, FileRead], logs: Mapping[Source, DamageLog]
    ) -> Iterator[Message]:
        for source in stream:
            if source.problem:
                logs[source].add(source.problem)
            if source in reads:
                yield from reads[source].messages()
            else:
                logs[source].add(f"it cannot be read ({self._unreadable[source]})")

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
    def _file_read(self, source: Source, topics: Collection[str] | None, damage: DamageLog) -> FileRead:
        """A new read of one file."""


class CutError(Exception):
    """The file ends inside a record; caught by the reading loop."""


class ForwardStream:
    """A file read forward only. With `checksum` it keeps the CRC of all bytes read or skipped."""

    def __init__(self, file: IO[bytes], size: int, *, checksum: bool = False) -> None:
        self._file = file
        self._checksum = checksum
        self.size = size
        self.offset = 0
        self.crc = 0

    def read(self, length: int) -> bytes:
        """Exactly `length` bytes. Raises CutError."""
        if self.offset + length > self.size:
            raise CutError
        data = self._file.read(length)
        self.offset += len(data)
        if len(data) < length:
            raise CutError
        if self._checksum:
            self.crc = zlib.crc32(data, self.crc)
        return data

    def skip_to(self, offset: int) -> None:
        """Move forward without keeping the bytes between. Raises CutError."""
        if not self._checksum:
            if offset > self.size:
                raise CutError
            self._file.seek(offset)
            self.offset = offset
            return
        while self.offset < offset:
            self.read(min(offset - self.offset, 1 << 20))
