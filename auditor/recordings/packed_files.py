"""Files of a recording as they are read: themselves, or what a file that rosbag2 compressed as a whole holds."""

import tempfile
from dataclasses import dataclass
from pathlib import Path
from shutil import disk_usage
from typing import IO

from auditor.errors import RecordingError
from auditor.recordings.unpacking import unpack_file

PACKED = ".zstd"
"""What rosbag2 appends to the names of files that it compressed (compression mode `file`)."""


@dataclass(frozen=True)
class Source:
    """One file of a recording: its name, where its content is read, and what of it could not be unpacked."""

    name: str
    path: Path
    problem: str = ""
    _unpacked: IO[bytes] | None = None

    def close(self) -> None:
        """Give back the room that the unpacked content takes."""
        if self._unpacked is not None:
            self._unpacked.close()


def source_of(file: Path) -> Source:
    """A file, unpacked where it is packed. Raises RecordingError where there is no room for it."""
    if file.suffix.lower() != PACKED:
        return Source(file.name, file)
    # It has no name in any folder: were this process killed, nothing of it would stay.
    unpacked = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as the recording
    try:
        with file.open("rb") as packed:
            problem = unpack_file(packed, unpacked, disk_usage(tempfile.gettempdir()).free // 2)
        unpacked.flush()
    except OSError as error:
        unpacked.close()
        raise RecordingError(
            f"it cannot be unpacked ({error.strerror or error})", where=file, remedy="make room, or unpack it with zstd"
        ) from error
    return Source(file.stem, Path(f"/proc/self/fd/{unpacked.fileno()}"), problem, unpacked)


def kind_of(path: Path) -> str:
    """The ending of a file's name in lower case, that of what it holds where it is packed."""
    return Path(path.stem).suffix.lower() if path.suffix.lower() == PACKED else path.suffix.lower()
