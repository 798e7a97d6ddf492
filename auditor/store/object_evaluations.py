"""Parts of the object-level baseline: how well sensors agreed on objects, one file of cases a part."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from datetime import datetime

from auditor.results import EXPERIMENTS_VERSION, Procedure
from auditor.store.records import content_id, to_utc
from auditor.store.schema import SCHEMA_VERSION
from auditor.store.store import Store
from auditor.store.tables import TableWriter, read_rows, write_rows, writing


@dataclass(frozen=True)
class ObjectPart:
    """One experiment on one stretch of a recording; `seed` and `draws` are None where nothing is drawn.

    `labels` is the hash of the files of labels, None without any. Each `attack_every`-th frame was attacked; None where
    none was.
    """

    recording_id: str
    name: str
    synthetic: bool
    rig_id: str
    procedure: Procedure
    detector: str
    detector_settings: str
    experiment: str
    seed: int | None
    draws: int | None
    labels: str | None
    stretch: int
    attack_every: int | None = None
    experiments_version: int = EXPERIMENTS_VERSION

    @property
    def evaluation_id(self) -> str:
        """The id that follows from what decides every box of the part."""
        decides = (self.recording_id, self.rig_id, asdict(self.procedure), self.experiments_version, self.experiment)
        drawn = (self.seed, self.draws, self.attack_every)
        return content_id("objects", *decides, self.detector_settings, *drawn, self.labels, self.stretch)


@dataclass(frozen=True)
class ObjectCase:
    """One case; `best_iou` follows the rig's triples, None where one was not compared, `scored` are rows of its column.

    The other fields are as in the table `object_cases`.
    """

    frame: int
    stamp_ns: int
    draw: int
    attacked: tuple[int, ...]
    strength: str | None
    size: float | None
    visible_share: float | None
    best_iou: Sequence[Sequence[float] | None]
    scored: Sequence[Mapping[str, object]]


class ObjectCasesWriter:
    """Takes the cases of one part, and makes them finished with `commit`."""

    def __init__(self, part: ObjectPart, store: Store, table: TableWriter) -> None:
        self._part = part
        self._store = store
        self._table = table
        self._cases = 0

    def add(self, case: ObjectCase) -> None:
        """Take one case."""
        self._table.add({**vars(case), "evaluation_id": self._part.evaluation_id, "attacked": list(case.attacked)})
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
        write_rows("object_evaluations", self._store.path("object_evaluations", part.evaluation_id), [row])


@contextmanager
def object_cases_writer(store: Store, part: ObjectPart) -> Iterator[ObjectCasesWriter]:
    """Write the cases of a part; without a `commit` inside the block, nothing of them stays. Raises StoreError."""
    with writing("object_cases", store.path("object_cases", part.evaluation_id)) as table:
        yield ObjectCasesWriter(part, store, table)


def finished_object_part(store: Store, part: ObjectPart) -> bool | None:
    """None where a part is not finished; else whether the recording ends in it. Raises StoreError."""
    path = store.path("object_evaluations", part.evaluation_id)
    return bool(read_rows("object_evaluations", path)[0]["last"]) if path.is_file() else None
