"""Paths of a command line -> recordings."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from auditor.errors import RecordingError
from auditor.recordings.opening import KINDS, reader_of


@dataclass(frozen=True)
class Found:
    """The recordings of a command line, each once, in its order, and one error for each path that gave none."""

    recordings: tuple[Path, ...]
    errors: tuple[RecordingError, ...]


def find_recordings(paths: Sequence[Path]) -> Found:
    """Find the recordings in files and folders; a folder that is no recording itself is searched, names in order.

    A path that gives no recording becomes a RecordingError in the answer: the others go on.
    """
    recordings: dict[Path, None] = {}
    errors: list[RecordingError] = []
    for path in paths:
        try:
            recordings.update(dict.fromkeys(_recordings_at(path)))
        except RecordingError as error:
            errors.append(error)
        except OSError as error:
            errors.append(RecordingError(f"it cannot be read ({error.strerror or error})", where=path))
    return Found(tuple(recordings), tuple(errors))


def _recordings_at(path: Path) -> list[Path]:
    if not path.exists():
        raise RecordingError("there is no such file or folder", where=path, remedy="check the path")
    if reader_of(path) is not None:
        if path.is_file() and path.stat().st_size == 0:
            raise RecordingError("the file is empty", where=path, remedy="record or copy it again")
        return [path]
    if not path.is_dir():
        raise RecordingError("this is no recording of a known kind", where=path, remedy=f"give {KINDS}")
    found = list(_search(path))
    if not found:
        raise RecordingError("there is no recording in this folder", where=path, remedy=f"it should hold {KINDS}")
    return found


def _search(folder: Path) -> Iterator[Path]:
    with os.scandir(folder) as entries:
        # Links are not followed: a link to a folder above would never end.
        children = sorted(Path(entry.path) for entry in entries if not entry.is_symlink() or entry.is_file())
    for child in children:
        if child.name.startswith("."):
            continue
        if reader_of(child) is not None:
            yield child
        elif child.is_dir():
            yield from _search(child)
