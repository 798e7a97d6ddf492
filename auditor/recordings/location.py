"""Where a recording lies: a file or folder, or several files that were recorded together."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path


@dataclass(frozen=True)
class Location:
    """A recording on disk.

    Where it is several files that were given or found beside one another, `streams` holds them: those of one stream
    follow one another, streams run side by side. `path` then is a name for all of them, in their folder.
    """

    path: Path
    streams: tuple[tuple[Path, ...], ...] = ()

    def __str__(self) -> str:
        return str(self.path)

    @property
    def name(self) -> str:
        """What people call the recording."""
        return self.path.name

    @property
    def first(self) -> Path:
        """The file or folder, or the first of several files."""
        return self.streams[0][0] if self.streams else self.path

    @property
    def size_bytes(self) -> int:
        """The size of all its files. Raises OSError."""
        return sum(file.stat().st_size for file in self._files())

    def _files(self) -> Sequence[Path]:
        if self.streams:
            return tuple(chain.from_iterable(self.streams))
        return [self.path] if self.path.is_file() else [file for file in self.path.rglob("*") if file.is_file()]


def located(where: Path | Location) -> Location:
    """The location of a path."""
    return where if isinstance(where, Location) else Location(where)
