"""Where and when a measurement was recorded: the ground that the vehicle was on, and how high the sun stood there."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from math import asin, cos, degrees, pi, radians, sin

from auditor.identification.refresh_parameters import CONDITIONS, INFLUENCE
from auditor.identification.refreshing.influence import Cell
from auditor.store import RecordingRecord, Store
from auditor.store.tables import read_rows

_M_OF_A_DEGREE = 111_195.0  # of a great circle on the Earth's mean radius


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
    if elevation > CONDITIONS.twilight_deg:
        return TimeOfDay.DAY
    return TimeOfDay.TWILIGHT if elevation > -CONDITIONS.twilight_deg else TimeOfDay.NIGHT
