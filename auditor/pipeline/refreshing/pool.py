"""The recordings that a refresh may learn from: by rig kind, and what bars some of them before anything is judged."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from datetime import UTC, date, datetime
from enum import StrEnum
from functools import cache, partial
from math import asin, cos, degrees, pi, radians, sin

from auditor.identification.refresh_parameters import CLEAN_DRIVE, INFLUENCE
from auditor.identification.refreshing.drives import DriveSource
from auditor.identification.refreshing.influence import Cell
from auditor.model.calibration import CleanFrames
from auditor.model.measurement import Procedure
from auditor.model.rig import Rig
from auditor.pipeline.calibrations.clean import attacked_by_labels, held_by
from auditor.pipeline.calibrations.versions import latest_day, looked_at
from auditor.pipeline.clean_frames import clean_frames_of
from auditor.pipeline.judge import counted_earlier
from auditor.pipeline.reading import reading_of
from auditor.pipeline.remarks import conflicts_of
from auditor.store.records import RecordingRecord, StoredMeasurement
from auditor.store.reviews import false_alarms
from auditor.store.store import Store
from auditor.store.tables import read_rows
from auditor.store.versions.history import History, histories, history_for
from auditor.store.versions.records import UsedRecording

_M_OF_A_DEGREE = 111_195.0  # of a great circle on the Earth's mean radius
_TWILIGHT_DEG = 6.0  # of the sun above or below the horizon: civil twilight


class TimeOfDay(StrEnum):
    """By how high the sun stands."""

    DAY = "day"
    TWILIGHT = "twilight"
    NIGHT = "night"


@dataclass(frozen=True)
class Circumstances:
    """The cells of the ground that a vehicle was in, and the time of day; empty and None where no GPS fix says so."""

    visited: frozenset[Cell] = frozenset()
    time_of_day: TimeOfDay | None = None


UNKNOWN = Circumstances()


def circumstances_of(store: Store, measurement: str, recording: RecordingRecord) -> Circumstances:
    """The circumstances of a measurement, by the GPS fixes of its frames. Raises StoreError."""
    there = store.has("poses", measurement)
    rows = read_rows("poses", store.source("poses", measurement)) if there else []
    fixes = [(row["stamp_ns"], row["latitude_deg"], row["longitude_deg"]) for row in rows]
    fixes = [fix for fix in fixes if fix[1] is not None and fix[2] is not None]
    if not fixes:
        return UNKNOWN
    hour = time_of_day(*min(fixes)) if recording.clock == "utc" else None
    return Circumstances(visited([fix[1:] for fix in fixes]), hour)


def visited(places_deg: Sequence[tuple[float, float]]) -> frozenset[Cell]:
    """The cells of some latitudes and longitudes; cells lie in rows by latitude, so that they are alike in size."""
    side_deg = INFLUENCE.cell_m / _M_OF_A_DEGREE
    rows = [(round(latitude / side_deg), longitude) for latitude, longitude in places_deg]
    return frozenset((row, round(longitude * cos(radians(row * side_deg)) / side_deg)) for row, longitude in rows)


def time_of_day(stamp_ns: int, latitude_deg: float, longitude_deg: float) -> TimeOfDay:
    """Whether it is day at a place at a time in UTC, by the sun's elevation to about a degree (Spencer, 1971)."""
    moment = datetime.fromtimestamp(stamp_ns / 1e9, UTC)
    hours = moment.hour + moment.minute / 60 + moment.second / 3600
    turn = 2 * pi * (moment.timetuple().tm_yday - 1 + (hours - 12) / 24) / 365
    declination = (
        0.006918
        - 0.399912 * cos(turn)
        + 0.070257 * sin(turn)
        - 0.006758 * cos(2 * turn)
        + 0.000907 * sin(2 * turn)
        - 0.002697 * cos(3 * turn)
        + 0.00148 * sin(3 * turn)
    )
    minutes = 229.18 * (
        0.000075 + 0.001868 * cos(turn) - 0.032077 * sin(turn) - 0.014615 * cos(2 * turn) - 0.040849 * sin(2 * turn)
    )
    hour_angle = radians((hours - 12) * 15 + longitude_deg + minutes / 4)
    latitude = radians(latitude_deg)
    elevation = degrees(asin(sin(latitude) * sin(declination) + cos(latitude) * cos(declination) * cos(hour_angle)))
    if elevation > _TWILIGHT_DEG:
        return TimeOfDay.DAY
    return TimeOfDay.TWILIGHT if elevation > -_TWILIGHT_DEG else TimeOfDay.NIGHT


def _unknown() -> Circumstances:
    return UNKNOWN


@dataclass(frozen=True, eq=False)
class Log:
    """A measured recording. `named` says that a person called it clean, `labelled` that somebody looked at just this,
    `reviewed` that he called its incidents false alarms and gave it no label.

    `barred` is why it is not learnt from, `doubt` why not unless a person called it clean, if so; `look_at` is of
    either of both. `told` are its frames in incidents or alerts that nobody has looked at.
    `frames` and `circumstances` are read when they are needed.
    """

    used: UsedRecording
    frames: Callable[[], CleanFrames]
    circumstances: Callable[[], Circumstances] = _unknown
    named: bool = False
    labelled: bool = False
    reviewed: bool = False
    barred: str = ""
    doubt: str = ""
    look_at: bool = False
    told: int = 0

    @property
    def source(self) -> DriveSource:
        """Where it comes from."""
        return DriveSource(self.used.recording_id, self.used.vehicle, self.used.day)


@dataclass(frozen=True)
class LogGroup:
    """The logs of one rig kind and procedure, with the history of its versions, and the rig of one of them."""

    history: History
    rig: Rig
    logs: list[Log] = field(default_factory=list)


def groups_of(stores: Sequence[Store], named: Collection[str], no_sensors: Collection[str] = ()) -> list[LogGroup]:
    """The logs of some stores by rig kind and procedure; the versions are those of the first.

    `named` are the measurements that this call names clean; those are too whose only incidents a person reviewed as
    false alarms. Measurements of an earlier way of counting are left out. `no_sensors` are topics that a person
    declares to be neither cameras nor LiDARs.
    """
    all_histories, groups = histories(stores[0]), list[LogGroup]()
    seen: set[str] = set()
    for store in stores:
        reviewed, judged = false_alarms(store), store.current_judgements()
        recordings = {one.recording_id: one for one in store.recordings()}  # at once: one by one takes far longer
        for stored in store.measurements():
            measurement = stored.measurement_id
            if measurement not in seen and not counted_earlier(store, measurement):
                seen.add(measurement)
                rig = store.rig(stored.rig_id)
                _group(groups, all_histories, rig, stored.procedure).logs.append(
                    _log(
                        store,
                        stored,
                        recordings[stored.recording_id],
                        named=measurement in named,
                        reviewed=measurement in reviewed,
                        no_sensors=no_sensors,
                        told=judged[measurement].found if measurement in judged else 0,
                    )
                )
    return groups


def _group(groups: list[LogGroup], all_histories: Sequence[History], rig: Rig, procedure: Procedure) -> LogGroup:
    """The group of a rig and procedure, which is added where there is none yet."""
    history = history_for([*all_histories, *(one.history for one in groups)], rig.kind, procedure)
    group = next((one for one in groups if one.history is history), None)
    if group is None:
        group = LogGroup(history, rig)
        groups.append(group)
    return group


def _log(
    store: Store,
    stored: StoredMeasurement,
    recording: RecordingRecord,
    *,
    named: bool,
    reviewed: bool,
    no_sensors: Collection[str],
    told: int,
) -> Log:
    measurement, given = stored.measurement_id, store.given_labels(stored.recording_id)
    called_clean = any(one.attack is None for one in given)
    labelled = reviewed or called_clean
    barred, look_at = _barred(store, stored, recording)
    used = looked_at(stored, recording)
    doubt, look_at = ("", look_at) if barred else _doubtful(stored, used.day, no_sensors)
    told = 0 if reviewed or given else told
    if told:  # whatever it is left out for
        remark, look_at = f"; {told} frames of it are in incidents or alerts", True
        barred, doubt = barred and barred + remark, doubt and doubt + remark
    return Log(
        used,
        partial(clean_frames_of, store, measurement),
        cache(partial(circumstances_of, store, measurement, recording)),
        named or labelled,
        labelled,
        reviewed and not called_clean,
        barred,
        doubt,
        look_at,
        told,
    )


def _barred(store: Store, stored: StoredMeasurement, recording: RecordingRecord) -> tuple[str, bool]:
    """Why a log is not learnt from, whoever calls it clean, and whether a person should look at it."""
    measurement = stored.measurement_id
    if stored.withheld:
        return f"its verdicts are withheld: {stored.withheld}", True
    if reason := attacked_by_labels(store, measurement) or held_by(store, recording):
        return reason, False
    if conflict := conflicts_of(store, recording):
        return conflict[0], True
    return "", False


def _doubtful(stored: StoredMeasurement, day: date | None, no_sensors: Collection[str]) -> tuple[str, bool]:
    """Why a log that nobody calls clean is not learnt from, and whether a person should look at it.

    One of a day that has not come yet would be the latest, and so learnt from for ever.
    """
    if day is not None and day > latest_day():
        return f"{day} has not come yet: was its clock wrong?", True
    if stored.measured < CLEAN_DRIVE.fewest_frames:
        return f"{stored.measured} frames, fewer than {CLEAN_DRIVE.fewest_frames}", False
    reading = reading_of(stored, no_sensors=no_sensors)
    if not reading.complete:
        return "; ".join(reading.remarks) or "it was not read whole", False
    if stored.calibration_warnings:
        return f"its calibration is in doubt: {stored.calibration_warnings[0]}", True
    return "", False
