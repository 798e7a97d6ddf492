"""Parts of the object-level baseline: how well sensors agreed on objects, one file of cases a part."""

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, asdict, dataclass

from auditor.store.parts import Part
from auditor.store.records import content_id
from auditor.store.tables import Row


@dataclass(frozen=True)
class ObjectPart(Part):
    """One of the experiments that the baseline is compared in.

    `labels` is the hash of the files of labels, None without any.
    """

    manifest = "object_evaluations"
    table = "object_cases"

    _: KW_ONLY
    detector: str
    detector_settings: str
    labels: str | None

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

    def row(self) -> Row:
        """Its columns."""
        return {**vars(self), "attacked": list(self.attacked)}
