"""The readers, in the order they are asked."""

from functools import cache
from importlib.metadata import entry_points
from pathlib import Path

from auditor.errors import RecordingError
from auditor.recordings.interface import Reader, Recording
from auditor.recordings.kitti import KittiReader
from auditor.recordings.kitti_odometry import KittiOdometryReader
from auditor.recordings.mcap import McapReader
from auditor.recordings.rosbag import Ros1Reader, Ros2Reader

READERS: tuple[tuple[str, Reader], ...] = (
    ("mcap", McapReader()),
    ("bag", Ros1Reader()),
    ("rosbag2", Ros2Reader()),
    ("kitti", KittiReader()),
    ("kitti_odometry", KittiOdometryReader()),
)
"""Built-in readers, each with its name; those of the entry points group `auditor.readers` are asked after them."""

KINDS = "an .mcap, .bag or .db3 file, a rosbag2 folder or a KITTI drive folder"


@cache
def readers() -> tuple[tuple[str, Reader], ...]:
    """All readers, each with its name: the built-in table, then what other packages offer."""
    return READERS + tuple((entry.name, entry.load()()) for entry in entry_points(group="auditor.readers"))


def reader_of(path: Path) -> Reader | None:
    """The first reader that knows the path, or None."""
    return next((reader for _, reader in readers() if reader.detects(path)), None)


def format_of(path: Path) -> str | None:
    """The name of the first reader that knows the path, or None."""
    return next((name for name, reader in readers() if reader.detects(path)), None)


def open_recording(path: Path) -> Recording:
    """Open one recording, as a context manager.

    Raises RecordingError where it is missing, empty, unreadable or of no known kind.
    """
    if not path.exists():
        raise RecordingError("there is no such file or folder", where=path, remedy="check the path")
    reader = reader_of(path)
    if reader is None:
        raise RecordingError("this is no recording of a known kind", where=path, remedy=f"give {KINDS}")
    try:
        if path.is_file() and path.stat().st_size == 0:
            raise RecordingError("the file is empty", where=path, remedy="record or copy it again")
        return reader.open(path)
    except OSError as error:
        raise RecordingError(f"it cannot be read ({error.strerror or error})", where=path) from error
