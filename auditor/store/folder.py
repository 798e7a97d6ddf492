"""The folder of a store: which files of which ids are finished, and the file that marks it with its schema version.

Whoever writes a store decides what is found: its calibrations and reviews count. A store that lies in a folder of logs
may have been planted there. So the command line takes the store of its working folder unasked only where it was made
here, as git does with the repositories of others.
"""

import json
import os
import shlex
import shutil
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from auditor.errors import StoreError
from auditor.model.text import storable
from auditor.resources import local_path
from auditor.store.files import checked_id, finished, is_part, locked, remove_abandoned, write_whole
from auditor.store.packs.index import FOLDER, INDEX, Files, Packs, finished_files
from auditor.store.schema import MANIFESTS, SCHEMA_VERSION, TABLES, newer_version

MARKER = "store.json"
UPGRADED = ".upgraded"
"""The folder inside a store that an upgrade writes its files into."""

UPGRADED_FROM = (11, 12)
"""The versions that can be upgraded: the last that was published, and what came since."""

_FORMAT = "auditor store"


@dataclass(frozen=True)
class Marker:
    """The schema version of a store, and whether upgraded files are still to be moved into their places."""

    version: int
    moving: bool


def write_marker(folder: Path, *, moving: bool = False) -> None:
    """Mark a folder as a store of this version. Raises StoreError."""
    write_whole(folder / MARKER, marker_content(moving=moving))


def marker_content(*, moving: bool = False) -> bytes:
    """What the marker of a store of this version holds."""
    content = {"format": _FORMAT, "schema_version": SCHEMA_VERSION, **({"moving": True} if moving else {})}
    return json.dumps(content).encode() + b"\n"


def read_marker(folder: Path) -> Marker:
    """The marker of a store of any version. Raises StoreError where it is none."""
    marker = folder / MARKER
    try:
        content = json.loads(marker.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise StoreError(f"it cannot be read ({error})", where=marker) from error
    if not isinstance(content, dict) or content.get("format") != _FORMAT:
        raise StoreError("it is no store's", where=marker, remedy="name another folder")
    version = content.get("schema_version")
    if not isinstance(version, int):
        raise StoreError("it has no schema version", where=marker)
    return Marker(version, bool(content.get("moving")))


def check_marker(folder: Path) -> None:
    """Refuse a store of another version; complete an upgrade that was killed at its end. Raises StoreError."""
    marker = read_marker(folder)
    if marker.version > SCHEMA_VERSION:
        raise newer_version(marker.version, folder)
    if marker.version < SCHEMA_VERSION:
        raise older_version(marker.version, folder)
    if marker.moving:
        with locked(folder):
            move_upgraded(folder)


def older_version(version: int, folder: Path) -> StoreError:
    """The error for a store of an older version: how it is upgraded, and what is lost, or that it cannot be."""
    versions = " and ".join(map(str, UPGRADED_FROM))
    if version not in UPGRADED_FROM:
        return StoreError(
            f"it has schema version {version}, and only {versions} can be upgraded to {SCHEMA_VERSION}",
            where=folder,
            remedy="measure again into a new store",
        )
    return StoreError(
        f"it has schema version {version}, and this auditor reads version {SCHEMA_VERSION}",
        where=folder,
        remedy=f"auditor store upgrade {shlex.quote(str(folder))} upgrades it: measurements and verdicts stay",
    )


def move_upgraded(folder: Path) -> None:
    """Put the files of a finished upgrade in place of the old ones, where that is still to be done.

    May be killed at any time and called again: what lies in the folder UPGRADED has not been moved yet. Raises
    StoreError.
    """
    if not read_marker(folder).moving:
        return
    new = folder / UPGRADED
    try:
        (folder / INDEX).unlink(missing_ok=True)  # what was packed is in files of its own again
        shutil.rmtree(folder / FOLDER, ignore_errors=True)
        for name in (*TABLES, "pictures"):
            if (new / name).is_dir():
                if (folder / name).is_dir():
                    shutil.rmtree(folder / name)
                (new / name).rename(folder / name)
        shutil.rmtree(new, ignore_errors=True)
    except OSError as error:
        raise StoreError(
            f"its upgrade cannot be completed ({error.strerror or error})", where=folder, remedy="run the command again"
        ) from error
    write_marker(folder)


def marked_folder(path: str | Path, *, create: bool) -> Path:
    """The folder of a store of this version at a path, which is made where there is none and `create` says so.

    Raises SettingError for an address such as s3://bucket, and StoreError where the folder holds something else.
    """
    folder = local_path(path).expanduser().resolve()
    if storable(str(folder)) != str(folder):
        raise StoreError("its path is not UTF-8, as Parquet and SQL need it", where=folder, remedy="name another")
    if not (folder / MARKER).exists():
        check_free(folder, create=create)
        write_marker(folder)
        remember_made(folder)
    check_marker(folder)
    return folder


def check_free(folder: Path, *, create: bool) -> None:
    """Refuse a folder that is no store, unless one may be made in it. Raises StoreError."""
    if folder.exists() and not folder.is_dir():
        raise StoreError("it is a file, not a store", where=folder, remedy="name a folder")
    content = [path for path in folder.iterdir() if not is_part(path)] if folder.exists() else []
    if content:
        raise StoreError(
            f"it is no store: it has no {MARKER} but holds {content[0].name!r}",
            where=folder,
            remedy="name a store, or an empty or new folder to make one in",
        )
    if not create:
        raise StoreError("there is no store", where=folder, remedy="measure something into it with auditor scan")


def remember_made(folder: Path) -> None:
    """Remember that a store was made in a folder just now; where nothing can be kept, it has to be named later on."""
    with suppress(OSError):
        _known().parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        with _known().open("a", encoding="utf-8") as file:
            file.write(json.dumps(_identity(folder)) + "\n")


def refuse_foreign(folder: Path) -> None:
    """Raises StoreError where a folder holds a store that was not made here."""
    with suppress(OSError):
        own = json.dumps(_identity(folder.resolve()))
        if own in _known().read_text(encoding="utf-8").splitlines():
            return
    raise StoreError(
        "this store was not made by you on this machine, and its calibrations and reviews decide what is found",
        where=folder,
        remedy=f"name it if you trust it (--store {folder}), or another one",
    )


def _identity(folder: Path) -> list[str | int]:
    """The path, device and inode of a folder: a copy has others."""
    status = folder.stat()
    return [str(folder), status.st_dev, status.st_ino]


def _known() -> Path:
    base = os.environ.get("XDG_STATE_HOME") or Path("~/.local/state").expanduser()
    return Path(base) / "auditor" / "stores"


class StoreFolder:
    """The files of one store. Every method raises StoreError where a file cannot be read, or an id is none."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.packs = Packs(folder)
        self._only: Mapping[str, Collection[str]] = {}

    def __str__(self) -> str:
        return str(self.folder)

    @classmethod
    def open(cls, path: str | Path, *, create: bool = False) -> Self:
        """Open the store in a folder; `create` makes one where the folder is empty or not there yet.

        Raises StoreError where the folder holds something else, or a store of another version, and SettingError for an
        address such as s3://bucket.
        """
        store = cls(marked_folder(path, create=create))
        if create:
            store.remove_abandoned()
        return store

    def only(self, **ids: Collection[str]) -> Self:
        """This store with these ids of some tables alone, as if it had no others: what is asked of it costs as much."""
        part = type(self)(self.folder)
        part._only, part.packs = ids, self.packs
        return part

    @staticmethod
    def is_at(path: Path) -> bool:
        """True where a folder is a store."""
        return (path / MARKER).is_file()

    def path(self, table: str, row_id: str) -> Path:
        """Where a file of an id of its own lies, or would."""
        return self.folder / table / f"{checked_id(row_id)}.parquet"

    def has(self, table: str, row_id: str) -> bool:
        """True where there are rows of an id, or a file for them."""
        return self.path(table, row_id).is_file() or self.packs.member(table, row_id) is not None

    def remove_abandoned(self) -> None:
        """Remove what killed runs left behind; what is being written stays."""
        for folder in (self.folder, *(self.folder / table for table in TABLES), *self.folder.glob("pictures/*")):
            remove_abandoned(folder)

    def ids(self, table: str) -> list[str]:
        """The ids of the finished files of a table, sorted; other rows finish some of them, see MANIFESTS."""
        manifest = MANIFESTS.get(table, table)
        packed = self.packs.ids(manifest)
        ids = sorted(packed.union(finished(self.folder / manifest))) if packed else finished(self.folder / manifest)
        return ids if manifest not in self._only else [one for one in ids if one in self._only[manifest]]

    def files(self, table: str) -> Files:
        """The finished files of a table. Raises StoreError where one is missing that its manifest names."""
        return finished_files(self.packs, self.folder, table, self.ids(table))

    def finished_paths(self, table: str) -> list[Path]:
        """The finished files of a table that nothing is packed of, by id. Raises StoreError."""
        return list(self.files(table).alone)
