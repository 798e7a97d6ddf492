"""Files that appear whole or not at all, and MCAP files, whose topics are registered when their first message comes."""

import shutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Literal

from mcap.writer import CompressionType, Writer

from auditor.errors import RecordingError
from auditor.model.verdict import AttackLabel
from auditor.recordings.recording import (
    LABELS_MEDIA_TYPE,
    LABELS_NAME,
    METADATA_NAME,
    Definition,
    Topic,
    labels_to_json,
)


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A path beside the target to write to; it is renamed into place at the end, and removed after an error.

    Raises RecordingError where it cannot be written.
    """
    with _placed(path) as beside:
        yield beside
        beside.replace(path)


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """The same for a folder; it has its final name from the start, since the files inside are named after it."""
    if path.exists():
        raise RecordingError("it exists already", where=path, remedy="choose another name, or remove it")
    with _placed(path) as above:
        above.mkdir()
        yield above / path.name
        (above / path.name).replace(path)


@contextmanager
def no_remains(path: Path) -> Iterator[None]:
    """Removes at the end what a process that was killed has left of the target."""
    try:
        yield
    finally:
        _remove(_unfinished(path))


@contextmanager
def _placed(path: Path) -> Iterator[Path]:
    """A free path beside the target, in a folder that is there; it is removed at the end. Raises RecordingError."""
    beside = _unfinished(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _remove(beside)
        yield beside
    except OSError as error:
        raise RecordingError(f"it cannot be written ({error.strerror or error})", where=path) from error
    finally:
        _remove(beside)


def _unfinished(path: Path) -> Path:
    return path.with_name(f".{path.name}.part")


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


Compression = Literal["zstd", "lz4", "none"]

_COMPRESSIONS = {"zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4, "none": CompressionType.NONE}
_CHUNK_BYTES = 4 * 2**20


class McapFile:
    """Writes messages, ground truth and metadata by mcap's own writer."""

    def __init__(self, stream: IO[bytes], profile: str, compression: Compression) -> None:
        self._writer = Writer(stream, chunk_size=_CHUNK_BYTES, compression=_COMPRESSIONS[compression])
        self._writer.start(profile=profile, library="auditor")
        self._schemas: dict[str, int] = {}
        self._channels: dict[Topic, int] = {}

    def write(self, topic: Topic, definition: Definition | None, log_time_ns: int, data: bytes | memoryview) -> None:
        """Add one message; a topic's first definition counts."""
        channel = self._channels.get(topic)
        if channel is None:
            channel = self._writer.register_channel(topic.name, topic.encoding, self._schema(topic.schema, definition))
            self._channels[topic] = channel
        # A log time before 1970 cannot be written.
        log_time_ns = max(log_time_ns, 0)
        self._writer.add_message(channel, log_time_ns, bytes(data), log_time_ns)

    def _schema(self, name: str, definition: Definition | None) -> int:
        if not name:
            return 0
        if name not in self._schemas:
            encoding, data = (definition.encoding, definition.data) if definition else ("", b"")
            self._schemas[name] = self._writer.register_schema(name, encoding, data)
        return self._schemas[name]

    def add_labels(self, labels: Iterable[AttackLabel], time_ns: int) -> None:
        """Attach ground truth, where there is any."""
        attack_labels = tuple(labels)
        if attack_labels:
            self._writer.add_attachment(time_ns, time_ns, LABELS_NAME, LABELS_MEDIA_TYPE, labels_to_json(attack_labels))

    def add_metadata(self, metadata: Mapping[str, str]) -> None:
        """Add the recording's own description, where there is any."""
        if metadata:
            self._writer.add_metadata(METADATA_NAME, dict(metadata))

    def finish(self) -> None:
        """Write the summary."""
        self._writer.finish()  # type: ignore[no-untyped-call]  # mcap leaves it unannotated


@contextmanager
def mcap_file(path: Path, *, profile: str, compression: Compression) -> Iterator[McapFile]:
    """An MCAP file that appears under its name when it is complete. Raises RecordingError where that fails."""
    with whole_file(path) as beside, beside.open("wb") as stream:
        file = McapFile(stream, profile, compression)
        yield file
        file.finish()
