"""A recording that is a folder of files: each picture and each scan is a file, and its stamp stands beside it."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from auditor.errors import RecordingError
from auditor.model.frames import Message
from auditor.model.verdict import AttackLabel
from auditor.recordings.content import Contents
from auditor.recordings.formats.files import OpenedRecording
from auditor.recordings.recording import Clock, Damage, Definition, Topic, Traffic
from auditor.safety.budget import MAX_BYTES


class Stream(NamedTuple):
    """The files of one sensor with their stamps, in order."""

    topic: Topic
    entries: tuple[tuple[int, Path], ...]


class FolderRecording(OpenedRecording, ABC):
    """One folder. See recording.Recording.

    `others` are files beside those of the `streams` that are part of its id: calibrations and stamps; `contents` has
    what was read of the folder. `places` are files that are no part of its id: they decide nothing that is counted.
    """

    def __init__(
        self,
        path: Path,
        folder: Path,
        streams: Sequence[Stream],
        others: Iterable[Path],
        clock: Clock,
        contents: Contents,
        places: Sequence[Stream] = (),
    ) -> None:
        super().__init__(contents)
        self.path = path
        self.clock: Clock = clock
        self._folder = folder
        self.damage: tuple[Damage, ...] = ()
        self._counts: dict[str, int] = {}
        self._streams = tuple(stream for stream in streams if stream.entries)
        self._places = tuple(stream for stream in places if stream.entries)
        self._of_places = {file for stream in self._places for _, file in stream.entries}
        if not self._streams:
            raise RecordingError("the drive holds no pictures and no scans", where=path)
        data = (file for stream in self._streams for _, file in stream.entries)
        self.files = tuple(sorted({*data, *others}))
        for file in self.files:
            contents.of(file)  # as it is now: what changes from here on is found

    lacking: tuple[Damage, ...] = ()
    """What is known not to be there before anything is read."""

    @abstractmethod
    def _fixed_messages(self) -> Iterator[Message]:
        """Calibrations, which stand at the beginning."""

    def _message(self, stamp_ns: int, topic: Topic, file: Path) -> Message:
        """The message that a file is."""
        return Message(topic.name, topic.schema, topic.encoding, stamp_ns, self._data(file))

    @cached_property
    def recording_id(self) -> str:
        """The hash of its files; what nobody has read of them is read. Raises RecordingError."""
        # Calibration files may lie beside the drive's folder: paths are relative to the folder that holds all.
        folder = self._folder
        top = folder if all(folder in file.parents for file in self.files) else folder.parent
        return self._contents.recording_id(top, self.files)

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
        topics = [stream.topic for stream in (*self._streams, *self._places)]
        topics += [Topic(message.topic, message.schema, message.encoding) for message in self._fixed_messages()]
        return tuple(sorted(topics, key=lambda topic: topic.name))

    def definition(self, schema: str) -> Definition | None:  # noqa: ARG002  # given by the protocol
        """None: what its files are is said by who published it."""
        return None

    def labels(self) -> tuple[AttackLabel, ...]:
        """None."""
        return ()

    def metadata(self) -> Mapping[str, str]:
        """The drive's name."""
        return {"drive": self._folder.name}

    def messages(self, topics: Collection[str] | None = None) -> Iterator[Message]:
        """Calibration first, then pictures and scans in the order of their stamps."""
        self._counts = dict.fromkeys((topic.name for topic in self.topics()), 0)
        self.damage = self.lacking
        return self._read(None if topics is None else frozenset(topics), self._counts)

    def _read(self, wanted: frozenset[str] | None, counts: dict[str, int]) -> Iterator[Message]:
        for message in self._fixed_messages():
            counts[message.topic] += 1
            if wanted is None or message.topic in wanted:
                yield message
        for stamp_ns, topic, file in self._in_order():
            counts[topic.name] += 1
            if wanted is None or topic.name in wanted:
                yield self._message(stamp_ns, topic, file)

    def _data(self, file: Path) -> bytes:
        """The bytes of a file; none, noting the damage, where it cannot be read: its message is then damaged."""
        try:
            content = self._contents.of(file)
            if content.size <= MAX_BYTES:
                return content.read()
            self._note(file, f"it has more than {MAX_BYTES} bytes")
        except OSError as error:
            self._note(file, f"it cannot be read ({error.strerror})")
        except RecordingError:
            if file not in self._of_places:
                raise
        return b""

    def _note(self, file: Path, problem: str) -> None:
        """Note the damage of a file; of places there is none, for it is none of what is measured."""
        if file not in self._of_places:
            self.damage += (Damage(problem, file=file.name),)

    def _in_order(self) -> list[tuple[int, Topic, Path]]:
        streams = (*self._streams, *self._places)
        entries = [(stamp_ns, stream.topic, file) for stream in streams for stamp_ns, file in stream.entries]
        return sorted(entries, key=lambda entry: (entry[0], entry[1].name))
