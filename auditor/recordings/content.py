"""The identity of a recording: a hash of its content, whatever its name and place."""

import hashlib
from pathlib import Path

from auditor.errors import RecordingError

_BLOCK = 1 << 20


def content_id(path: Path, files: tuple[Path, ...]) -> str:
    """sha256 (hex) of a file; of a folder, or a file and its journal, of sorted relative paths and the files' hashes.

    Raises RecordingError where a file cannot be read.
    """
    if files == (path,):
        return _file_hash(path)
    folder = path if path.is_dir() else path.parent
    whole = hashlib.sha256()
    for name, file in sorted((file.relative_to(folder).as_posix(), file) for file in files):
        whole.update(f"{_file_hash(file)}  {name}\n".encode("utf-8", "surrogateescape"))
    return whole.hexdigest()


def _file_hash(path: Path) -> str:
    digest = hashlib.sha256()
    try:
        with path.open("rb") as stream:
            while block := stream.read(_BLOCK):
                digest.update(block)
    except OSError as error:
        raise RecordingError(f"it cannot be read ({error.strerror or error})", where=path) from error
    return digest.hexdigest()
