"""What is measured of a frame and what is said of it."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from decimal import Decimal
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from auditor.frames import Presence
from auditor.rig import RigKind, Triple

COUNTING_VERSION = 1
"""Raised whenever the same frame would give other counts: thresholds and measurements are bound to it."""

MIN_VALID_PX = 200
"""Fewer valid pixels than this and a disparity error is not measured."""


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
    leftmost). LiDAR: `returns`, the points that fall into the leftmost camera's view.
    """

    saturated_share: float | None = None
    textureless_share: float | None = None
    unmatched_share: float | None = None
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
    """One frame, measured. `counts` follows `rig.triples`; None where a sensor of the triple was not there."""

    number: int
    stamp_ns: int
    presence: Mapping[int, Presence]
    counts: tuple[Counts | None, ...]
    coverage: Mapping[int, Coverage]


class VerdictKind(StrEnum):
    """What is said of one frame."""

    CLEAN = "clean"
    ATTACKED = "attacked"
    UNIDENTIFIED = "unidentified"
    SUSPECT = "suspect"
    NOT_AUDITABLE = "not_auditable"


FINDINGS = frozenset({VerdictKind.ATTACKED, VerdictKind.UNIDENTIFIED, VerdictKind.SUSPECT})


@dataclass(frozen=True)
class Verdict:
    """What is said of one frame.

    `e` has one character a triple of the rig: '0', '1', or '-' where nothing was measured. `attacked` is set where
    kind is ATTACKED. `named` is Algorithm 2's answer whatever the kind (None where it has none). `out_of_system` are
    the sensors that could not take part. `margin` is the smallest |E - theta| among the measured elements: how far a
    disparity error would have to move to change e.
    """

    kind: VerdictKind
    e: str
    attacked: tuple[int, ...] = ()
    named: tuple[int, ...] | None = None
    out_of_system: tuple[int, ...] = ()
    margin: float | None = None
    reason: str = ""


@dataclass(frozen=True)
class Procedure:
    """How disparity errors were measured; thresholds hold for measurements made the same way only.

    `settings` is canonical JSON (sorted keys, no spaces) of everything that can change a count.
    """

    matcher: str
    settings: str
    counting_version: int = COUNTING_VERSION


@dataclass(frozen=True)
class Calibration:
    """What clean recordings taught: the disparity errors of their frames, from which theta follows at any r.

    `samples` holds, for each statistic and triple, the clean E in ascending order. `recordings` are the ids of the
    recordings they came from. `calibrated_at` (UTC) is no part of the id: the same samples are the same calibration.
    """

    calibration_id: str
    rig_kind: RigKind
    procedure: Procedure
    recordings: tuple[str, ...]
    samples: Mapping[tuple[Statistic, Triple], tuple[float, ...]]
    calibrated_at: datetime | None = None


@dataclass(frozen=True)
class Thresholds:
    """theta for each triple at the designated false-alarm rate r.

    `samples` counts the clean E that each came from. `resolvable` is False where 0 < r < 1/N for some triple: theta is
    then the maximum, the same as for r = 0. `transferred` says that they were calibrated for another rig kind.
    """

    calibration_id: str
    statistic: Statistic
    r: Decimal
    theta: Mapping[Triple, float]
    samples: Mapping[Triple, int]
    resolvable: bool
    transferred: bool = False


@dataclass(frozen=True)
class AttackLabel:
    """Ground truth: from `from_ns` to `to_ns` (stamps, both included) the data of `topic` was attacked."""

    topic: str
    attack: str
    from_ns: int
    to_ns: int
    parameters: Mapping[str, object]
