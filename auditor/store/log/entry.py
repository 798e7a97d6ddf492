"""One line of the log: canonical JSON that carries the hash of the line before it and its own.

What lines say are who runs what, and finished files: their places, sizes and sha256.
"""

import getpass
import hashlib
import json
import os
import platform
import socket
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution, version
from pathlib import Path
from typing import Any

from auditor import __version__
from auditor.errors import StoreError
from auditor.model.canonical import canonical_json
from auditor.resources import plug_ins
from auditor.store.files import WrittenFile, hash_stream

_FRAME = ("at", "before", "kind", "order", "pid", "run", "sha256")


class EntryKind(StrEnum):
    """What an entry says."""

    OPENED = "opened"
    """A run begins: command, user, host, versions, plug-ins, and the heads of the other chains."""

    USED = "used"
    """It read something: a recording, a model, a calibration."""

    WROTE = "wrote"
    """It puts files in their places."""

    REMOVED = "removed"
    """It removes files."""

    SUPERSEDED = "superseded"
    """A recording holds every frame of another, which counts no longer."""

    UPGRADED = "upgraded"
    """It replaces all files by those of a new schema version."""

    PACKED = "packed"
    """It puts the rows of many files into one, and removes them: files that it writes, and files that it removes."""

    IN_FORCE = "in_force"
    """A calibration came into force for a rig kind, in place of another."""

    REVIEWED = "reviewed"
    """Somebody said what an incident is."""

    CLOSED = "closed"
    """A run ended, or was found to have been interrupted."""

    SIGNED = "signed"
    """Somebody signed the heads of all chains."""


class RunOutcome(StrEnum):
    """How a run ended."""

    DONE = "done"
    FAILED = "failed"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True)
class Entry:
    """One entry. `order` grows by one with each entry of a store; `before` is the hash of the chain's last entry.

    `at` is UTC in ISO 8601; `what` has the rest, by the entry's kind. `run` and `pid` are those of its writer.
    """

    order: int
    at: str
    kind: str
    run: str
    pid: int
    before: str
    what: Mapping[str, Any]

    @property
    def _fields(self) -> dict[str, Any]:
        frame = {name: getattr(self, name) for name in _FRAME if name != "sha256"}
        return {**self.what, **frame}

    @property
    def sha256(self) -> str:
        """The hash of everything in it."""
        return hashlib.sha256(_canonical(self._fields)).hexdigest()

    @property
    def line(self) -> bytes:
        """As the file has it."""
        return _canonical({**self._fields, "sha256": self.sha256}) + b"\n"

    @classmethod
    def of_line(cls, line: bytes) -> "Entry":
        """The entry of a line without its end. Raises StoreError where it is none or is not as it was written."""
        try:
            fields = json.loads(line)
            frame = {name: fields[name] for name in _FRAME}
            rest = {name: value for name, value in fields.items() if name not in _FRAME}
        except (ValueError, TypeError, KeyError, RecursionError) as error:
            raise StoreError("a line is no entry") from error
        stated = frame.pop("sha256")
        entry = cls(**frame, what=rest)
        if entry.sha256 != stated or entry.line != line + b"\n":
            raise StoreError("an entry was changed after it was written")
        return entry


def _canonical(fields: Mapping[str, Any]) -> bytes:
    return canonical_json(fields).encode()


_VERSIONED = ("duckdb", "numpy", "onnxruntime", "opencv-python-headless", "pyarrow", "torch")


def provenance(command: Sequence[str]) -> dict[str, Any]:
    """What the first entry of a run says of it."""
    return {
        "command": list(command),
        "user": user(),
        "host": socket.gethostname(),
        "folder": str(Path.cwd()),
        "versions": dict(_versions()),
        "plug_ins": dict(_plug_ins()),
    }


def user() -> str:
    """The user's name, or number where it has none."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):  # Python 3.13 raises OSError where older ones raise KeyError
        return str(os.getuid())


@cache
def _versions() -> dict[str, str]:
    versions = {"auditor": __version__, "python": platform.python_version(), "system": platform.platform()}
    for name in _VERSIONED:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            continue
    return versions


@cache
def _plug_ins() -> dict[str, dict[str, str]]:
    """Installed plug-ins by name: their version, and the hash of the list of their files, which has a hash of each."""
    return {name: {"version": its, "sha256": _record(name)} for name, its in plug_ins().items()}


def _record(name: str) -> str:
    record = distribution(name).read_text("RECORD") or ""
    return hashlib.sha256(record.encode()).hexdigest()


def this_program() -> list[str]:
    """The command of a program that uses the library."""
    return [Path(sys.argv[0]).name or "python", *sys.argv[1:]] if sys.argv else ["python"]


@dataclass(frozen=True)
class OutputFile:
    """A finished file; `path` is its place in the store with `/`, or a whole path where it lies elsewhere."""

    path: str
    size: int
    sha256: str

    @property
    def fields(self) -> dict[str, Any]:
        """As the column `outputs` and the log have it."""
        return {"path": self.path, "size": self.size, "sha256": self.sha256}

    @classmethod
    def of_written(cls, written: WrittenFile, folder: Path) -> "OutputFile":
        """A file that was written, of the store in a folder."""
        return cls(place_in(folder, written.path), written.size, written.sha256)

    @classmethod
    def of_fields(cls, fields: Mapping[str, Any]) -> "OutputFile":
        """The output of a row of the column `outputs`, or of an entry of the log."""
        return cls(fields["path"], fields["size"], fields["sha256"])


def hash_file(path: Path) -> tuple[int, str]:
    """Size and sha256 of a file. Raises StoreError where it cannot be read."""
    try:
        with path.open("rb") as file:
            return hash_stream(file)
    except FileNotFoundError as error:
        raise StoreError("it is missing", where=path) from error
    except OSError as error:
        raise StoreError(f"it cannot be read ({error.strerror or error})", where=path) from error


def output_of(path: Path, folder: Path) -> OutputFile:
    """What lies at a path, of the store in a folder. Raises StoreError where it cannot be read."""
    return OutputFile(place_in(folder, path), *hash_file(path))


def place_in(folder: Path, path: Path) -> str:
    """A path as entries have it: from the store's folder on where it lies in there."""
    return path.relative_to(folder).as_posix() if path.is_relative_to(folder) else str(path)
