"""Folders that appear whole or not at all, for their owner alone."""

import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from auditor.errors import SettingError
from auditor.store.files import close_to_others, for_owner


@contextmanager
def new_folder(target: Path) -> Iterator[Path]:
    """A folder beside the target to write to; at the end it gets its name, and after an error nothing stays.

    Raises SettingError where the target exists, or cannot be written.
    """
    beside = target.with_name(f".{target.name}.{secrets.token_hex(8)}.part")
    try:
        if target.exists() or target.is_symlink():
            raise SettingError("it exists already", where=target, remedy="choose another name, or remove it")
        target.parent.mkdir(parents=True, exist_ok=True)
        beside.mkdir(0o700)
        yield beside
        close_to_others(beside)
        beside.rename(target)
    except OSError as error:
        raise SettingError(f"it cannot be written ({error.strerror or error})", where=target) from error
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def write_file(path: Path, content: bytes) -> None:
    """Write a file for its owner alone, and the folders that it needs. Raises OSError."""
    path.parent.mkdir(0o700, parents=True, exist_ok=True)
    with open(path, "xb", opener=for_owner) as file:
        file.write(content)


@contextmanager
def new_file(target: Path) -> Iterator[Path]:
    """The same for a file, which its user makes. Raises SettingError where the target exists or cannot be written."""
    beside = target.with_name(f".{target.name}.{secrets.token_hex(8)}.part")
    try:
        if target.exists() or target.is_symlink():
            raise SettingError("it exists already", where=target, remedy="choose another name, or remove it")
        beside.touch(0o600)
        yield beside
        beside.rename(target)
    except OSError as error:
        raise SettingError(f"it cannot be written ({error.strerror or error})", where=target) from error
    finally:
        beside.unlink(missing_ok=True)
