"""Which packs there are, and which of their rows count no longer: one small file, which is replaced whole.

A pack is `packs/<table>/<id>.parquet`. A file of an id of its own, in the table's folder, goes before the rows that a
pack has of it. A pack that the index does not name is read by nobody.
"""

import csv
import io
import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow as pa

from auditor.errors import StoreError
from auditor.store.files import finished, locked, make_folder, write_whole
from auditor.store.schema import id_column

if TYPE_CHECKING:
    from auditor.store.log.runs import Run

INDEX = "packs.csv"
FOLDER = "packs"
MEMBERS = b"members"
"""The key of a pack's metadata that has its members."""

PACKED = (
    "recordings",
    "labels",
    "measurements",
    "frames",
    "cells",
    "fault_features",
    "regions",
    "poses",
    "judgements",
    "verdicts",
)
"""Tables with a file a recording, measurement or judgement; of all others there are few."""

_COLUMNS = ("what", "table", "id")
_PACK, _REMOVED = "pack", "removed"


@dataclass(frozen=True)
class Member:
    """The rows of one id: which file they were packed from, and the row group of the pack that has them, if any has."""

    row_id: str
    size: int
    sha256: str
    group: int | None


@dataclass(frozen=True)
class PackPart:
    """Where the rows of an id lie within a pack."""

    path: Path
    column: str
    row_id: str
    group: int | None


@dataclass(frozen=True)
class Index:
    """By table the ids of its packs, and the ids whose rows in packs count no longer."""

    packs: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    removed: Mapping[str, frozenset[str]] = field(default_factory=dict)

    @property
    def content(self) -> bytes:
        """As the file has it."""
        text = io.StringIO()
        rows = csv.writer(text, lineterminator="\n")
        rows.writerow(_COLUMNS)
        for kind, tables in ((_PACK, self.packs), (_REMOVED, self.removed)):
            rows.writerows((kind, table, one) for table in sorted(tables) for one in sorted(tables[table]))
        return text.getvalue().encode()


def read_index(folder: Path) -> Index:
    """The index of the store in a folder; an empty one where nothing was packed. Raises StoreError."""
    try:
        header, *rows = csv.reader((folder / INDEX).read_text(encoding="utf-8").splitlines())
        tables: dict[str, dict[str, list[str]]] = {_PACK: {}, _REMOVED: {}}
        for kind, table, row_id in rows:
            tables[kind].setdefault(table, []).append(row_id)
    except FileNotFoundError:
        return Index()
    except (OSError, ValueError, KeyError) as error:
        raise StoreError(f"it cannot be read ({error})", where=folder / INDEX) from error
    if tuple(header) != _COLUMNS:
        raise StoreError("it is no index of packs", where=folder / INDEX)
    packs = {table: tuple(ids) for table, ids in tables[_PACK].items()}
    return Index(packs, {table: frozenset(ids) for table, ids in tables[_REMOVED].items()})


def pack_path(folder: Path, table: str, pack_id: str) -> Path:
    """Where a pack lies."""
    return folder / FOLDER / table / f"{pack_id}.parquet"


def members_of(path: Path) -> dict[str, Member]:
    """The members of a pack by id, in their order. Raises StoreError."""
    import pyarrow.parquet as pq  # noqa: PLC0415 - heavy, and most stores have no packs

    try:
        listed = json.loads((pq.read_metadata(path).metadata or {})[MEMBERS])
        return {one[0]: Member(*one) for one in listed}
    except (OSError, pa.ArrowException, ValueError, KeyError, TypeError) as error:
        raise StoreError(f"it is no readable pack ({error})", where=path) from error


def index_lock(folder: Path) -> AbstractContextManager[None]:
    """Nobody else packs, or removes rows from packs, within the block. Raises StoreError."""
    make_folder(folder / FOLDER)
    return locked(folder / FOLDER)


class Packs:
    """The packs of one store, as its index has them now; `without` those in some places, of which nothing is read."""

    def __init__(self, folder: Path, without: Collection[str] = ()) -> None:
        self._folder = folder
        self._without = frozenset(without)
        self._read: tuple[int, int] | None = None
        self._index = Index()
        self._members: dict[Path, dict[str, Member]] = {}
        self._packs: dict[str, tuple[Index, dict[str, Path]]] = {}

    @property
    def index(self) -> Index:
        """The index, read again where it was replaced."""
        try:
            status = (self._folder / INDEX).stat()
        except FileNotFoundError:
            return Index()
        if INDEX in self._without:
            return Index()
        if self._read != (status.st_ino, status.st_mtime_ns):
            self._index, self._read = read_index(self._folder), (status.st_ino, status.st_mtime_ns)
        return self._index

    def paths(self, table: str) -> list[Path]:
        """The packs of a table."""
        packs = self.index.packs.get(table, ())
        read = [one for one in packs if f"{FOLDER}/{table}/{one}.parquet" not in self._without]
        return [pack_path(self._folder, table, one) for one in read]

    def members(self, path: Path) -> Mapping[str, Member]:
        """The members of a pack, removed ones too."""
        if path not in self._members:
            self._members[path] = members_of(path)
        return self._members[path]

    def ids(self, table: str) -> set[str]:
        """The ids of a table whose rows packs have."""
        return self._packs_of(table).keys() - self.index.removed.get(table, frozenset())

    def member(self, table: str, row_id: str) -> tuple[Path, Member] | None:
        """The pack that has the rows of an id, and what it says of them; None where none has."""
        path = self._packs_of(table).get(row_id)
        if path is None or row_id in self.index.removed.get(table, ()):
            return None
        return path, self.members(path)[row_id]

    def _packs_of(self, table: str) -> Mapping[str, Path]:
        """By id the pack that has its rows, of several the first; put together once for each index."""
        index, entry = self.index, self._packs.get(table)
        if entry is None or entry[0] is not index:
            entry = index, {one: path for path in reversed(self.paths(table)) for one in self.members(path)}
            self._packs[table] = entry
        return entry[1]

    def part(self, table: str, row_id: str) -> PackPart | None:
        """Where the rows of an id lie; None where no pack has them."""
        member = self.member(table, row_id)
        return member and PackPart(member[0], id_column(table), row_id, member[1].group)

    def hide(self, rows: Mapping[str, Collection[str]], entry: "Run") -> None:
        """The rows of some ids count no longer, by table; all of them go at one moment. Raises StoreError."""
        if not (self._folder / FOLDER).is_dir():
            return
        with index_lock(self._folder):
            index = self.index
            removed = dict(index.removed)
            for table, ids in self._packed(rows):
                removed[table] = removed.get(table, frozenset()) | ids
            if removed != index.removed:
                write_whole(self._folder / INDEX, Index(index.packs, removed).content, entry.announce)

    def _packed(self, rows: Mapping[str, Collection[str]]) -> Iterator[tuple[str, frozenset[str]]]:
        for table, ids in rows.items():
            packed = frozenset(one for one in ids if self.member(table, one) is not None)
            if packed:
                yield table, packed


@dataclass(frozen=True)
class Files:
    """Files of a table: those of one id `alone`, packs, and the ids whose rows in packs do not count."""

    alone: tuple[Path, ...]
    packs: tuple[Path, ...]
    hidden: frozenset[str]


def finished_files(packs: Packs, folder: Path, table: str, ids: Sequence[str]) -> Files:
    """The files of a table that have these ids. Raises StoreError where one is missing."""
    alone, packed = set(finished(folder / table)), packs.ids(table)
    for row_id in ids:
        if row_id not in alone and row_id not in packed:
            remedy = "measure or judge again into a new store"
            raise StoreError("a finished file is missing", where=folder / table / f"{row_id}.parquet", remedy=remedy)
    counting = packed.intersection(ids) - alone
    used = [path for path in packs.paths(table) if not counting.isdisjoint(packs.members(path))]
    hidden = {one for path in used for one in packs.members(path)} - counting
    own = (folder / table / f"{one}.parquet" for one in ids if one in alone)
    return Files(tuple(own), tuple(used), frozenset(hidden))
