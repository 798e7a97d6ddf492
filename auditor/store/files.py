"""Files that are whole or not there: written beside their place and renamed into it.

A file under way is called `.<name>.<random>.part`, which no reader's pattern matches, and its writer holds a lock on
it. What a killed writer left has lost its lock, and what is still being written has not.
"""

import fcntl
import hashlib
import os
import re
import secrets
import stat
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, BinaryIO

from auditor.errors import StoreError, refused

ABANDONED_AFTER_S = 60.0
"""A younger file under way may have been made so recently that its writer has not locked it yet."""

_BLOCK = 1 << 20
_OWNERS_FOLDER, _OWNERS_FILE = 0o700, 0o600

_GO_ON = "finished files are whole, run the command again to go on"

_ID = re.compile(r"[0-9a-f]{8,64}")
_PART = re.compile(r"\..+\.[0-9a-f]{16}\.part")


def checked_id(text: str) -> str:
    """An id, which may become part of a path. Raises StoreError for anything but 8 to 64 lower-case hex digits."""
    if not _ID.fullmatch(text):
        raise StoreError(f"{text!r} is no id", where="store", remedy="ids are 8 to 64 hexadecimal digits")
    return text


@dataclass(frozen=True)
class WrittenFile:
    """A file that was written: its place, its size in bytes and its sha256."""

    path: Path
    size: int
    sha256: str


Announce = Callable[[WrittenFile], AbstractContextManager[None]]
"""Tells of a file before it is given its place, which happens inside the block of what it returns."""


class PartFile:
    """A file under way: `commit` puts it in the place of `target`, `discard` leaves no trace of it.

    All raise StoreError where the disk is full or the folder cannot be written to.
    """

    def __init__(self, target: Path) -> None:
        self._target = target
        self._part: Path | None = target.with_name(f".{target.name}.{secrets.token_hex(8)}.part")
        with self.reporting():
            make_folder(target.parent)
            self.file = open_part(self._part)
        try:
            with self.reporting():
                fcntl.flock(self.file, fcntl.LOCK_EX)
        except StoreError:
            self.discard()
            raise

    def commit(self, announce: "Announce | None" = None) -> WrittenFile:
        """Make what was written durable and give it its place, within the block of `announce`."""
        assert self._part is not None, "the file has found its end"
        with self.reporting():
            self.file.flush()
            os.fsync(self.file.fileno())
            with self._part.open("rb") as content:
                written = WrittenFile(self._target, *hash_stream(content))
        with announce(written) if announce is not None else nullcontext(), self.reporting():
            self._part.replace(self._target)
            self._part = None
            self.file.close()
            _sync_folder(self._target.parent)
        return written

    def discard(self) -> None:
        """Remove what was written, unless it has been committed."""
        if self._part is not None:
            with suppress(OSError):  # what a full disk did not take is of no interest any more
                self.file.close()
            self._part.unlink(missing_ok=True)
            self._part = None

    @contextmanager
    def reporting(self) -> Iterator[None]:
        """Turn an OSError inside the block into a StoreError with the file and what to do."""
        try:
            yield
        except OSError as error:
            raise StoreError(
                f"cannot be written ({error.strerror or error})",
                where=self._target,
                remedy=refused(error) or f"make room or choose another folder; {_GO_ON}",
            ) from error


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Wait until no other process holds the lock of a folder, and hold it. Raises StoreError."""
    with _descriptor(folder) as descriptor:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield


@contextmanager
def held(path: Path) -> Iterator[bool]:
    """Hold the lock of a file or folder for the block; False where another process does. Raises StoreError.

    A process that is killed lets go of it.
    """
    with _descriptor(path) as descriptor:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            free = False
        else:
            free = True
        yield free


@contextmanager
def _descriptor(path: Path) -> Iterator[int]:
    """What a lock is held by: it ends with the descriptor."""
    try:
        descriptor = os.open(path, os.O_RDONLY)
    except OSError as error:
        raise StoreError(
            f"it cannot be opened ({error.strerror or error})", where=path, remedy=refused(error)
        ) from error
    try:
        yield descriptor
    finally:
        os.close(descriptor)


@contextmanager
def part_file(target: Path) -> Iterator[PartFile]:
    """A file under way that is discarded at the end of the block unless it was committed. Raises StoreError."""
    part = PartFile(target)
    try:
        yield part
    finally:
        part.discard()


def hash_stream(file: IO[bytes]) -> tuple[int, str]:
    """Size and sha256 of what a file holds from its place on. Raises OSError."""
    digest, size = hashlib.sha256(), 0
    while block := file.read(_BLOCK):
        digest.update(block)
        size += len(block)
    return size, digest.hexdigest()


def write_whole(target: Path, content: bytes, announce: "Announce | None" = None) -> WrittenFile:
    """Write a small file in one go, and give it its place within the block of `announce`. Raises StoreError."""
    with part_file(target) as part:
        with part.reporting():
            part.file.write(content)
        return part.commit(announce)


def make_folder(folder: Path) -> None:
    """Make a folder, and those above that are missing, for their owner alone; what is there stays as it is."""
    if not folder.is_dir():
        make_folder(folder.parent)
        folder.mkdir(_OWNERS_FOLDER, exist_ok=True)


def open_part(path: Path) -> BinaryIO:
    """A new file to write to, for its owner alone."""
    return open(path, "xb", opener=for_owner)


def for_owner(path: str, flags: int) -> int:
    """An opener for `open`: a file that it makes is its owner's alone."""
    return os.open(path, flags, _OWNERS_FILE)


def close_to_others(folder: Path) -> None:
    """Leave a folder and all that is in it to their owner alone. Raises OSError."""
    _leave_to_owner(folder, _OWNERS_FOLDER)
    for above, folders, names in os.walk(folder):
        for name in folders:
            _leave_to_owner(Path(above) / name, _OWNERS_FOLDER)
        for name in names:
            _leave_to_owner(Path(above) / name, _OWNERS_FILE)


def _leave_to_owner(path: Path, mode: int) -> None:
    """Set a mode where it is another: what is closed already is not written to."""
    if stat.S_IMODE(path.stat().st_mode) != mode:
        path.chmod(mode)


def remove_abandoned(folder: Path) -> None:
    """Remove what killed writers left in a folder; files that are still being written stay."""
    for part in folder.glob(".*.part"):
        if is_part(part) and _is_abandoned(part):
            part.unlink(missing_ok=True)


def is_part(path: Path) -> bool:
    """True for the name of a file under way."""
    return _PART.fullmatch(path.name) is not None


def finished(folder: Path) -> list[str]:
    """The ids of the finished Parquet files in a folder, sorted."""
    if not folder.is_dir():
        return []
    names = (entry.name.removesuffix(".parquet") for entry in os.scandir(folder) if entry.name.endswith(".parquet"))
    return sorted(name for name in names if _ID.fullmatch(name))


def _is_abandoned(part: Path) -> bool:
    try:
        if time.time() - part.stat().st_mtime < ABANDONED_AFTER_S:
            return False
        with part.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:  # gone meanwhile, locked by its writer, or not ours to judge
        return False
    return True


def _sync_folder(folder: Path) -> None:
    """Make the renaming itself survive a power cut."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
