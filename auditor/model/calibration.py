"""Calibrations: the clean frames that thresholds come from, and the thresholds of both methods."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from decimal import Decimal
from functools import cached_property

import numpy as np

from auditor.model.arrays import Flags, Floats, Integers
from auditor.model.checks import Pair, PairCheck
from auditor.model.measurement import Procedure, Statistic
from auditor.model.parameters import SCORE_LIMITS
from auditor.model.rig import RigKind, Triple
from auditor.model.sub_rigs import SubRig
from auditor.model.verdict import CauseIn

LOWEST_SCORE, HIGHEST_SCORE = SCORE_LIMITS.lowest, SCORE_LIMITS.highest
"""Normalised scores z are kept between these: no single check decides alone."""


@dataclass(frozen=True, eq=False)
class CleanFrames:
    """The F frames of one clean recording, in the order of its measurement: all that thresholds come from.

    `errors` holds the disparity errors E by statistic and triple, `ratios` the statistics by pair check, `strengths`
    the fault scores by fault and sensor; each is (F,), NaN where it was not measured. `missing` and `frozen` are (F,)
    flags of the sensors that were not there, or repeated their data while others changed, in some frame.

    The rest serves rigs that lack some of the sensors: `unmasked` holds the statistics that are others without the
    LiDAR, `features` the fault features by name and matched pair (i, k), `brightness` the level and saturated_share by
    camera; each is (F,), NaN where it was not measured.
    """

    recording_id: str
    stamps_ns: Integers
    errors: Mapping[tuple[Statistic, Triple], Floats]
    ratios: Mapping[PairCheck, Floats]
    strengths: Mapping[CauseIn, Floats]
    missing: Mapping[int, Flags] = field(default_factory=dict)
    frozen: Mapping[int, Flags] = field(default_factory=dict)
    unmasked: Mapping[PairCheck, Floats] = field(default_factory=dict)
    features: Mapping[tuple[str, Pair], Floats] = field(default_factory=dict)
    brightness: Mapping[tuple[str, int], Floats] = field(default_factory=dict)

    @property
    def frames(self) -> int:
        """F."""
        return len(self.stamps_ns)

    def ratios_of(self, pair_checks: Sequence[PairCheck]) -> Floats:
        """(F, M) statistics in the order of `pair_checks`, NaN for those that are not known here."""
        unknown = np.full(self.frames, np.nan)
        return np.stack([self.ratios.get(pair_check, unknown) for pair_check in pair_checks], axis=1)


@dataclass(frozen=True, eq=False)
class Calibration:
    """The clean frames of some recordings; thresholds at any r follow from them.

    Recordings are separate, so that each can be judged by the others. `calibrated_at` (UTC) is no part of the id: the
    same frames are the same calibration. `part` says where it was made for a rig that is a part of that calibrated,
    whose id it has.
    """

    calibration_id: str
    rig_kind: RigKind
    procedure: Procedure
    clean: tuple[CleanFrames, ...]
    calibrated_at: datetime | None = None
    part: SubRig | None = None

    @cached_property
    def recordings(self) -> tuple[str, ...]:
        """The ids of the recordings, ascending."""
        return tuple(sorted({one.recording_id for one in self.clean}))

    @cached_property
    def samples(self) -> Mapping[tuple[Statistic, Triple], tuple[float, ...]]:
        """For each statistic and triple the measured E of all clean frames, in ascending order."""
        keys = dict.fromkeys(key for one in self.clean for key in one.errors)
        return {key: _samples([one.errors[key] for one in self.clean if key in one.errors]) for key in keys}

    def ratios_of(self, pair_checks: Sequence[PairCheck]) -> Floats:
        """(F, M) statistics of all clean frames in the order of `pair_checks`, NaN where not measured."""
        return np.vstack([np.empty((0, len(pair_checks))), *(one.ratios_of(pair_checks) for one in self.clean)])

    @cached_property
    def strengths(self) -> Mapping[CauseIn, tuple[float, ...]]:
        """For each fault and sensor the measured fault scores of all clean frames, in ascending order."""
        return strengths_of(self.clean)


@dataclass(frozen=True)
class Thresholds:
    """The paper's: theta for each triple at the designated false-alarm rate r.

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
class Scale:
    """theta of one pair check or fault and the scale of its z, from N clean samples."""

    theta: float
    scale: float
    samples: int


@dataclass(frozen=True)
class RobustThresholds:
    """The robust method's: theta and scale of each pair check and fault at r, and the threshold of the window's score.

    Faults without clean samples have none and are not listed. `score` is 0, or what clean recordings need for no more
    than `incidents_per_hour` incidents.
    """

    calibration_id: str
    r: Decimal
    scales_of: Mapping[PairCheck, Scale]
    causes: Mapping[CauseIn, Scale]
    resolvable: bool
    score: float = 0.0
    incidents_per_hour: float | None = None
    transferred: bool = False


def strengths_of(clean: Sequence[CleanFrames]) -> dict[CauseIn, tuple[float, ...]]:
    """For each fault and sensor the measured fault scores of some recordings, in ascending order."""
    keys = dict.fromkeys(key for one in clean for key in one.strengths)
    return {key: _samples([one.strengths[key] for one in clean if key in one.strengths]) for key in keys}


def _samples(columns: Sequence[Floats]) -> tuple[float, ...]:
    values = np.concatenate(columns)
    return tuple(np.sort(values[~np.isnan(values)]).tolist())
