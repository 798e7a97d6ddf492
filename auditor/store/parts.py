"""Parts of an evaluation on their way into the store: one file of cases a part, finished by a row of its own."""

from collections.abc import Mapping
from dataclasses import asdict
from datetime import datetime
from typing import Protocol

from auditor.results import Procedure
from auditor.store.records import to_utc
from auditor.store.schema import SCHEMA_VERSION
from auditor.store.store import Store
from auditor.store.tables import Row, TableWriter, read_rows, write_rows


class Part(Protocol):
    """One experiment on one stretch of a recording, a dataclass of the columns of its manifest."""

    @property
    def procedure(self) -> Procedure: ...  # noqa: D102 - how it was measured
    @property
    def evaluation_id(self) -> str: ...  # noqa: D102 - follows from all that decides what is measured


class PartWriter:
    """Takes the rows of one part, and makes them finished with `commit`: by a row of the table `manifest`."""

    def __init__(self, part: Part, store: Store, table: TableWriter, manifest: str) -> None:
        self._part = part
        self._path = store.path(manifest, part.evaluation_id)
        self._table = table
        self._manifest = manifest
        self._cases = 0

    def take(self, row: Row) -> None:
        """Take the row of one case."""
        self._table.add({**row, "evaluation_id": self._part.evaluation_id})
        self._cases += 1

    def commit(
        self,
        *,
        frames: int,
        skipped: int,
        last: bool,
        seconds: float,
        versions: Mapping[str, str],
        evaluated_at: datetime,
    ) -> None:
        """Put the cases in their place, then write the row that makes them finished."""
        self._table.commit()
        part = self._part
        row = {
            **vars(part),
            "evaluation_id": part.evaluation_id,
            **asdict(part.procedure),
            "last": last,
            "frames": frames,
            "skipped": skipped,
            "cases": self._cases,
            "seconds": seconds,
            "versions": dict(sorted(versions.items())),
            "evaluated_at": to_utc(evaluated_at),
            "schema_version": SCHEMA_VERSION,
        }
        write_rows(self._manifest, self._path, [row])


def finished_in(store: Store, manifest: str, part: Part) -> bool | None:
    """None where a part is not finished; else whether the recording ends in it. Raises StoreError."""
    path = store.path(manifest, part.evaluation_id)
    return bool(read_rows(manifest, path)[0]["last"]) if path.is_file() else None
