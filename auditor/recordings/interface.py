"""What every reader offers: a recording as topics and a stream of messages, and what was wrong with it."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Literal, Protocol, Self, get_args

from auditor.frames import Message
from auditor.results import AttackLabel

Clock = Literal["utc", "relative", "unknown"]
CLOCKS: frozenset[str] = frozenset(get_args(Clock))

EARLIEST_UTC_NS = 946_684_800 * 10**9
"""Stamps before the year 2000 do not count from 1970: they count from the start of something."""


@dataclass(frozen=True)
class Topic:
    """A named stream of messages; `schema` is spelt `package/msg/Type` for ROS 1 too."""

    name: str
    schema: str
    encoding: str


@dataclass(frozen=True)
class Damage:
    """A part of a recording that could not be read: what, and at which byte of its file (None where unknown)."""

    what: str
    offset: int | None = None
    file: str = ""

    def __str__(self) -> str:
        where = f" at byte {self.offset}" if self.offset is not None else ""
        return f"{self.file + ': ' if self.file else ''}{self.what}{where}"


@dataclass(frozen=True)
class Definition:
    """What defines a schema; `encoding` is 'ros2msg', 'ros2idl', 'ros1msg', or another one that is only copied."""

    encoding: str
    data: bytes

    @property
    def text(self) -> str:
        """The definition as text, which ROS's are."""
        return self.data.decode("utf-8", "replace")


class Recording(Protocol):
    """One log file or folder, opened for reading only.

    `topics` may grow while a recording without an index is read. `counts` (messages met, by topic, asked for or not)
    and `damage` describe the last call of `messages`, and are complete once it is exhausted.
    """

    path: Path
    files: tuple[Path, ...]

    @property
    def recording_id(self) -> str:
        """sha256 (hex) of the content; of a folder that of its sorted relative paths and file hashes."""

    @property
    def clock(self) -> Clock:
        """What the stamps count from: 'utc', 'relative' (to a start), or 'unknown' (a clock without a stated zone)."""

    @property
    def counts(self) -> Mapping[str, int]:
        """Messages met by the last read, by topic."""

    @property
    def damage(self) -> tuple[Damage, ...]:
        """What the last read could not read."""

    def topics(self) -> tuple[Topic, ...]:
        """All topics known so far, by name."""

    def messages(self, topics: Collection[str] | None = None) -> Iterator[Message]:
        """Every message of the topics (None: of all), in the order of the file; may be called again and again."""

    def definition(self, schema: str) -> Definition | None:
        """The definition of a schema that the recording carries, or None."""

    def labels(self) -> tuple[AttackLabel, ...]:
        """Ground truth that the recording carries. Raises RecordingError where it is ill-formed."""

    def metadata(self) -> Mapping[str, str]:
        """What the recording says about itself, such as 'vehicle'."""

    def close(self) -> None:
        """Let go of the files."""

    def __enter__(self) -> Self:
        """Use as a context manager closes it."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close it."""


class Reader(Protocol):
    """A container format: an entry of the table in `opening`, or of the entry points group `auditor.readers`.

    Its name in either is the format that a store keeps of a recording.
    """

    def detects(self, path: Path) -> bool:
        """True where the path is a recording of this format, by its name or its look, without reading it."""

    def open(self, path: Path) -> Recording:
        """Open it. Raises RecordingError."""
