"""Parts of an evaluation, one file of cases each, finished by a row of its own."""

import json
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import KW_ONLY, asdict, dataclass
from datetime import datetime
from decimal import Decimal
from typing import Any, ClassVar, Protocol

from auditor.model.measurement import EXPERIMENTS_VERSION, Counts, Procedure
from auditor.model.verdict import FaultHypothesis, VerdictKind
from auditor.store.log.entry import OutputFile
from auditor.store.log.runs import logged
from auditor.store.records import content_id, to_utc
from auditor.store.schema import SCHEMA_VERSION
from auditor.store.store import Store
from auditor.store.tables import Row, TableWriter, read_rows, writing


@dataclass(frozen=True)
class ExperimentChunk(ABC):
    """One experiment on one chunk of a recording: the columns of its row of the table `manifest`.

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
    chunk: int
    attack_every: int | None = None
    experiments_version: int = EXPERIMENTS_VERSION

    @property
    @abstractmethod
    def evaluation_id(self) -> str:
        """The id that follows from what decides everything that is measured for the part."""


class CaseRow(Protocol):
    """What was measured under one set of attacks."""

    def row(self) -> Row: ...  # noqa: D102 - its columns, but for the part's id


class PartWriter:
    """Takes the cases of one part, and makes them finished with `commit`."""

    def __init__(self, part: ExperimentChunk, store: Store, table: TableWriter) -> None:
        self._part = part
        self._store = store
        self._table = table
        self._cases = 0

    def add(self, case: CaseRow) -> None:
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
        written = OutputFile.of_written(self._table.commit(), self._store.folder)
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
            "outputs": [written.fields],
        }
        self._store.write(part.manifest, part.evaluation_id, [row])


@contextmanager
def part_writer(store: Store, part: ExperimentChunk) -> Iterator[PartWriter]:
    """Write the cases of a part; without a `commit` inside the block, nothing of them stays. Raises StoreError."""
    with writing(part.table, store.path(part.table, part.evaluation_id)) as table:
        yield PartWriter(part, store, table)


def finished_part(store: Store, part: ExperimentChunk) -> bool | None:
    """None where a part is not finished; else whether the recording ends in it. Raises StoreError."""
    path = store.path(part.manifest, part.evaluation_id)
    return bool(read_rows(part.manifest, path)[0]["last"]) if path.is_file() else None


JUDGED_R = Decimal("0.01")
"""The designated false-alarm rate that the robust method judges cases at."""


CHUNK_FRAMES = 10
"""Frames that it holds out together, in blocks of time."""


INTERVAL_FRAMES = 10
"""Frames that an attack of the experiment `intervals` lasts."""

LASTING = "lasting"
"""The variant of its attacks that last for all of a recording, or for each of its intervals that is attacked."""


_PIXELS = ("valid_px", "inconsistent_px", "gated_valid_px", "gated_inconsistent_px")


@dataclass(frozen=True)
class EvaluationPart(ExperimentChunk):
    """One of the paper's experiments, or of those beyond it.

    `inputs` tells apart the files that its attacks were made from, where there are any. `family` names what the
    recording is alike with; None where it is like no other.
    """

    manifest = "evaluations"
    table = "cases"

    _: KW_ONLY
    inputs: str | None = None
    family: str | None = None

    @property
    def evaluation_id(self) -> str:
        """The id that follows from what decides every count of the part."""
        decides = (self.recording_id, self.rig_id, asdict(self.procedure), self.experiments_version, self.experiment)
        drawn = (self.seed, self.draws, self.attack_every, self.inputs)
        return content_id("evaluation", *decides, *drawn, self.chunk)


@dataclass(frozen=True)
class CaseFeatures:
    """What separates faults and frozen sensors from attacks in one case.

    By sensor whether it was `present`, its `fingerprint`, and what BRIGHTNESS names of cameras; None where it
    has none. `fault_features` are the fault features of one matched pair after the other, each in the order of
    `fault_features.COLUMNS`, None where not measured; `fault_features_after` those of the clean frame behind it, in
    which data of the frame before are compared as well. `returns` are the LiDAR points in the leftmost reference's
    view, None where there are none to compare.
    """

    present: Sequence[bool]
    fingerprint: Sequence[int | None]
    brightness: Mapping[str, Sequence[float | None]]
    fault_features: Sequence[float | None]
    fault_features_after: Sequence[float | None]
    returns: int | None = None


@dataclass(frozen=True)
class MeasuredCase:
    """The counts of one case in the order of the rig's triples, its statistics in that of its sensor checks.

    The other fields are as in the table `cases`.
    """

    frame: int
    stamp_ns: int
    draw: int
    attacked: tuple[int, ...]
    attack: str | None
    strength: str | None
    size: float | None
    visible_share: float | None
    parameters: Mapping[str, object]
    counts: Sequence[Counts | None]
    statistics: Sequence[float | None]
    features: CaseFeatures

    def row(self) -> Row:
        """Its columns."""
        return {
            **vars(self),
            **vars(self.features),
            **self.features.brightness,
            "attacked": list(self.attacked),
            "statistics": list(self.statistics),
            "parameters": json.dumps(self.parameters, sort_keys=True),
            **{name: [c and getattr(c, name) for c in self.counts] for name in _PIXELS},
        }


@dataclass(frozen=True)
class CaseVerdict:
    """The verdict of a scan on one case, judged by some sensors with thresholds that leave out some clean frames.

    The fields are those of the table `case_verdicts`; `drives` is how many clean recordings the thresholds come from.
    """

    frame: int
    stamp_ns: int
    draw: int
    attacked: tuple[int, ...]
    attack: str | None
    strength: str | None
    size: float | None
    system: tuple[int, ...]
    left_out: str
    drives: int
    verdict: VerdictKind
    identified: tuple[int, ...]
    window_kind: VerdictKind | None = None
    window_named: tuple[int, ...] = ()
    event: int | None = None
    causes: tuple[FaultHypothesis, ...] = ()
    largest_z: float | None = None
    limit_z: float | None = None


def write_case_verdicts(store: Store, evaluation_id: str, verdicts: Iterable[CaseVerdict]) -> None:
    """Keep the verdicts on the cases of one part, in place of earlier ones. Raises StoreError."""
    rows = (
        {
            **vars(one),
            "evaluation_id": evaluation_id,
            "attacked": list(one.attacked),
            "system": list(one.system),
            "r": JUDGED_R,
            "verdict": one.verdict.value,
            "identified": list(one.identified),
            "window_kind": one.window_kind and one.window_kind.value,
            "window_named": list(one.window_named),
            "causes": [cause._asdict() for cause in one.causes],
        }
        for one in verdicts
    )
    store.write("case_verdicts", evaluation_id, rows)


CaseKey = tuple[str, int, int, tuple[int, ...], str | None, str | None, float | None]
"""A case of an evaluation: its part's id, frame, draw, attacked sensors, attack, strength and size."""


def case_key(row: Mapping[str, Any]) -> CaseKey:
    """The case that a row tells of, which has the columns of a key."""
    attacked = tuple(row["attacked"])
    return row["evaluation_id"], row["frame"], row["draw"], attacked, row["attack"], row["strength"], row["size"]


@dataclass(frozen=True)
class MissedPicture:
    """What was attacked in a missed case, as a JPEG; `reason` says why there is none."""

    case: CaseKey
    jpeg: bytes | None
    reason: str | None = None

    def row(self) -> Row:
        """Its columns."""
        names = ("evaluation_id", "frame", "draw", "attacked", "attack", "strength", "size")
        case = dict(zip(names, self.case, strict=True))
        return {**case, "attacked": list(self.case[3]), "jpeg": self.jpeg, "reason": self.reason}


def write_missed_pictures(store: Store, pictures: Sequence[MissedPicture]) -> None:
    """Keep the pictures of missed cases, in place of all earlier ones. Raises StoreError."""
    by_part: dict[str, list[Row]] = {earlier: [] for earlier in store.ids("missed_pictures")}
    for picture in pictures:
        by_part.setdefault(picture.case[0], []).append(picture.row())
    with logged(store.folder):
        for evaluation_id, rows in by_part.items():
            store.write("missed_pictures", evaluation_id, rows)


def missed_pictures(store: Store) -> dict[CaseKey, MissedPicture]:
    """The pictures of missed cases that are kept. Raises StoreError."""
    rows = (
        row
        for evaluation_id in store.ids("missed_pictures")
        for row in read_rows("missed_pictures", store.source("missed_pictures", evaluation_id))
    )
    return {case_key(row): MissedPicture(case_key(row), row["jpeg"], row["reason"]) for row in rows}


@dataclass(frozen=True)
class ObjectPart(ExperimentChunk):
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
        return content_id("objects", *decides, self.detector_settings, *drawn, self.labels, self.chunk)


@dataclass(frozen=True)
class ObjectCase:
    """One case; `best_iou` and `scores` follow the rig's triples, None where one was not compared.

    `scored` are rows of its column. The other fields are as in the table `object_cases`.
    """

    frame: int
    stamp_ns: int
    draw: int
    attacked: tuple[int, ...]
    strength: str | None
    size: float | None
    visible_share: float | None
    best_iou: Sequence[Sequence[float] | None]
    scores: Sequence[Sequence[float] | None]
    scored: Sequence[Mapping[str, object]]

    def row(self) -> Row:
        """Its columns."""
        return {**vars(self), "attacked": list(self.attacked)}
