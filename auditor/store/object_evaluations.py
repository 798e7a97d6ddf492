"""Parts of the object-level baseline: how well sensors agreed on objects, one file of cases a part."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass

from auditor.results import EXPERIMENTS_VERSION, Procedure
from auditor.store.parts import PartWriter, finished_in
from auditor.store.records import content_id
from auditor.store.store import Store
from auditor.store.tables import writing


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


class ObjectCasesWriter(PartWriter):
    """Takes the cases of one part."""

    def add(self, case: ObjectCase) -> None:
        """Take one case."""
        self.take({**vars(case), "attacked": list(case.attacked)})


@contextmanager
def object_cases_writer(store: Store, part: ObjectPart) -> Iterator[ObjectCasesWriter]:
    """Write the cases of a part; without a `commit` inside the block, nothing of them stays. Raises StoreError."""
    with writing("object_cases", store.path("object_cases", part.evaluation_id)) as table:
        yield ObjectCasesWriter(part, store, table, "object_evaluations")


def finished_object_part(store: Store, part: ObjectPart) -> bool | None:
    """None where a part is not finished; else whether the recording ends in it. Raises StoreError."""
    return finished_in(store, "object_evaluations", part)
