"""How a calibration was made: one version, and the recordings that were in it or left out."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, date, datetime
from decimal import Decimal
from enum import StrEnum
from typing import Any

from auditor.model.calibration import ConditionRate
from auditor.store.records import to_utc
from auditor.store.store import Store
from auditor.store.tables import Row, read_rows
from auditor.store.versions.history import History


class VersionOutcome(StrEnum):
    """What was decided of a calibration when it was made."""

    PROMOTED = "promoted"
    HELD = "held"
    REFUSED = "refused"
    CANDIDATE = "candidate"


@dataclass(frozen=True)
class UsedRecording:
    """A recording that a calibration was made of, or that was looked at and left out of it.

    `look_at` says that a person should look at it. What it shows when others judge it is None where it was not judged.
    """

    recording_id: str
    measurement_id: str
    name: str
    vehicle: str | None
    day: date | None
    included: bool
    reason: str
    frames: int
    look_at: bool = False
    findings_by_others: int | None = None
    incidents_by_others: int | None = None
    level: float | None = None
    weather: str | None = None
    time_of_day: str | None = None

    @property
    def origin(self) -> tuple[str | None, date | None]:
        """Its vehicle and day."""
        return self.vehicle, self.day

    @property
    def called(self) -> str:
        """Its name, with vehicle and day where they are known: many recordings may have one name."""
        origin = ", ".join(str(one) for one in self.origin if one)
        return f"{self.name} ({origin})" if origin else self.name


@dataclass(frozen=True)
class CalibrationVersion:
    """How a calibration was made, what it was tried on, and what was decided of it.

    `frames` are its clean frames, `hours` the time that they cover; `frames_by_others` were judged by recordings other
    than their own at `r`. `rules` is the digest of the parameters that they were judged by.
    """

    calibration_id: str
    kind: str
    matcher: str
    counting_version: int
    made_at: datetime
    made_by: str
    parent: str | None
    provisional: bool
    outcome: VersionOutcome
    reasons: tuple[str, ...]
    frames: int
    hours: float
    resolves_r: float | None
    r: Decimal
    frames_by_others: int
    findings_by_others: int
    incidents_by_others: int
    first_frame: int | None
    last_frame: int | None
    recounted: bool
    auditor_version: str
    judging_version: int
    rules: str
    recordings: tuple[UsedRecording, ...] = ()
    conditions: tuple[ConditionRate, ...] = ()

    @property
    def included(self) -> tuple[UsedRecording, ...]:
        """The recordings that it was made of."""
        return tuple(one for one in self.recordings if one.included)


def write_version(store: Store, version: CalibrationVersion) -> None:
    """Keep how a calibration was made; the row of the version is written last."""
    calibration_id = version.calibration_id
    rows = ({"calibration_id": calibration_id, **asdict(one)} for one in version.recordings)
    store.write("calibration_recordings", calibration_id, rows)
    store.write(
        "calibration_conditions",
        calibration_id,
        ({"calibration_id": calibration_id, **asdict(one)} for one in version.conditions),
    )
    store.write("calibration_versions", calibration_id, [_row(version)])


def read_version(store: Store, calibration_id: str) -> CalibrationVersion | None:
    """How a calibration was made; None where that is not known: it came from a file, or from before."""
    path = store.path("calibration_versions", calibration_id)
    if not path.is_file():
        return None
    [row] = read_rows("calibration_versions", path)
    used = read_rows("calibration_recordings", store.path("calibration_recordings", calibration_id))
    conditions = store.path("calibration_conditions", calibration_id)
    rates = read_rows("calibration_conditions", conditions) if conditions.is_file() else []
    return CalibrationVersion(
        **{
            **row,
            "made_at": row["made_at"].replace(tzinfo=UTC),
            "outcome": VersionOutcome(row["outcome"]),
            "reasons": tuple(row["reasons"]),
            "r": row["r"].normalize(),
        },
        recordings=tuple(UsedRecording(**_without_id(one)) for one in used),
        conditions=tuple(ConditionRate(**_without_id(one)) for one in rates),
    )


def lost_versions(store: Store, all_histories: Sequence[History]) -> list[CalibrationVersion]:
    """The versions that came into force for a rig kind that none of `all_histories` tells of.

    The file of such a history is gone: nothing says any more what was in force. A person restores it, or puts a version
    in force, which begins another.
    """
    told = {(str(one.rig_kind), one.procedure.matcher) for one in all_histories if one.moves}
    versions = [read_version(store, one) for one in store.ids("calibration_versions")]
    promoted = [one for one in versions if one is not None and one.outcome is VersionOutcome.PROMOTED]
    return [one for one in promoted if (one.kind, one.matcher) not in told]


def lost_line(version: CalibrationVersion) -> str:
    """What to say and do about a version of `lost_versions`."""
    short_id = version.calibration_id[:12]
    return (
        f"calibration {short_id} came into force for {version.kind}, and its history is gone from the store: restore "
        f"calibration_history, or put it in force with auditor calibration promote {short_id}"
    )


def missing_calibrations(store: Store, all_histories: Sequence[History]) -> list[str]:
    """One sentence for each version that the store tells of, or that one of `all_histories` names, without its file."""
    named = {move.calibration_id for one in all_histories for move in one.moves} | {*store.ids("calibration_versions")}
    return [
        f"{one}: its file is gone from the store: restore calibrations/{one}.parquet, or make it again from its "
        "recordings with auditor calibrate"
        for one in sorted(named - {*store.ids("calibrations")})
    ]


def provisional_of(store: Store, all_histories: Sequence[History]) -> frozenset[str]:
    """The calibrations of some histories that are in force, provisional, and not confirmed by a person."""
    alone = [one.in_force for one in all_histories if one.in_force is not None and not one.vouched]
    versions = [read_version(store, calibration_id) for calibration_id in alone]
    return frozenset(one.calibration_id for one in versions if one is not None and one.provisional)


def _row(version: CalibrationVersion) -> Row:
    return {**vars(version), "made_at": to_utc(version.made_at), "reasons": list(version.reasons)}


def _without_id(row: Row) -> dict[str, Any]:
    return {name: value for name, value in row.items() if name != "calibration_id"}
