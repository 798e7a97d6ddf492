"""What callers hand to a store and get back: one frozen dataclass a kind of row, and the ids of those that have one."""

import datetime
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auditor.errors import StoreError
from auditor.model.calibration import NO_MARKS, Marks, RobustThresholds, Thresholds
from auditor.model.canonical import canonical_json
from auditor.model.coverage import TopicCoverage
from auditor.model.frames import PoseTopic, TopicBalance
from auditor.model.measurement import Procedure, Statistic
from auditor.model.rig_kind import RigKind
from auditor.model.verdict import JUDGING_VERSION, VerdictKind

_ID_DIGITS = 32
DIGITS_OF_R = 17
"""Decimals of a designated false-alarm rate that the tables keep."""


@dataclass(frozen=True)
class Sighting:
    """A name and path under which a recording's content was read, and when first (UTC); None where that is unknown.

    While its files and the way of measuring have this `stamp`, reading them again gives these `measurements`.
    """

    name: str
    path: str
    seen_at: datetime.datetime | None = None
    stamp: str | None = None
    measurements: tuple[str, ...] = ()


@dataclass(frozen=True)
class RecordingRecord:
    """One recording. `clock` is utc, relative or unknown; `damage` has one sentence a piece.

    `name` is the first it was read under, `path` where it was read last, and `sightings` has all of both, in order.
    `superseded_by` is the recording that holds every frame of it. `conflicts` are those with other data at the same
    stamps; None where it was not compared with others yet.
    """

    recording_id: str
    name: str
    path: str
    files: tuple[str, ...] = ()
    size_bytes: int | None = None
    format: str | None = None
    clock: str = "unknown"
    from_ns: int | None = None
    to_ns: int | None = None
    vehicle: str | None = None
    date: datetime.date | None = None
    drive: str | None = None
    weather: str | None = None
    damage: tuple[str, ...] = ()
    sightings: tuple[Sighting, ...] = ()
    superseded_by: str | None = None
    conflicts: tuple[str, ...] | None = None

    @property
    def other_names(self) -> tuple[str, ...]:
        """Other names that it was read under, each once."""
        return tuple(dict.fromkeys(one.name for one in self.sightings if one.name != self.name))


@dataclass(frozen=True)
class GivenLabel:
    """A label that a person gave; one without a topic says that the recording is known to be clean.

    From `from_ns` to `to_ns` (stamps, both included) the data of `topic` was attacked. `given_at` is UTC.
    """

    given_at: datetime.datetime
    topic: str | None = None
    sensor: int | None = None
    attack: str | None = None
    from_ns: int | None = None
    to_ns: int | None = None


@dataclass(frozen=True)
class MeasurementRecord:
    """What makes the frames of a measurement finished. `measured_at` is UTC; `damage` has one sentence a piece.

    `calibration_warnings` has one about each thing that a wrong calibration would explain, `remarks` what is not
    measured, and no reason to doubt a calibration. `withheld` is why no verdict may be given, and what to do about it.
    `offsets_ns` follow the sensors: how far their stamps lie behind the leftmost camera's.
    """

    recording_id: str
    rig_id: str
    procedure: Procedure
    balance: tuple[TopicBalance, ...]
    versions: Mapping[str, str]
    measured_at: datetime.datetime
    seconds: float
    damage: tuple[str, ...] = ()
    calibration_warnings: tuple[str, ...] = ()
    offsets_ns: tuple[int, ...] | None = None
    clock_jumps: int | None = None
    coverage: tuple[TopicCoverage, ...] | None = None
    pose_topics: tuple[PoseTopic, ...] | None = None
    withheld: str | None = None
    remarks: tuple[str, ...] = ()

    @property
    def measurement_id(self) -> str:
        """The id that follows from recording, rig and procedure."""
        return measurement_id(self.recording_id, self.rig_id, self.procedure)


@dataclass(frozen=True)
class StoredMeasurement:
    """A finished measurement, as the store knows it. `skipped` counts ticks without a frame by reason.

    `coverage` is None where it was measured before that was kept. `withheld` is why no verdict may be given on it.
    """

    measurement_id: str
    recording_id: str
    rig_id: str
    procedure: Procedure
    frames: int
    measured: int
    skipped: Mapping[str, int]
    first_stamp_ns: int | None
    last_stamp_ns: int | None
    balance: tuple[TopicBalance, ...]
    damage: tuple[str, ...]
    calibration_warnings: tuple[str, ...]
    versions: Mapping[str, str]
    measured_at: datetime.datetime
    seconds: float
    coverage: tuple[TopicCoverage, ...] | None = None
    withheld: str | None = None
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class FrameErrors:
    """The disparity errors of a measurement's F measured frames, skipped ticks left out.

    `frames` and `stamps_ns` are (F,) int64; `E` is (F, T) float64 in the order of `rig.measured_triples`, NaN where it
    was not measured; `states` is (F, S) text in the order of `rig.sensors`: present, missing or damaged.
    """

    frames: NDArray[np.int64]
    stamps_ns: NDArray[np.int64]
    E: NDArray[np.float64]
    states: NDArray[np.str_]


@dataclass(frozen=True, eq=False)
class FrameStatistics:
    """The statistics of a measurement's F measured frames, skipped ticks left out.

    `frames` and `stamps_ns` are (F,) int64; `statistics` is (F, M) float64 in the order of `rig_sensor_checks(rig)`,
    NaN where it was not measured, and `unmasked` (F, M) what they are without the LiDAR; `states` is (F, S) text and
    `fingerprints` (F, S) int64 in the order of `rig.sensors`, the latter -1 where the sensor was not there.
    `returns` (F,) are the LiDAR points in view, NaN where there was no LiDAR.
    """

    frames: NDArray[np.int64]
    stamps_ns: NDArray[np.int64]
    statistics: NDArray[np.float64]
    unmasked: NDArray[np.float64]
    states: NDArray[np.str_]
    fingerprints: NDArray[np.int64]
    returns: NDArray[np.float64]


@dataclass(frozen=True)
class JudgingRules:
    """What verdicts are reached by, beside the thresholds.

    `digest` and `settings` (canonical JSON) are those of all parameters that can change a verdict. Two of them explain
    scores: `z_offset` is added to a statistic before its odds are taken, and z is kept within `z_range`.
    """

    digest: str
    settings: str
    auditor_version: str
    z_offset: float
    z_range: tuple[float, float]
    judging_version: int = JUDGING_VERSION


@dataclass(frozen=True)
class JudgementRecord:
    """One judging of one measurement. `judged_at` is UTC; `recounted` where the statistics came from the stored cells.

    `absent_sensors` are what the calibration's rig has and the measurement's lacks, in words; `calibrated_as` are the
    numbers of the rig's sensors in the calibration's rig. `marks` say what else is to be known of the calibration.
    `judged_with` are the measurements by other rigs whose frames are portions of the same series. Raises StoreError
    where r has more decimals than are kept.
    """

    measurement_id: str
    method: str
    thresholds: Thresholds | RobustThresholds
    rules: JudgingRules
    judged_at: datetime.datetime
    recounted: bool = False
    absent_sensors: tuple[str, ...] = ()
    calibrated_as: tuple[int, ...] | None = None
    marks: Marks = NO_MARKS
    judged_with: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        r = self.thresholds.r
        if r != round(r, DIGITS_OF_R):
            raise StoreError(
                f"r = {r} has more than {DIGITS_OF_R} decimals",
                where="judgement",
                remedy=f"round it to at most {DIGITS_OF_R} of them",
            )

    @property
    def judgement_id(self) -> str:
        """The id that follows from the measurement and how it was judged."""
        thresholds = self.thresholds
        return judgement_id(
            self.measurement_id,
            thresholds.calibration_id,
            self.method,
            thresholds.statistic if isinstance(thresholds, Thresholds) else thresholds.incidents_per_hour,
            thresholds.r,
            self.rules.digest,
            judging_version=self.rules.judging_version,
            transferred=thresholds.transferred,
            recounted=self.recounted,
            judged_with=self.judged_with,
        )


@dataclass(frozen=True)
class StoredJudgement:
    """A finished judgement, as the store knows it.

    `statistic` is None by the robust method; `counts` are its frames by kind of verdict, `in_incidents` those that
    belong to an incident, `in_alerts` those that belong to an alert. `recounted` is True where its statistics came from
    the stored cells. `judging_version` is 0 and `rules`, the digest of the parameters, None where it was judged before
    rules had versions. `judged_with` are the measurements that its frames were judged with. `absent_sensors` are
    what its rig lacks of the calibration's. `drives` are the clean recordings that the robust method's thresholds were
    learnt from, 0 where they are the prior; None by the paper's method, and of judgements of before there was a prior.
    `marks` say what else is to be known of its calibration. `incidents_per_hour` were allowed on clean recordings, None
    where that was not asked for.
    """

    judgement_id: str
    measurement_id: str
    calibration_id: str
    method: str
    statistic: Statistic | None
    r: Decimal
    resolvable: bool
    transferred: bool
    judged_at: datetime.datetime
    counts: Mapping[VerdictKind, int]
    in_incidents: int
    in_alerts: int
    recounted: bool
    judging_version: int
    rules: str | None
    absent_sensors: tuple[str, ...] = ()
    drives: int | None = None
    marks: Marks = NO_MARKS
    incidents_per_hour: float | None = None
    judged_with: tuple[str, ...] = ()

    @property
    def found(self) -> int:
        """Frames that belong to an incident or an alert: the recording counts as found with any."""
        return self.in_incidents + self.in_alerts


def measurement_id(recording_id: str, rig_id: str, procedure: Procedure) -> str:
    """Hash of what decides every count of a measurement."""
    return content_id(
        "measurement", recording_id, rig_id, procedure.matcher, procedure.settings, procedure.counting_version
    )


def judgement_id(
    measurement: str,
    calibration: str,
    method: str,
    asked: Statistic | float | None,
    r: Decimal,
    rules: str,
    *,
    judging_version: int = JUDGING_VERSION,
    transferred: bool,
    recounted: bool,
    judged_with: Sequence[str] = (),
) -> str:
    """Hash of a measurement and of what decides every verdict on it.

    `asked` is the statistic of the paper's method, or the incidents an hour of the robust one. `judged_with` are the
    measurements that its frames were judged with as one series.
    """
    return content_id(
        "judgement",
        measurement,
        calibration,
        method,
        asked.value if isinstance(asked, Statistic) else repr(asked),
        str(r.normalize()),
        transferred,
        judging_version,
        rules,
        *(["recounted"] if recounted else []),
        *judged_with,
    )


def content_id(*parts: object) -> str:
    """The first 32 hex digits of the sha256 of the parts as canonical JSON."""
    return hashlib.sha256(canonical_json(parts).encode()).hexdigest()[:_ID_DIGITS]


def id_of_json(parts: Sequence[object], last: str) -> str:
    """As `content_id` of some parts and a last one, which is canonical JSON already."""
    text = f"{canonical_json(parts)[:-1]},{last}]"
    return hashlib.sha256(text.encode()).hexdigest()[:_ID_DIGITS]


def to_utc(moment: datetime.datetime) -> datetime.datetime:
    """The same moment as the tables keep it: UTC without a time zone."""
    return moment.astimezone(datetime.UTC).replace(tzinfo=None)


def rig_kind_fields(kind: RigKind) -> dict[str, object]:
    """A rig kind as the STRUCT that `rigs` and `calibrations` hold."""
    return {
        "lidar": kind.lidar,
        "widths_px": [width for width, _ in kind.sizes_px],
        "heights_px": [height for _, height in kind.sizes_px],
        "focals_px": list(kind.focals_px),
        "baselines_m": list(kind.baselines_m),
    }


def rig_kind_of(fields: Mapping[str, Any]) -> RigKind:
    """The rig kind of such a STRUCT."""
    return RigKind(
        lidar=fields["lidar"],
        sizes_px=tuple(zip(fields["widths_px"], fields["heights_px"], strict=True)),
        focals_px=tuple(fields["focals_px"]),
        baselines_m=tuple(fields["baselines_m"]),
    )
