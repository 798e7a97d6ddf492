"""Parts of an evaluation: what was measured of attacks made in memory, one file of cases a part."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, asdict, dataclass
from decimal import Decimal

from auditor.results import Counts, VerdictKind
from auditor.store.parts import Part
from auditor.store.records import content_id
from auditor.store.store import Store
from auditor.store.tables import Row, write_rows

JUDGED_R = Decimal("0.01")
"""The designated false-alarm rate that the robust method judges cases at."""

BLOCK_FRAMES = 10
"""Frames that it holds out together, in blocks of time."""

INTERVAL_FRAMES = 10
"""Frames that an attack of the experiment `intervals` lasts."""

_PIXELS = ("valid_px", "inconsistent_px", "gated_valid_px", "gated_inconsistent_px")


@dataclass(frozen=True)
class EvaluationPart(Part):
    """One of the paper's experiments, or of those beyond it.

    `inputs` tells apart the files that its attacks were made from, where there are any.
    """

    manifest = "evaluations"
    table = "cases"

    _: KW_ONLY
    inputs: str | None = None

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

    def row(self) -> Row:
        """Its columns."""
        return {
            **vars(self),
            "attacked": list(self.attacked),
            "ratios": list(self.ratios),
            "parameters": json.dumps(self.parameters, sort_keys=True),
            **{name: [c and getattr(c, name) for c in self.counts] for name in _PIXELS},
        }


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
