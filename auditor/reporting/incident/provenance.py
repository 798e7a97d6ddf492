"""What decided the verdicts on a recording: how it was measured, by what it was judged, and the thresholds."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from decimal import Decimal

from auditor.model.calibration import Marks
from auditor.model.measurement import Statistic
from auditor.model.rig import Triple

NO_MARKS = Marks()


@dataclass(frozen=True)
class ThresholdLine:
    """The paper's theta of one triple, and the number N of clean samples that it came from."""

    triple: Triple
    theta: float | None
    samples: int


@dataclass(frozen=True)
class CheckLine:
    """A sensor check of the robust method: the statistic that clean frames are expected to have, and that at the limit.

    `samples` are the clean frames that they were learnt from, 0 where they are the prior; None where there are none.
    """

    check: str
    sensor: int
    others: tuple[int, ...]
    expected: float | None
    theta: float | None
    samples: int


@dataclass(frozen=True)
class FileLine:
    """A file of the store that the page rests on: its place there, its size in bytes, and its hash."""

    path: str
    size: int
    sha256: str


@dataclass(frozen=True)
class Provenance:
    """What was judged, with what, and how.

    `judged_with` is the auditor that judged; `rules` is the digest of `judging_settings`, the parameters that it judged
    by. `files` are those of the store that hold the measurement and the verdicts.
    """

    measurement_id: str
    rig_id: str
    rig_kind: str
    matcher: str
    settings: Mapping[str, object]
    counting_version: int
    versions: Mapping[str, str]
    judgement_id: str = ""
    judged_at: datetime | None = None
    judging_version: int = 0
    judged_with: str = ""
    rules: str = ""
    judging_settings: Mapping[str, object] = field(default_factory=dict)
    files: tuple[FileLine, ...] = ()
    calibration_id: str = ""
    calibrated_on: tuple[str, ...] = ()
    method: str = ""
    statistic: Statistic | None = None
    r: Decimal | None = None
    incidents_per_hour: float | None = None
    score_threshold: float | None = None
    limit: float | None = None
    drives: int | None = None
    resolvable: bool = True
    transferred: bool = False
    marks: Marks = NO_MARKS
    recounted: bool = False
    thresholds: tuple[ThresholdLine, ...] = ()
    checks: tuple[CheckLine, ...] = ()

    @property
    def learnt(self) -> str:
        """What the robust method's thresholds rest on, in words; empty where that is not known."""
        if self.drives is None:
            return ""
        return f"learnt from {self.drives} drive{'' if self.drives == 1 else 's'}" if self.drives else "prior"
