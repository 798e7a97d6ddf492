"""Paths of a command line -> recordings: the table of readers, tried in order."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path

from auditor.errors import RecordingError
from auditor.recordings.formats.kitti.odometry import KittiOdometryReader
from auditor.recordings.formats.kitti.raw import KittiReader
from auditor.recordings.formats.mcap.recording import McapReader
from auditor.recordings.formats.rosbag import Ros1Reader, Ros2Reader
from auditor.recordings.recording import Reader, Recording

READERS: tuple[tuple[str, Reader], ...] = (
    ("mcap", McapReader()),
    ("bag", Ros1Reader()),
    ("rosbag2", Ros2Reader()),
    ("kitti", KittiReader()),
    ("kitti_odometry", KittiOdometryReader()),
)
"""Built-in readers, each with its name; those of the entry points group `auditor.readers` are tried after them."""

KINDS = "an .mcap, .bag or .db3 file, a rosbag2 folder or a KITTI drive folder"


@cache
def readers() -> tuple[tuple[str, Reader], ...]:
    """All readers, each with its name: the built-in table, then those of other packages."""
    return READERS + tuple((entry.name, entry.load()()) for entry in entry_points(group="auditor.readers"))


def reader_of(path: Path) -> Reader | None:
    """The first reader that recognises the path, or None."""
    return next((reader for _, reader in readers() if reader.detects(path)), None)


def format_of(path: Path) -> str | None:
    """The name of the first reader that recognises the path, or None."""
    return next((name for name, reader in readers() if reader.detects(path)), None)


def open_recording(path: Path) -> Recording:
    """Open one recording, as a context manager.

    Raises RecordingError where it is missing, empty, unreadable or of no known kind.
    """
    if not path.exists():
        raise RecordingError("there is no such file or folder", where=path, remedy="check the path")
    reader = reader_of(path)
    if reader is None:
        raise RecordingError("this is not a recording of a known kind", where=path, remedy=f"give {KINDS}")
    try:
        if path.is_file() and path.stat().st_size == 0:
            raise RecordingError("the file is empty", where=path, remedy="record or copy it again")
        return reader.open(path)
    except OSError as error:
        raise RecordingError(f"it cannot be read ({error.strerror or error})", where=path) from error


@dataclass(frozen=True)
class Found:
    """The recordings of a command line, each once, in its order, and one error for each path that gave none."""

    recordings: tuple[Path, ...]
    errors: tuple[RecordingError, ...]


def find_recordings(paths: Sequence[Path]) -> Found:
    """Find the recordings in files and folders; a folder that is not itself a recording is searched in order of names.

    A path without a recording becomes a RecordingError in `errors`; the other paths are still searched.
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
        raise RecordingError("this is not a recording of a known kind", where=path, remedy=f"give {KINDS}")
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
