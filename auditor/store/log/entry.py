"""One line of the log: canonical JSON that carries the hash of the line before it and its own."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from auditor.errors import StoreError

_FRAME = ("at", "before", "kind", "order", "pid", "run", "sha256")


class Kind(StrEnum):
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


class Outcome(StrEnum):
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
    return json.dumps(fields, sort_keys=True, separators=(",", ":")).encode()
