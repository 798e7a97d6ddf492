"""The identity of a recording: a hash of its content, whatever its name and place."""

import hashlib
from pathlib import Path

_BLOCK = 1 << 20


def content_id(path: Path, files: tuple[Path, ...]) -> str:
    """sha256 (hex) of a file; of a folder, of its sorted relative paths and the hashes of those files."""
    if not path.is_dir():
        return _file_hash(path)
    whole = hashlib.sha256()
    for name, file in sorted((file.relative_to(path).as_posix(), file) for file in files):
        whole.update(f"{_file_hash(file)}  {name}\n".encode("utf-8", "surrogateescape"))
    return whole.hexdigest()


def _file_hash(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as stream:
        while block := stream.read(_BLOCK):
            digest.update(block)
    return digest.hexdigest()
