"""Finished files of a store as DuckDB opens them: for reading, under names of their own, and no others."""

import os
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path

from fsspec import AbstractFileSystem


class ReadOnlyFile:
    """One open file, unbuffered: DuckDB reads blocks. It drops its handles without closing them."""

    def __init__(self, path: Path) -> None:
        self._descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        self._place = 0

    def read(self, size: int = -1) -> bytes:
        """At most `size` bytes from here on; all that are left where it is negative."""
        content = os.pread(self._descriptor, size if size >= 0 else os.fstat(self._descriptor).st_size, self._place)
        self._place += len(content)
        return content

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Go to a place, and return it."""
        bases = {os.SEEK_SET: 0, os.SEEK_CUR: self._place, os.SEEK_END: os.fstat(self._descriptor).st_size}
        self._place = bases[whence] + offset
        return self._place

    def tell(self) -> int:
        """The place."""
        return self._place

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
    """Files by the names `store://<table>/<id>.parquet`.

    It can open, list and describe the files that it was given. Whatever would write, move or remove one raises OSError:
    there is no code here that could.
    """

    protocol = "store"
    cachable = False

    def __init__(self) -> None:
        super().__init__()
        self._paths: dict[str, Path] = {}

    def names(self, paths: Iterable[Path]) -> list[str]:
        """Take files of the store in, and return the names that DuckDB may open them by."""
        known = {f"{path.parent.name}/{path.name}": path for path in paths}
        self._paths |= known
        return [f"{self.protocol}://{name}" for name in known]

    def open(self, path: str, mode: str = "rb", **_: object) -> "ReadOnlyFile":
        """A file. Raises OSError for another mode than reading."""
        if mode != "rb":
            raise OSError(f"files of a store can only be read, not opened as {mode!r}: {path}")
        return ReadOnlyFile(self._path(path))

    def info(self, path: str, **_: object) -> dict[str, object]:
        """Name, kind and size of a file."""
        return {"name": path, "type": "file", "size": self._path(path).stat().st_size}

    def modified(self, path: str) -> datetime:
        """When a file was last written to."""
        return datetime.fromtimestamp(self._path(path).stat().st_mtime, UTC)

    def glob(self, path: str, **_: object) -> list[str]:
        """The one file of a name, if there is one: names are no patterns here."""
        return [path] if self._strip_protocol(path) in self._paths else []

    def exists(self, path: str, **_: object) -> bool:
        """True where a file of this name may be read."""
        return self._strip_protocol(path) in self._paths

    def _path(self, path: str) -> Path:
        try:
            return self._paths[self._strip_protocol(path)]
        except KeyError:
            raise FileNotFoundError(path) from None
