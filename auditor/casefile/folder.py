"""Folders and files that appear whole or not at all, for their owner alone."""

import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from auditor.errors import SettingError
from auditor.store.files import close_to_others, for_owner


@contextmanager
def _beside(target: Path) -> Iterator[Path]:
    """A place beside the target; what is there at the end gets the target's name, and after an error nothing stays.

    Raises SettingError where the target exists, or cannot be written.
    """
    place = target.with_name(f".{target.name}.{secrets.token_hex(8)}.part")
    try:
        if target.exists() or target.is_symlink():
            raise SettingError("it exists already", where=target, remedy="choose another name, or remove it")
        yield place
        place.rename(target)
    except OSError as error:
        raise SettingError(f"it cannot be written ({error.strerror or error})", where=target) from error
    finally:
        if place.is_dir():
            shutil.rmtree(place, ignore_errors=True)
        else:
            place.unlink(missing_ok=True)


@contextmanager
def new_folder(target: Path) -> Iterator[Path]:
    """A folder to write to, which becomes the target at the end. Raises SettingError as `_beside` does."""
    with _beside(target) as folder:
        target.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir(0o700)
        yield folder
        close_to_others(folder)


@contextmanager
def new_file(target: Path) -> Iterator[Path]:
    """The same for a file."""
    with _beside(target) as file:
        file.touch(0o600)
        yield file


def write_file(path: Path, content: bytes) -> None:
    """Write a file for its owner alone, and the folders that it needs. Raises OSError."""
    path.parent.mkdir(0o700, parents=True, exist_ok=True)
    with open(path, "xb", opener=for_owner) as file:
        file.write(content)
