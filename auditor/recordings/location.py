"""Where a recording lies: a file or folder, or several files that were recorded together."""

import hashlib
import os
import time
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain
from pathlib import Path

_SETTLED_NS = 2_000_000_000
"""A folder that changed later may change again without its time telling."""


@dataclass(frozen=True)
class StoredObject:
    """One object of an object store: its address, its size in bytes, its ETag, and when it was written."""

    address: str
    size_bytes: int
    etag: str | None
    written: str


@dataclass(frozen=True)
class Remote:
    """A recording on an object store: its address, and its objects, all of which lie beside or below it."""

    address: str
    objects: tuple[StoredObject, ...]

    @property
    def above(self) -> str:
        """What the addresses of all its objects begin with; what follows are names of files."""
        return self.address.rpartition("/")[0] + "/"

    @property
    def first(self) -> str:
        """The address of its file or folder, or of the first of several files, which lie beside its own address."""
        addresses = sorted(one.address for one in self.objects)
        whole = any(one == self.address or one.startswith(f"{self.address}/") for one in addresses)
        return self.address if whole else addresses[0]

    @property
    def size_bytes(self) -> int:
        """The size of all its objects."""
        return sum(one.size_bytes for one in self.objects)

    @property
    def identity(self) -> str:
        """A hash of all that the object store says of its objects."""
        lines = sorted(f"{one.address} {one.size_bytes} {one.etag} {one.written}\n" for one in self.objects)
        return hashlib.sha256("".join(lines).encode("utf-8", "surrogateescape")).hexdigest()


@dataclass(frozen=True)
class Location:
    """A recording on disk, or on an object store.

    Where it is several files that were given or found beside one another, `streams` holds them: those of one stream
    follow one another, streams run side by side. `path` then is a name for all of them, in their folder. `remote` says
    of which objects the files are copies; before they are copied nothing is at `path`.
    """

    path: Path
    streams: tuple[tuple[Path, ...], ...] = ()
    remote: Remote | None = None

    def __str__(self) -> str:
        return str(self.path) if self.remote is None else self.remote.address

    @property
    def place(self) -> str:
        """Where people find it again: its whole path, or its address."""
        return str(self.path.resolve()) if self.remote is None else self.remote.address

    @property
    def name(self) -> str:
        """What people call the recording."""
        return self.path.name

    @property
    def first(self) -> Path:
        """The file or folder, or the first of several files."""
        return self.streams[0][0] if self.streams else self.path

    @property
    def given(self) -> Path:
        """What `first` is where it was given, also of a copy of what lies on an object store: names tell of origins."""
        return self.first if self.remote is None else Path(self.remote.first)

    @property
    def size_bytes(self) -> int:
        """The size of all its files. Raises OSError."""
        if self.remote is not None:
            return self.remote.size_bytes
        return sum(file.stat().st_size for file in self._files())

    @property
    def identity(self) -> str:
        """A hash that changes where one of its files is replaced, written to, added or moved: nothing of them is read.

        It is one of their paths, sizes, times and inodes. The time of the last change tells of a file whose time of
        modification was set back. Raises OSError.
        """
        if self.remote is not None:
            return self.remote.identity
        whole = hashlib.sha256()
        for file in sorted({*self._files(), *self._beside()}):
            status = file.stat()
            known = (status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino)
            whole.update(f"{file.resolve()} {known}\n".encode("utf-8", "surrogateescape"))
        return whole.hexdigest()

    def _beside(self) -> Iterator[Path]:
        """Journals: files beside the recording's, whose names go on with a hyphen."""
        for file in (self.streams and self._files()) or [self.path]:
            names, begins = _names_in(file.parent) if file.is_file() else [], f"{file.name}-"
            for place in range(bisect_left(names, begins), len(names)):
                if not names[place].startswith(begins):
                    break
                if (one := file.with_name(names[place])).is_file():
                    yield one

    def _files(self) -> Sequence[Path]:
        if self.streams:
            return tuple(chain.from_iterable(self.streams))
        return [self.path] if self.path.is_file() else [file for file in self.path.rglob("*") if file.is_file()]


def located(where: Path | Location) -> Location:
    """The location of a path."""
    return where if isinstance(where, Location) else Location(where)


def _names_in(folder: Path) -> Sequence[str]:
    """The names in a folder, in order. Thousands of recordings lie in one: it is listed once while it stays."""
    changed_ns = folder.stat().st_mtime_ns
    settled = time.time_ns() - changed_ns > _SETTLED_NS
    return _listed(folder, changed_ns) if settled else _listed.__wrapped__(folder, changed_ns)


@lru_cache(maxsize=64)
def _listed(folder: Path, _: int) -> Sequence[str]:
    return sorted(entry.name for entry in os.scandir(folder))
