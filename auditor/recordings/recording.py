"""A recording as topics and a stream of messages, and the labels of attacks in it."""

import json
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Protocol, Self, get_args, runtime_checkable

from auditor.errors import RecordingError
from auditor.model.frames import Message
from auditor.model.verdict import AttackLabel

Clock = Literal["utc", "relative", "unknown"]
CLOCKS: frozenset[str] = frozenset(get_args(Clock))

EARLIEST_UTC_NS = 946_684_800 * 10**9
"""Stamps before the year 2000 do not count from 1970: they count from the start of a recorder or a drive."""

LABELS_NAME = "auditor-labels.json"
LABELS_MEDIA_TYPE = "application/json"
METADATA_NAME = "auditor"
MAX_JSON_BYTES = 16 * 2**20

MAX_JSON_PARTS = 1_000_000
"""Parsed lists and objects take many times the memory of their text: they are counted before parsing."""

METADATA_TOPIC = "/auditor/metadata"
"""The topic of labels and metadata in .bag and .db3 recordings, JSON in a std_msgs/String: they have no attachments."""


@dataclass(frozen=True)
class Topic:
    """A named stream of messages; `schema` is spelt `package/msg/Type` for ROS 1 too."""

    name: str
    schema: str
    encoding: str


@dataclass(frozen=True)
class Traffic:
    """What one read found of a topic: its messages, and the bytes of their data as the file holds them."""

    messages: int = 0
    size_bytes: int = 0


@dataclass(frozen=True)
class Damage:
    """A part of a recording that could not be read: what it is, and at which byte of its file (None where unknown)."""

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
        """The definition as text, which ROS's are; lines end as everywhere else, also where Windows wrote them."""
        return self.data.decode("utf-8-sig", "replace").replace("\r\n", "\n")

    @property
    def is_blank(self) -> bool:
        """True where nothing is defined: recorders write such a one where they do not find the type's package."""
        return not self.data.strip()

    def says_the_same(self, other: "Definition") -> bool:
        """True for two that differ in blanks, comments and rulers alone, as those of two recorders may."""
        return self == other or (self.encoding == other.encoding and _words(self) == _words(other))


_TEXTS = frozenset({"ros1msg", "ros2msg", "ros2idl", "jsonschema"})
_BETWEEN = re.compile(r"#[^\n]*|={3,}|\s+")


def _words(definition: Definition) -> list[str] | bytes:
    """The words of a definition that is text; the bytes of any other."""
    if definition.encoding not in _TEXTS:
        return definition.data
    text = definition.text.replace("/msg/", "/") if definition.encoding.endswith("msg") else definition.text
    return _BETWEEN.sub(" ", text).split()


class Recording(Protocol):
    """One log file or folder, opened for reading only.

    `topics` may grow while a recording without an index is read. `counts` and `traffic` (what was found, requested or
    not) and `damage` describe the last call of `messages`, and are complete once it is exhausted.
    """

    path: Path
    files: tuple[Path, ...]

    @property
    def recording_id(self) -> str:
        """sha256 (hex) of the content; of a folder that of its sorted relative paths and file hashes."""

    @property
    def clock(self) -> Clock:
        """The origin of the stamps: 'utc', 'relative' (to a start), or 'unknown' (a clock without a stated zone)."""

    @property
    def counts(self) -> Mapping[str, int]:
        """Messages found by the last read, by topic."""

    @property
    def traffic(self) -> Mapping[Topic, Traffic]:
        """Messages and bytes found by the last read; a name with messages of two types is two topics here."""

    @property
    def damage(self) -> tuple[Damage, ...]:
        """The parts that the last read could not read."""

    def topics(self) -> tuple[Topic, ...]:
        """All topics known so far, by name."""

    def messages(self, topics: Collection[str] | None = None) -> Iterator[Message]:
        """Every message of the topics (None: of all), in the order of the file; may be called again and again."""

    def definition(self, schema: str) -> Definition | None:
        """The definition of a schema that the recording carries, or None."""

    def labels(self) -> tuple[AttackLabel, ...]:
        """Ground truth that the recording carries. Raises RecordingError where it is ill-formed."""

    def metadata(self) -> Mapping[str, str]:
        """The recording's own description by name, such as 'vehicle'."""

    def check_unchanged(self) -> None:
        """Raise RecordingError where a file is not what it was when the recording was opened.

        `content.Contents` does this for a reader, and lets no byte be read that was not hashed.
        """

    def close(self) -> None:
        """Close the files."""

    def __enter__(self) -> Self:
        """Use as a context manager closes it."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close it."""


@runtime_checkable
class CarriesCalibrations(Protocol):
    """A recording that may hold calibrations apart from its messages."""

    def calibrations(self) -> Mapping[str, str]:
        """Texts that may be calibrations, by name; see decoding.calibration_texts, and decoding.points.ouster."""


class Reader(Protocol):
    """A container format: an entry of the table in `opening`, or of the entry points group `auditor.readers`.

    Its name in either is the format that a store keeps of a recording.
    """

    def detects(self, path: Path) -> bool:
        """True where the path is a recording of this format, judged by names alone, without reading its content."""

    def open(self, path: Path) -> Recording:
        """Open it. Raises RecordingError."""


def labels_to_json(labels: Iterable[AttackLabel]) -> bytes:
    """A JSON array with one object for each label."""
    return json.dumps([label_to_dict(label) for label in labels], indent=1, sort_keys=True).encode()


def label_to_dict(label: AttackLabel) -> dict[str, Any]:
    """A plain description that `label_from_dict` reads back."""
    return {**vars(label), "parameters": dict(label.parameters)}


def label_from_dict(description: dict[str, Any]) -> AttackLabel:
    """Read what `label_to_dict` wrote. Raises KeyError, TypeError or ValueError where it is something else."""
    return AttackLabel(
        topic=str(description["topic"]),
        attack=str(description["attack"]),
        from_ns=int(description["from_ns"]),
        to_ns=int(description["to_ns"]),
        parameters=dict(description["parameters"]),
    )


def load_json(text: bytes | str) -> Any:  # noqa: ANN401  # what json.loads gives
    """Parse JSON that may be hostile. Raises ValueError and RecursionError."""
    text = text.encode("utf-8", "surrogatepass") if isinstance(text, str) else text
    if len(text) > MAX_JSON_BYTES or sum(text.count(sign) for sign in (b",", b"[", b"{")) > MAX_JSON_PARTS:
        raise ValueError("it is too large")
    return json.loads(text)


def labels_from_json(text: bytes | str, where: object) -> tuple[AttackLabel, ...]:
    """Read what `labels_to_json` wrote. Raises RecordingError where it is something else."""
    try:
        return tuple(label_from_dict(description) for description in load_json(text))
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise RecordingError(f"its ground truth ({LABELS_NAME}) is ill-formed ({error})", where=where) from error
