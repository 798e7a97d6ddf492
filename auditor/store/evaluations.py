"""Parts of an evaluation: what was measured of attacks made in memory, one file of cases a part."""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from decimal import Decimal

from auditor.results import EXPERIMENTS_VERSION, Counts, Procedure, VerdictKind
from auditor.store.parts import PartWriter, finished_in
from auditor.store.records import content_id
from auditor.store.store import Store
from auditor.store.tables import write_rows, writing

JUDGED_R = Decimal("0.01")
"""The designated false-alarm rate that the robust method judges cases at."""

BLOCK_FRAMES = 10
"""Frames that it holds out together, in blocks of time."""

INTERVAL_FRAMES = 10
"""Frames that an attack of the experiment `intervals` lasts."""

_PIXELS = ("valid_px", "inconsistent_px", "gated_valid_px", "gated_inconsistent_px")


@dataclass(frozen=True)
class EvaluationPart:
    """One experiment on one stretch of a recording; `seed` and `draws` are None where nothing is drawn.

    `inputs` tells apart the files that its attacks were made from, where there are any. Each `attack_every`-th frame
    was attacked; None where none was.
    """

    recording_id: str
    name: str
    synthetic: bool
    rig_id: str
    procedure: Procedure
    experiment: str
    seed: int | None
    draws: int | None
    stretch: int
    inputs: str | None = None
    attack_every: int | None = None
    experiments_version: int = EXPERIMENTS_VERSION

    @property
    def evaluation_id(self) -> str:
        """The id that follows from what decides every count of the part."""
        decides = (self.recording_id, self.rig_id, asdict(self.procedure), self.experiments_version, self.experiment)
        drawn = (self.seed, self.draws, self.attack_every, self.inputs)
        return content_id("evaluation", *decides, *drawn, self.stretch)


@dataclass(frozen=True)
class MeasuredCase:
    """The counts of one case in the order of the rig's triples, its local ratios in that of its elements.

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
    ratios: Sequence[float | None]


class CasesWriter(PartWriter):
    """Takes the cases of one part."""

    def add(self, case: MeasuredCase) -> None:
        """Take one case."""
        self.take(
            {
                **vars(case),
                "attacked": list(case.attacked),
                "ratios": list(case.ratios),
                "parameters": json.dumps(case.parameters, sort_keys=True),
                **{name: [c and getattr(c, name) for c in case.counts] for name in _PIXELS},
            }
        )


@contextmanager
def cases_writer(store: Store, part: EvaluationPart) -> Iterator[CasesWriter]:
    """Write the cases of a part; without a `commit` inside the block, nothing of them stays. Raises StoreError."""
    with writing("cases", store.path("cases", part.evaluation_id)) as table:
        yield CasesWriter(part, store, table, "evaluations")


def finished_part(store: Store, part: EvaluationPart) -> bool | None:
    """None where a part is not finished; else whether the recording ends in it. Raises StoreError."""
    return finished_in(store, "evaluations", part)


@dataclass(frozen=True)
class CaseVerdict:
    """What the robust method says of one case, judged by some sensors with thresholds that hold out some clean frames.

    The fields are those of the table `case_verdicts`.
    """

    frame: int
    stamp_ns: int
    draw: int
    attacked: tuple[int, ...]
    attack: str | None
    strength: str | None
    size: float | None
    system: tuple[int, ...]
    held_out: str
    samples: int
    verdict: VerdictKind
    accused: tuple[int, ...]
    lasting: VerdictKind | None = None
    lasting_accused: tuple[int, ...] = ()


def write_case_verdicts(store: Store, evaluation_id: str, verdicts: Iterable[CaseVerdict]) -> None:
    """Keep what was said of the cases of one part, in place of what was said before. Raises StoreError."""
    rows = (
        {
            **vars(one),
            "evaluation_id": evaluation_id,
            "attacked": list(one.attacked),
            "system": list(one.system),
            "r": JUDGED_R,
            "verdict": one.verdict.value,
            "accused": list(one.accused),
            "lasting": one.lasting and one.lasting.value,
            "lasting_accused": list(one.lasting_accused),
        }
        for one in verdicts
    )
    write_rows("case_verdicts", store.path("case_verdicts", evaluation_id), rows)
