"""Finished files of a store as DuckDB opens them: for reading, under names of their own, and no others."""

import fcntl
import os
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from threading import local

from fsspec import AbstractFileSystem

PROTOCOL = "store"
_PREFIX = f"{PROTOCOL}://"


class _Place(local):
    """Where a thread is in a file."""

    bytes = 0


class ReadOnlyFile:
    """One open file, unbuffered: DuckDB reads blocks. It drops its handles without closing them.

    Several of DuckDB's threads read one object, each by a seek and a read: every thread has a place of its own.
    """

    __slots__ = ("_descriptor", "_place")

    def __init__(self, path: Path) -> None:
        self._descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        self._place = _Place()

    def read(self, size: int = -1) -> bytes:
        """At most `size` bytes from here on; all that are left where it is negative."""
        content = os.pread(
            self._descriptor, size if size >= 0 else os.fstat(self._descriptor).st_size, self._place.bytes
        )
        self._place.bytes += len(content)
        return content

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Go to a place, and return it."""
        if whence == os.SEEK_END:
            offset += os.fstat(self._descriptor).st_size
        self._place.bytes = offset + (self._place.bytes if whence == os.SEEK_CUR else 0)
        return self._place.bytes

    def fileno(self) -> int:
        """Its descriptor."""
        return self._descriptor

    def tell(self) -> int:
        """The place."""
        return self._place.bytes

    def seekable(self) -> bool:
        """True: it is a file."""
        return True

    def close(self) -> None:
        """Close it; what is closed stays closed."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    __del__ = close


class ReadOnlyFiles(AbstractFileSystem):  # type: ignore[misc]  # fsspec ships no type information
    """Files by the names `store://<device>-<inode>-<time of change>/<table>/<id>.parquet`.

    DuckDB keeps footers and blocks by name and by the second of the last change: those of a file of the same name in
    another store, or of one that was replaced within a second, would be taken for those of this one.

    It can open, list and describe the files that it was given. Whatever would write, move or remove one raises OSError
    or NotImplementedError: there is no code here that could. While it is there, it holds a lock on a file of the store
    together with all others that read it: none of the files that it was given is removed because it was packed.
    """

    protocol = PROTOCOL
    cachable = False

    def __init__(self, shared: Path | None = None) -> None:
        super().__init__()
        self._shared = ReadOnlyFile(shared) if shared is not None else None
        if self._shared is not None:
            fcntl.flock(self._shared.fileno(), fcntl.LOCK_SH)
        self._files: dict[str, tuple[Path, os.stat_result]] = {}

    def names(self, paths: Iterable[Path]) -> list[str]:
        """Take files of the store in, and return the names that DuckDB may open them by."""
        files = {name_of(path, status): (path, status) for path, status in ((path, path.stat()) for path in paths)}
        self._files |= files
        return [*files]

    def path(self, name: str) -> Path:
        """Where a file lies."""
        return self._known(name)[0]

    def open(self, path: str, mode: str = "rb", **_: object) -> ReadOnlyFile:
        """A file. Raises OSError for another mode than reading."""
        if mode != "rb":
            raise OSError(f"files of a store can only be read, not opened as {mode!r}: {path}")
        return ReadOnlyFile(self.path(path))

    def info(self, path: str, **_: object) -> dict[str, object]:
        """Name, kind and size of a file."""
        return {"name": path, "type": "file", "size": self.size(path)}

    def size(self, path: str) -> int:
        """Bytes of a file; DuckDB asks at every opening, so it was looked up once."""
        return self._known(path)[1].st_size

    def modified(self, path: str) -> datetime:
        """When a file was last written to."""
        return datetime.fromtimestamp(self._known(path)[1].st_mtime, UTC)

    def glob(self, path: str, **_: object) -> list[str]:
        """The one file of a name, if there is one: names are no patterns here."""
        return [path] if self.exists(path) else []

    def exists(self, path: str, **_: object) -> bool:
        """True where a file of this name may be read."""
        return _named(path) in self._files

    def _known(self, path: str) -> tuple[Path, os.stat_result]:
        try:
            return self._files[_named(path)]
        except KeyError:
            raise FileNotFoundError(path) from None


def name_of(path: Path, status: os.stat_result) -> str:
    """The name that DuckDB may open a file of the store by."""
    return f"{_PREFIX}{status.st_dev}-{status.st_ino}-{status.st_mtime_ns}/{path.parent.name}/{path.name}"


def _named(path: str) -> str:
    """A name as it was given out: some versions of DuckDB and fsspec take its beginning away."""
    return path if path.startswith(_PREFIX) else _PREFIX + path
