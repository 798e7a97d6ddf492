"""The folder of a store: which files of which ids are finished, and where they lie. A question needs no more of it."""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Self

from auditor.store.files import checked_id, finished, remove_abandoned
from auditor.store.marker import MARKER, marked_folder
from auditor.store.packs.index import Files, Packs, finished_files
from auditor.store.schema import MANIFESTS, TABLES


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
        known = sorted(packed.union(finished(self.folder / manifest))) if packed else finished(self.folder / manifest)
        return known if manifest not in self._only else [one for one in known if one in self._only[manifest]]

    def files(self, table: str) -> Files:
        """The finished files of a table. Raises StoreError where one is missing that its manifest names."""
        return finished_files(self.packs, self.folder, table, self.ids(table))

    def finished_paths(self, table: str) -> list[Path]:
        """The finished files of a table that nothing is packed of, by id. Raises StoreError."""
        return list(self.files(table).alone)
