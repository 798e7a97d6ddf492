"""Files that appear whole or not at all."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from auditor.errors import RecordingError


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A path beside the target to write to; it is renamed into place at the end, and removed after an error.

    Raises RecordingError where it cannot be written.
    """
    with _placed(path) as beside:
        yield beside
        beside.replace(path)


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """The same for a folder; it has its final name from the start, since the files inside are named after it."""
    if path.exists():
        raise RecordingError("it exists already", where=path, remedy="choose another name, or remove it")
    with _placed(path) as above:
        above.mkdir()
        yield above / path.name
        (above / path.name).replace(path)


@contextmanager
def no_remains(path: Path) -> Iterator[None]:
    """Removes at the end what a process that was killed has left of the target."""
    try:
        yield
    finally:
        _remove(_unfinished(path))


@contextmanager
def _placed(path: Path) -> Iterator[Path]:
    """A free path beside the target, in a folder that is there; it is removed at the end. Raises RecordingError."""
    beside = _unfinished(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _remove(beside)
        yield beside
    except OSError as error:
        raise RecordingError(f"it cannot be written ({error.strerror or error})", where=path) from error
    finally:
        _remove(beside)


def _unfinished(path: Path) -> Path:
    return path.with_name(f".{path.name}.part")


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
