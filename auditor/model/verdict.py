"""Verdicts on frames, with their evidence; causes that are not attacks; findings; and labels of known attacks."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

JUDGING_VERSION = 40
"""Raised whenever the same measurement and calibration would give other verdicts."""


class JudgedBy(StrEnum):
    """What a measurement is judged by: the prior, the other recordings of its batch, or a calibration."""

    PRIOR = "prior"
    BATCH = "batch"
    LEARNT = "learnt"


class Method(StrEnum):
    """How verdicts are reached: by checks of each sensor and joint identification, or as the paper does."""

    ROBUST = "robust"
    PAPER = "paper"


class Statistic(StrEnum):
    """Which pixels a disparity error counts: all valid ones, or those with texture in a camera of the triple."""

    PLAIN = "plain"
    GATED = "gated"


class VerdictKind(StrEnum):
    """The verdict on one frame."""

    CLEAN = "clean"
    ATTACKED = "attacked"
    UNIDENTIFIED = "unidentified"
    SUSPECT = "suspect"
    NOT_AUDITABLE = "not_auditable"


FINDINGS = frozenset({VerdictKind.ATTACKED, VerdictKind.UNIDENTIFIED, VerdictKind.SUSPECT})


class Evidence(NamedTuple):
    """One check or triple that exceeded its threshold, and by how much.

    By the robust method the normalised score z of a check of the sensor `i`, or of the two cameras `i` and `k` that do
    not see the same; else `j` and `k` are None. By the paper's E - theta of a triple (i, j, k). `check_name` is the
    value of a Check or of a Statistic.
    """

    check_name: str
    i: int
    j: int | None
    k: int | None
    score: float


class Alternative(NamedTuple):
    """Another attack, or none, that may explain a frame, and how much worse it does so than the best one.

    By the robust method the decimal logarithm of how many times less likely it is; by the paper's in elements of e that
    disagree.
    """

    attacked: tuple[int, ...]
    worse_by: float


class Cause(StrEnum):
    """What other than an attack may cause a finding.

    FROZEN: a sensor repeats its data. LATE: it lags behind the others. DISPLACED: it is rotated since its calibration.
    SOILED: dirt or drops on a lens, or whatever else changes what a camera sees as they do. BLURRED: a camera shows far
    less detail than the others, out of focus or behind something that scatters light. BLIND: it shows hardly any of
    the detail that another one shows, or a camera alone showed seconds before or after. EXPOSURE: a camera's exposure,
    gain or tone is not what it usually is beside the others. WHITE_BALANCE: its red against its blue is not. DARK: too
    little light in all cameras. GLARE: light scatters in a camera's lens. RAIN: the LiDAR sees drops all around.
    AEROSOL: it has returns that scatter as those of dust, steam and exhaust.
    """

    FROZEN = "frozen"
    LATE = "late"
    DISPLACED = "displaced"
    SOILED = "soiled"
    BLURRED = "blurred"
    BLIND = "blind"
    EXPOSURE = "exposure"
    WHITE_BALANCE = "white_balance"
    DARK = "dark"
    GLARE = "glare"
    RAIN = "rain"
    AEROSOL = "aerosol"


CauseIn = tuple[Cause, int | None]
"""A cause and the sensor that it affects, None for all cameras."""


class FaultHypothesis(NamedTuple):
    """A cause and the sensor that it affects, None for all cameras.

    `score` is 0 to 1; from 0.5 on the fault score is larger than in clean frames.
    """

    cause: Cause
    sensor: int | None
    score: float = 1.0


class Finding(NamedTuple):
    """The event that a frame belongs to: an incident, or an `alert`, which is told and found all the same.

    `kind` and `attacked` are what most of the event's evidence speaks for; of an alert, and where the frames of an
    incident name different sensors, what the frame itself does. `event` numbers the events of a recording from 1.
    `added` is what this frame adds to the evidence.
    """

    kind: VerdictKind
    attacked: tuple[int, ...]
    event: int = 1
    alert: bool = False
    added: float = 0.0


@dataclass(frozen=True)
class Verdict:
    """The verdict on one frame.

    `e` has one character a triple of the rig: '0', '1', or '-' where nothing was measured. `attacked` is set where
    kind is ATTACKED. `named` is Algorithm 2's answer whatever the kind (None where it has none). `out_of_system` are
    the sensors that could not take part. `gap` is how sure it is: by the paper's method the smallest |E - theta|
    among the measured elements, how far a disparity error would have to move to change e; by the robust method by
    how many standard deviations the strongest sensor exceeds the next, or the limit; of a clean frame how far it stays
    below it. `evidence` is the strongest first, `alternatives` the next best
    first. Of a finding of the robust method `posterior` is the probability of the likeliest attack set, that of
    `attacked` or the first alternative, and `log10_ratio` the decimal logarithm of its likelihood ratio against no
    attack (`identification.likelihood`); else None. `causes` are the fault hypotheses. `finding` is the robust
    method's, None where the frame belongs to no event; a frame that is clean by itself may belong to an incident, too.
    """

    kind: VerdictKind
    e: str
    attacked: tuple[int, ...] = ()
    named: tuple[int, ...] | None = None
    out_of_system: tuple[int, ...] = ()
    gap: float | None = None
    reason: str = ""
    evidence: tuple[Evidence, ...] = ()
    alternatives: tuple[Alternative, ...] = ()
    causes: tuple[FaultHypothesis, ...] = ()
    finding: Finding | None = None
    posterior: float | None = None
    log10_ratio: float | None = None

    @property
    def in_incident(self) -> bool:
        """Whether the robust method holds the frame for part of an incident; a single-frame event is none."""
        return self.finding is not None and not self.finding.alert

    @property
    def in_alert(self) -> bool:
        """Whether the robust method tells the frame as part of an alert."""
        return self.finding is not None and self.finding.alert


@dataclass(frozen=True)
class AttackLabel:
    """Ground truth: from `from_ns` to `to_ns` (stamps, both included) the data of `topic` was attacked."""

    topic: str
    attack: str
    from_ns: int
    to_ns: int
    parameters: Mapping[str, object]
