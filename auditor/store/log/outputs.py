"""A finished file: its place, its size and its sha256."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from auditor.errors import StoreError
from auditor.store.files import Written, hash_stream


@dataclass(frozen=True)
class Output:
    """A finished file; `path` is its place in the store with `/`, or a whole path where it lies elsewhere."""

    path: str
    size: int
    sha256: str

    @property
    def fields(self) -> dict[str, Any]:
        """As the column `outputs` and the log have it."""
        return {"path": self.path, "size": self.size, "sha256": self.sha256}

    @classmethod
    def of_written(cls, written: Written, folder: Path) -> "Output":
        """A file that was written, of the store in a folder."""
        return cls(place_in(folder, written.path), written.size, written.sha256)

    @classmethod
    def of_fields(cls, fields: Mapping[str, Any]) -> "Output":
        """The output of a row of the column `outputs`, or of an entry of the log."""
        return cls(fields["path"], fields["size"], fields["sha256"])


def hash_file(path: Path) -> tuple[int, str]:
    """Size and sha256 of a file. Raises StoreError where it cannot be read."""
    try:
        with path.open("rb") as file:
            return hash_stream(file)
    except FileNotFoundError as error:
        raise StoreError("it is missing", where=path) from error
    except OSError as error:
        raise StoreError(f"it cannot be read ({error.strerror or error})", where=path) from error


def output_of(path: Path, folder: Path) -> Output:
    """What lies at a path, of the store in a folder. Raises StoreError where it cannot be read."""
    return Output(place_in(folder, path), *hash_file(path))


def place_in(folder: Path, path: Path) -> str:
    """A path as entries have it: from the store's folder on where it lies in there."""
    return path.relative_to(folder).as_posix() if path.is_relative_to(folder) else str(path)
