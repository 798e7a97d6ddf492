"""Parts of an evaluation on their way into the store: one file of cases a part, finished by a row of its own."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import KW_ONLY, asdict, dataclass
from datetime import datetime
from typing import ClassVar, Protocol

from auditor.results import EXPERIMENTS_VERSION, Procedure
from auditor.store.records import to_utc
from auditor.store.schema import SCHEMA_VERSION
from auditor.store.store import Store
from auditor.store.tables import Row, TableWriter, read_rows, write_rows, writing


@dataclass(frozen=True)
class Part(ABC):
    """One experiment on one stretch of a recording: the columns of its row of the table `manifest`.

    Its cases are rows of the table `table`. `seed` and `draws` are None where nothing is drawn; each `attack_every`-th
    frame was attacked, None where none was.
    """

    manifest: ClassVar[str]
    table: ClassVar[str]

    _: KW_ONLY
    recording_id: str
    name: str
    synthetic: bool
    rig_id: str
    procedure: Procedure
    experiment: str
    seed: int | None
    draws: int | None
    stretch: int
    attack_every: int | None = None
    experiments_version: int = EXPERIMENTS_VERSION

    @property
    @abstractmethod
    def evaluation_id(self) -> str:
        """The id that follows from what decides everything that is measured for the part."""


class Case(Protocol):
    """What was measured under one set of attacks."""

    def row(self) -> Row: ...  # noqa: D102 - its columns, but for the part's id


class PartWriter:
    """Takes the cases of one part, and makes them finished with `commit`."""

    def __init__(self, part: Part, store: Store, table: TableWriter) -> None:
        self._part = part
        self._store = store
        self._table = table
        self._cases = 0

    def add(self, case: Case) -> None:
        """Take one case."""
        self._table.add({**case.row(), "evaluation_id": self._part.evaluation_id})
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
        write_rows(part.manifest, self._store.path(part.manifest, part.evaluation_id), [row])


@contextmanager
def part_writer(store: Store, part: Part) -> Iterator[PartWriter]:
    """Write the cases of a part; without a `commit` inside the block, nothing of them stays. Raises StoreError."""
    with writing(part.table, store.path(part.table, part.evaluation_id)) as table:
        yield PartWriter(part, store, table)


def finished_part(store: Store, part: Part) -> bool | None:
    """None where a part is not finished; else whether the recording ends in it. Raises StoreError."""
    path = store.path(part.manifest, part.evaluation_id)
    return bool(read_rows(part.manifest, path)[0]["last"]) if path.is_file() else None
