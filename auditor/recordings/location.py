"""Where a recording lies, and where it comes from: its vehicle, date, drive and weather."""

import datetime
import hashlib
import os
import re
import time
from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain
from pathlib import Path
from typing import Self

from auditor.errors import SettingError

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
    def here(self) -> "Path | Location":
        """Its path; itself where it lies on an object store, and its path is that of a copy."""
        return self.path if self.remote is None else self

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
        """What was given, of several files the first, also of a copy of what lies on an object store: names tell of
        origins.
        """
        if self.remote is not None:
            return Path(self.remote.first)
        return self.path.parent / self.first.relative_to(self.path.parent).parts[0] if self.streams else self.first

    @property
    def remarks(self) -> tuple[str, ...]:
        """A sentence on what was put together that was recorded side by side; none where nothing was."""
        if len(self.streams) < 2:
            return ()
        names = [_relative(stream, self.path.parent) for stream in self.streams]
        return (
            f"read as one recording, since they have other sensors at the same time: {', '.join(names)}; if they are "
            "of several vehicles, move those of each to a folder of its own",
        )

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
            stamp = (status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino)
            whole.update(f"{file.resolve()} {stamp}\n".encode("utf-8", "surrogateescape"))
        return whole.hexdigest()

    def _beside(self) -> Iterator[Path]:
        """Journals: files beside the recording's, whose names go on with a hyphen."""
        for file in (self.streams and self._files()) or [self.path]:
            names, begins = _names_in(file.parent) if file.is_file() else [], f"{file.name}-"
            for place in range(bisect_left(names, begins), len(names)):
                if not names[place].startswith(begins):
                    break
                if (journal := file.with_name(names[place])).is_file():
                    yield journal

    def _files(self) -> Sequence[Path]:
        if self.streams:
            return tuple(chain.from_iterable(self.streams))
        return [self.path] if self.path.is_file() else [file for file in self.path.rglob("*") if file.is_file()]


def _relative(stream: Sequence[Path], folder: Path) -> str:
    """The files of a stream, in words."""
    first, last = (file.relative_to(folder).as_posix() for file in (stream[0], stream[-1]))
    return first if len(stream) == 1 else f"{first} to {last}"


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


WORDS = ("vehicle", "date", "drive", "weather")
_PLACE = re.compile(r"\{(\w*)\}|(\*)")
_DAY = re.compile(r"(\d{4})([-_.]?)(\d\d)\2(\d\d)")


def read_path(path: Path, pattern: str) -> dict[str, str]:
    """The text that stands for each word of a pattern, by word, where the end of the path matches it; else nothing.

    `{vehicle}`, `{date}`, `{drive}` and `{weather}` stand for any text without a slash, `*` for text that is ignored.
    Raises SettingError for a pattern with other words, a word twice, or none.
    """
    expression, position = "", 0
    for place in _PLACE.finditer(pattern):
        expression += re.escape(pattern[position : place.start()])
        expression += "[^/]*" if place[2] else f"(?P<{_word(place[1], pattern, expression)}>[^/]+?)"
        position = place.end()
    if "(?P<" not in expression:
        raise SettingError(
            "it holds none of {vehicle}, {date}, {drive} and {weather}", where=f"path pattern {pattern!r}"
        )
    words = re.search(f"(?:^|/){expression}{re.escape(pattern[position:])}$", path.as_posix())
    return words.groupdict() if words else {}


def _word(word: str, pattern: str, before: str) -> str:
    if word not in WORDS or f"(?P<{word}>" in before:
        raise SettingError(
            f"{{{word}}} is none of {', '.join(f'{{{known}}}' for known in WORDS)}, each once",
            where=f"path pattern {pattern!r}",
        )
    return word


@dataclass(frozen=True)
class Origin:
    """The origin of a recording; None where a part is unknown."""

    vehicle: str | None = None
    date: datetime.date | None = None
    drive: str | None = None
    weather: str | None = None

    def over(self, other: Self) -> "Origin":
        """This origin, with its unknown parts taken from another."""
        return Origin(
            self.vehicle or other.vehicle,
            self.date or other.date,
            self.drive or other.drive,
            self.weather or other.weather,
        )

    @classmethod
    def of_path(cls, path: Path, pattern: str) -> "Origin":
        """The origin that a path gives by a pattern, see read_path. Raises SettingError for a bad pattern or date."""
        declared = read_path(path.absolute(), pattern)
        date = _day(declared["date"]) if "date" in declared else None
        if "date" in declared and date is None:
            raise SettingError(
                f"{declared['date']!r} in {path} is not a date",
                where=f"path pattern {pattern!r}",
                remedy="{date} stands for a day such as 2026-01-31, 2026_01_31 or 20260131",
            )
        return cls(declared.get("vehicle"), date, declared.get("drive"), declared.get("weather"))

    @classmethod
    def of_metadata(cls, declared: Mapping[str, str]) -> "Origin":
        """The origin that a recording's metadata declares; an ill-formed date is ignored."""
        vehicle, drive, weather = (declared.get(name) or None for name in ("vehicle", "drive", "weather"))
        return cls(vehicle, _day(declared.get("date", "")), drive, weather)


def _day(text: str) -> datetime.date | None:
    parts = _DAY.fullmatch(text)
    try:
        return datetime.date(int(parts[1]), int(parts[3]), int(parts[4])) if parts else None
    except ValueError:
        return None
