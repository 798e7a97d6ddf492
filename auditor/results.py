"""What is measured of a frame and what is said of it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auditor.elements import Element
from auditor.frames import Presence
from auditor.regions import Region
from auditor.shared_parameters import DISPARITY_ERROR_SAMPLES
from auditor.symptoms import Pair, PairSymptoms

COUNTING_VERSION = 4
"""Raised whenever the same frame would give other counts: thresholds and measurements are bound to it."""

JUDGING_VERSION = 1
"""Raised whenever the same measurement and calibration would give other verdicts."""

NO_FINGERPRINT = -1
"""Of a sensor that is not there, or whose data cannot tell whether it stands still."""

EXPERIMENTS_VERSION = 1
"""Raised whenever an evaluation would try other cases from the same seed, or an attack does something else.

Parts of an evaluation are bound to it: what an earlier version finished is measured again, and never pooled with it.
"""

MIN_VALID_PX = DISPARITY_ERROR_SAMPLES.fewest_valid_px
"""Fewer valid pixels than this and a disparity error is not measured."""


class Method(StrEnum):
    """How verdicts are reached: by five witnesses and joint identification, or as the paper does."""

    ROBUST = "robust"
    PAPER = "paper"


class Statistic(StrEnum):
    """Which pixels a disparity error counts: all valid ones, or those with texture in a camera of the triple."""

    PLAIN = "plain"
    GATED = "gated"


@dataclass(frozen=True)
class Counts:
    """Pixels of one triple in one frame; `gated_*` are those with texture.

    `out_of_range_px` (part of the valid ones) are LiDAR pixels nearer than the matcher can see.
    """

    valid_px: int
    inconsistent_px: int
    gated_valid_px: int
    gated_inconsistent_px: int
    out_of_range_px: int

    def disparity_error(self, statistic: Statistic) -> float | None:
        """E: inconsistent over valid pixels; None where fewer than MIN_VALID_PX are valid."""
        if statistic is Statistic.PLAIN:
            valid, inconsistent = self.valid_px, self.inconsistent_px
        else:
            valid, inconsistent = self.gated_valid_px, self.gated_inconsistent_px
        return inconsistent / valid if valid >= MIN_VALID_PX else None


@dataclass(frozen=True)
class Coverage:
    """How much of one sensor could be used in one frame.

    Cameras: shares of saturated and textureless pixels, and of pixels without a disparity (as witness; None for the
    leftmost), and their mean grey `level`. LiDAR: `returns`, the points that fall into the leftmost camera's view.
    """

    saturated_share: float | None = None
    textureless_share: float | None = None
    unmatched_share: float | None = None
    level: float | None = None
    returns: int | None = None


@dataclass(frozen=True, eq=False)
class Cells:
    """How many pixels of each cell were looked at, and how many stand against somebody: (rows, columns) uint8.

    They are stored as the grids' bytes, row by row, which compress to a third of what sparse lists take.
    """

    valid: NDArray[np.uint8]
    against: NDArray[np.uint8]


@dataclass(frozen=True)
class Measurement:
    """One frame, measured. `counts` follows `rig.triples`; None where a sensor of the triple was not there.

    `cells` and `shares` are what the witnesses say, by element: counts on a grid, or the statistic itself.
    `fingerprints` tell by sensor whether its data change from frame to frame, `symptoms` by matched pair what speaks
    for a fault. `regions` are the portions of sensors that would be damaged, were they attacked.
    """

    number: int
    stamp_ns: int
    presence: Mapping[int, Presence]
    counts: tuple[Counts | None, ...]
    coverage: Mapping[int, Coverage]
    cells: Mapping[Element, Cells] = field(default_factory=dict)
    shares: Mapping[Element, float] = field(default_factory=dict)
    fingerprints: Mapping[int, int] = field(default_factory=dict)
    symptoms: Mapping[Pair, PairSymptoms] = field(default_factory=dict)
    regions: tuple[Region, ...] = ()


class VerdictKind(StrEnum):
    """What is said of one frame."""

    CLEAN = "clean"
    ATTACKED = "attacked"
    UNIDENTIFIED = "unidentified"
    SUSPECT = "suspect"
    NOT_AUDITABLE = "not_auditable"


FINDINGS = frozenset({VerdictKind.ATTACKED, VerdictKind.UNIDENTIFIED, VerdictKind.SUSPECT})


class Evidence(NamedTuple):
    """One thing that speaks for an attack, and how far it lies above its threshold.

    By the robust method an element's margin z; by the paper's E - theta of a triple. `witness` is the value of a
    Witness or of a Statistic; `j` is None for elements.
    """

    witness: str
    i: int
    j: int | None
    k: int
    margin: float


class Alternative(NamedTuple):
    """Another attack, or none, that could explain a frame, and how much worse it does than the best one.

    By the robust method in margins, by the paper's in elements of e that disagree.
    """

    attacked: tuple[int, ...]
    worse_by: float


class Cause(StrEnum):
    """What else than an attack may lie behind a finding.

    FROZEN: the same data again and again. LATE: a frame behind the others. DISPLACED: turned since it was calibrated.
    SOILED: dirt on a lens, or whatever else takes light away. DARK, GLARE: too little or too much light in all cameras.
    RAIN: the LiDAR sees drops all around.
    """

    FROZEN = "frozen"
    LATE = "late"
    DISPLACED = "displaced"
    SOILED = "soiled"
    DARK = "dark"
    GLARE = "glare"
    RAIN = "rain"


CauseIn = tuple[Cause, int | None]
"""A cause and the sensor that it is seen in, None for all cameras."""


class Suspicion(NamedTuple):
    """A cause and the sensor that it is seen in, None for all cameras.

    `score` is 0 to 1; from 0.5 on the cause is seen more strongly than in clean frames.
    """

    cause: Cause
    sensor: int | None
    score: float = 1.0


class Finding(NamedTuple):
    """What the half second around a raised frame says: frames of equal findings are incidents."""

    kind: VerdictKind
    attacked: tuple[int, ...]


@dataclass(frozen=True)
class Verdict:
    """What is said of one frame.

    `e` has one character a triple of the rig: '0', '1', or '-' where nothing was measured. `attacked` is set where
    kind is ATTACKED. `named` is Algorithm 2's answer whatever the kind (None where it has none). `out_of_system` are
    the sensors that could not take part. `margin` is how sure it is: by the paper's method the smallest |E - theta|
    among the measured elements, how far a disparity error would have to move to change e; by the robust method the
    lead of the best explanation. `evidence` is the strongest first, `alternatives` the next best first; `causes` are
    what else may lie behind it. `finding` is the robust method's, None where the frame belongs to no incident.
    """

    kind: VerdictKind
    e: str
    attacked: tuple[int, ...] = ()
    named: tuple[int, ...] | None = None
    out_of_system: tuple[int, ...] = ()
    margin: float | None = None
    reason: str = ""
    evidence: tuple[Evidence, ...] = ()
    alternatives: tuple[Alternative, ...] = ()
    causes: tuple[Suspicion, ...] = ()
    finding: Finding | None = None


@dataclass(frozen=True)
class Procedure:
    """How disparity errors were measured; thresholds hold for measurements made the same way only.

    `settings` is canonical JSON (sorted keys, no spaces) of everything that can change a count.
    """

    matcher: str
    settings: str
    counting_version: int = COUNTING_VERSION


@dataclass(frozen=True)
class AttackLabel:
    """Ground truth: from `from_ns` to `to_ns` (stamps, both included) the data of `topic` was attacked."""

    topic: str
    attack: str
    from_ns: int
    to_ns: int
    parameters: Mapping[str, object]
