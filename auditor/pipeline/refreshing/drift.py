"""Drift of a fleet: the daily levels of a store, and what became of each check of each sensor."""

from collections.abc import Iterator, Mapping, Sequence
from datetime import date, timedelta
from itertools import groupby
from typing import Any

import numpy as np

from auditor.identification.drift import DailyLevels, Drift, SeriesName, drifts
from auditor.identification.refresh_parameters import DRIFT, LEAST_DEVIATIONS
from auditor.pipeline.calibrations.versions import latest_day
from auditor.store.queries import run_sql
from auditor.store.store import Store
from auditor.store.versions.drift import FleetDrift, LevelChange, SensorDrift

_EPOCH = date(1970, 1, 1)
_DAYS = """
SELECT max(day) AS last_day, count(*) AS recordings, count(*) - count(day) AS of_nobody
FROM (
    SELECT if(vehicle IS NULL OR day > DATE '{latest}', NULL, day) AS day
    FROM (
        SELECT
            vehicle,
            CASE WHEN date IS NULL AND clock = 'utc' THEN CAST(make_timestamp_ns(from_ns) AS DATE) ELSE date END AS day
        FROM recordings
    )
)
"""


def fleet_drift(store: Store, days: int = DRIFT.days) -> FleetDrift:
    """The drift of a store's vehicles over the last days that have come. Raises StoreError."""
    [extent] = run_sql(store, _DAYS.format(latest=latest_day())).to_pylist()
    last_day: date | None = extent["last_day"]
    first_day = last_day - timedelta(days=days - 1) if last_day is not None else None
    rows = _rows(store, first_day, last_day) if last_day is not None else []
    comparisons = list(_comparisons(rows))
    rigs = {(row["kind"], row["vehicle"], row["day"]): row["rigs"] for row in rows}
    units = {row["check_name"]: row["unit"] for row in rows}
    sensor_drifts = [_sensor(one, units, rigs) for one in drifts(comparisons, LEAST_DEVIATIONS.of)]
    sensor_drifts.sort(key=lambda one: (not one.named, one.chance, one.vehicle, one.sensor, one.check))
    return FleetDrift(
        tuple(sensor_drifts), first_day, last_day, extent["recordings"], extent["of_nobody"], DRIFT.false_alarms
    )


def _rows(store: Store, first_day: date | None, last_day: date) -> list[dict[str, Any]]:
    days = f"day BETWEEN DATE '{first_day}' AND DATE '{last_day}'"
    sql = f"SELECT * FROM daily_levels WHERE {days} AND frames >= {DRIFT.fewest_frames}"  # noqa: S608 - ours
    rows: list[dict[str, Any]] = run_sql(store, sql).to_pylist()
    return rows


def _comparisons(rows: Sequence[Mapping[str, Any]]) -> Iterator[DailyLevels]:
    def name(row: Mapping[str, Any]) -> SeriesName:
        return SeriesName(row["kind"], row["check_name"], tuple(row["sensors"]), row["vehicle"])

    for series, some in groupby(sorted(rows, key=lambda row: (name(row), row["day"])), name):
        of_series = list(some)
        day = np.array([(row["day"] - _EPOCH).days for row in of_series], dtype=np.int64)
        level = np.array([row["level"] for row in of_series], dtype=np.float64)
        yield DailyLevels(series, of_series[0]["signed"], day, level)


def _sensor(drift: Drift, units: Mapping[str, str], rigs: Mapping[tuple[str, str, date], list[str]]) -> SensorDrift:
    kind, vehicle = drift.name.kind, drift.name.vehicle
    days = [_date(day) for day in drift.levels.day.tolist()]
    change = None
    if drift.changes:
        last = drift.changes[-1]
        after, on = _date(last.after_day), _date(last.on_day)
        anew = rigs[kind, vehicle, after] != rigs[kind, vehicle, on]
        change = LevelChange(after, on, last.before, last.now, anew)
    return SensorDrift(
        vehicle=vehicle,
        sensor=drift.name.sensors[0],
        check=drift.name.check,
        level=drift.level,
        unit=units[drift.name.check],
        per_day=drift.per_day,
        drifting=drift.trending,
        days_left=drift.days_left,
        change=change,
        chance=min([drift.chance, *(known.chance for known in drift.changes)]),
        deviation=drift.deviation,
        kind=kind,
        levels=tuple(zip(days, drift.levels.level.tolist(), strict=True)),
    )


def _date(day: int) -> date:
    return _EPOCH + timedelta(days=day)
