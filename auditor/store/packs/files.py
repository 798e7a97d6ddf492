"""The finished files of a table: those of one id alone, and packs."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from auditor.errors import StoreError
from auditor.store.files import finished
from auditor.store.packs.index import Packs


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
