"""Calibrations: the clean frames that thresholds come from, and the thresholds of both methods."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from decimal import Decimal
from functools import cached_property
from typing import Any

import numpy as np

from auditor.model.arrays import Flags, Floats, Integers
from auditor.model.checks import Pair, SensorCheck
from auditor.model.measurement import Procedure, Statistic
from auditor.model.rig import Triple
from auditor.model.rig_kind import RigKind, Similarity
from auditor.model.sub_rigs import SubRig
from auditor.model.verdict import CauseIn

MOST_FRAMES_KEPT = 100_000
"""Of recordings that are read when they are needed: about 1 kB each."""


@dataclass(frozen=True, eq=False)
class CleanFrames:
    """The F frames of one clean recording, in the order of its measurement: all that thresholds come from.

    `errors` holds the disparity errors E by statistic and triple, `statistics` those of the sensor checks, `strengths`
    the fault scores by fault and sensor; each is (F,), NaN where it was not measured. `missing` and `frozen` are (F,)
    flags of the sensors that were not there, or repeated their data while others changed, in some frame.

    The rest serves rigs that lack some of the sensors: `unmasked` holds the statistics that are others without the
    LiDAR, `features` the fault features by name and matched pair (i, k), `brightness` what BRIGHTNESS names by
    camera; each is (F,), NaN where it was not measured. `returns` (F,) are the LiDAR points in view, NaN where it was
    not there; it is empty where there is no LiDAR. `versions` are those that the counts were made with.
    """

    recording_id: str
    stamps_ns: Integers
    errors: Mapping[tuple[Statistic, Triple], Floats]
    statistics: Mapping[SensorCheck, Floats]
    strengths: Mapping[CauseIn, Floats]
    missing: Mapping[int, Flags] = field(default_factory=dict)
    frozen: Mapping[int, Flags] = field(default_factory=dict)
    unmasked: Mapping[SensorCheck, Floats] = field(default_factory=dict)
    features: Mapping[tuple[str, Pair], Floats] = field(default_factory=dict)
    brightness: Mapping[tuple[str, int], Floats] = field(default_factory=dict)
    returns: Floats = field(default_factory=lambda: np.zeros(0))
    versions: Mapping[str, str] = field(default_factory=dict)

    @property
    def frames(self) -> int:
        """F."""
        return len(self.stamps_ns)

    @cached_property
    def measured(self) -> dict[tuple[Statistic, Triple], int]:
        """How many disparity errors were measured, by statistic and triple."""
        return {key: int(np.count_nonzero(~np.isnan(errors))) for key, errors in self.errors.items()}

    @cached_property
    def usual_returns(self) -> float:
        """The median of the LiDAR points in view; NaN where there are none."""
        measured = self.returns[~np.isnan(self.returns)]
        return float(np.median(measured)) if measured.size else np.nan

    def statistics_of(self, sensor_checks: Sequence[SensorCheck]) -> Floats:
        """(F, M) statistics in the order of `sensor_checks`, NaN for those that are not known here."""
        unknown = np.full(self.frames, np.nan)
        return np.stack([self.statistics.get(check, unknown) for check in sensor_checks], axis=1)


_REMEMBERED = ("stamps_ns", "versions", "measured", "usual_returns")
"""What is small, and known from the first reading on."""


class FramesReadLater(CleanFrames):
    """Clean frames that are read when something of them is asked for; see `read_later`."""

    def __init__(self, recording_id: str, read: Callable[[], CleanFrames], kept: "_RecentRecordings") -> None:
        self.__dict__.update(recording_id=recording_id, _read=read, _kept=kept)

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever CleanFrames has
        if name.startswith("_"):
            raise AttributeError(name)
        frames = self._kept.get(self)
        if frames is None:
            frames = self._read()
            kept = {name: getattr(frames, name) for name in _REMEMBERED}
            self.__dict__.update(kept)
            self._kept.keep(self, frames)
        return getattr(frames, name)


class _RecentRecordings:
    """The recordings that were read last, so many that they have no more than MOST_FRAMES_KEPT frames; one at least."""

    def __init__(self) -> None:
        self._frames: dict[FramesReadLater, CleanFrames] = {}

    def get(self, recording: FramesReadLater) -> CleanFrames | None:
        return self._frames.get(recording)

    def keep(self, recording: FramesReadLater, frames: CleanFrames) -> None:
        self._frames[recording] = frames
        while len(self._frames) > 1 and sum(known.frames for known in self._frames.values()) > MOST_FRAMES_KEPT:
            del self._frames[next(iter(self._frames))]


def read_later(recordings: Iterable[tuple[str, Callable[[], CleanFrames]]]) -> tuple[CleanFrames, ...]:
    """The clean frames of recordings, by id and a function that reads them: of many, few are in memory at a time.

    What reads of all recordings reads them one after another, and all that it needs of one at once.
    """
    kept = _RecentRecordings()
    return tuple(FramesReadLater(recording_id, read, kept) for recording_id, read in recordings)


PRIOR = "prior"
"""The id of the calibration that is made of no clean frames: every store has it, and none keeps it."""


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


def prior_calibration(rig_kind: RigKind, procedure: Procedure) -> Calibration:
    """The calibration of a rig kind of which no clean frame is known: the prior is all that it is judged by."""
    return Calibration(PRIOR, rig_kind, procedure, ())


@dataclass(frozen=True)
class Marks:
    """What a judgement says of its calibration.

    `similarity` is how alike the rig kinds are. `in_sample`: the calibration was made of the recording itself.
    `other_lidar`: the LiDAR has far more or fewer points in view than that of the calibration, or of the prior.
    `measured_otherwise` says on which other machine the counts of the calibration were made; empty where none.
    """

    similarity: Similarity = Similarity.SAME
    in_sample: bool = False
    other_lidar: bool = False
    measured_otherwise: str = ""


NO_MARKS = Marks()


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
class NullDistribution:
    """What a frame of a clean drive is expected to have: a mean, and how far from it z = 1 is.

    Of a sensor check they are of the log odds of its statistic (`identification.prior`); of a fault of its score.
    `deviation`, `within` one drive, and `between` the means of drives of the rig kind, are standard deviations times
    the tail of the prior. `drives` is how many clean recordings they were learnt from, `samples` how many of their
    frames; 0 where they are the prior.
    """

    mean: float
    deviation: float
    within: float
    drives: int
    samples: int
    between: float


@dataclass(frozen=True)
class ThetaScale:
    """theta of a fault and the scale of its z, from the clean frames of so many recordings.

    A fault that may go either way has a `usual` score: theta is how far from it the score must be.
    """

    theta: float
    scale: float
    drives: int
    usual: float | None = None


@dataclass(frozen=True)
class RobustThresholds:
    """The robust method's: what is expected of each sensor check, and theta of each fault at r.

    `limit` is how many standard deviations the strongest check of a clean frame exceeds at rate r, all checks taken
    together. `drives` are the clean recordings that they were learnt from; with none they are the prior. The summed
    evidence of an incident must exceed `evidence_limit`, which that of clean recordings does no more than
    `incidents_per_hour` times an hour; None is the usual rate.
    """

    calibration_id: str
    r: Decimal
    limit: float
    expected: Mapping[SensorCheck, NullDistribution]
    causes: Mapping[CauseIn, ThetaScale]
    drives: int
    evidence_limit: float = 0.0
    incidents_per_hour: float | None = None
    transferred: bool = False


def _samples(columns: Sequence[Floats]) -> tuple[float, ...]:
    values = np.concatenate(columns)
    return tuple(np.sort(values[~np.isnan(values)]).tolist())


@dataclass(frozen=True)
class ConditionRate:
    """The windows with findings of the drives under one condition, each judged by others.

    `share` and its 95 % interval are drawn towards the share of all drives: few windows say little. `enough` says
    whether drives and windows suffice to say anything of this condition.
    """

    condition: str
    value: str
    drives: int
    windows: int
    raised_windows: int
    share: float
    low: float
    high: float
    enough: bool
