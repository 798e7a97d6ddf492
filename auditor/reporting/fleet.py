"""The pages of a fleet: an index, which stays bounded however large the store is, and a page for each incident."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any

import auditor
from auditor.errors import StoreError
from auditor.model.pictures import Pictures
from auditor.model.verdict import VerdictKind
from auditor.reporting.incident.loading import IncidentList, OneIncident
from auditor.reporting.incident.page import Clock
from auditor.reporting.incident.render import LEAST_COVERAGE, render_one
from auditor.reporting.templates import FILTERS, count, counted, fill
from auditor.store.export import rows_of
from auditor.store.queries import run_query
from auditor.store.records import RecordingRecord
from auditor.store.reviews import excuse, incidents_named
from auditor.store.store import Store

INDEX, INCIDENTS = "index.html", "incidents"

MOST_INCIDENTS = 100
"""Incidents that are listed, each with a page; of more, the gravest."""

MOST_REASONS = 20
MOST_VEHICLES = 50
"""Vehicles that are shown; of more, those with the most incidents."""

MOST_DAYS = 14
"""Days that are shown; of more, the last."""

_GRAVITY = (VerdictKind.ATTACKED, VerdictKind.UNIDENTIFIED, VerdictKind.SUSPECT)

Row = Mapping[str, Any]


def render_fleet_report(store: Store, *, out: Path, pictures: Pictures = Pictures.INCIDENTS) -> Path:
    """Write the pages of a store into a folder: those of its gravest incidents, then the index; answer the index.

    Where an incident has grown, its page is also written in the place of those under its former names: others may point
    to them. Pages of incidents that are no longer found stay. Raises StoreError where nothing was measured, or a page
    cannot be written.
    """
    incidents = IncidentList(store, pictures)
    rows = by_gravity(incidents.rows)
    page = load_fleet(store, [row for row in rows if row["same_as"] is None])
    former = _former_names(store, rows, out / INCIDENTS)
    # by measurement, so that what incidents of one recording share is read once
    for row in sorted(rows[:MOST_INCIDENTS], key=lambda row: row["measurement_id"]):
        _write_incident(store, incidents.one(row), out / INCIDENTS, former.get(row["incident_id"], ()))
    return store.write_page(out / INDEX, render(page))


def by_gravity(incidents: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """The rows of the view `incidents`, the gravest first: what no review excuses, incidents, names of sensors."""
    return sorted(
        incidents,
        key=lambda row: (
            bool(excuse(row)),
            row["grade"] == "alert",
            _GRAVITY.index(VerdictKind(row["kind"])),
            bool(row["causes"]),
            -(row["largest_gap"] or 0),
            -row["frames"],
            row["incident_id"],
        ),
    )


def load_fleet(store: Store, incidents: Sequence[Row]) -> dict[str, Any]:
    """Everything that the index shows; `incidents` are all of the store, each once, the gravest first.

    What is listed is bounded; the counts are of everything. Raises StoreError where nothing was measured.
    """
    cells = rows_of(run_query(store, "report_days"))
    if not cells or not store.ids("measurements"):
        raise StoreError("nothing was measured", where=store.folder, remedy="run auditor scan first")
    recordings, frames, audited = (sum(cell[name] for cell in cells) for name in ("recordings", "frames", "audited"))
    vehicles = _vehicles(cells)
    days = sorted({day for vehicle in vehicles for day in vehicle["cells"] if day is not None})
    dateless = any(None in vehicle["cells"] for vehicle in vehicles)
    unaudited = rows_of(run_query(store, "report_unaudited"))
    excused = [row for row in incidents if excuse(row)]
    records = {record.recording_id: record for record in store.recordings()}
    return {
        "made_at": f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
        "auditor_version": auditor.__version__,
        "store": str(store.folder),
        "recordings": recordings,
        "frames": frames,
        "audited": audited,
        "coverage": audited / frames if frames else None,
        "vehicles": vehicles[:MOST_VEHICLES],
        "vehicle_count": len(vehicles),
        "days": [*days[-MOST_DAYS:], *([None] if dateless else [])],
        "day_count": len(days),
        "unaudited": unaudited[:MOST_REASONS],
        "reason_count": len(unaudited),
        "incidents": [_listed(row, records[row["recording_id"]]) for row in incidents[:MOST_INCIDENTS]],
        "incident_count": len(incidents),
        "excused": _in_words(excused),
        "open": _in_words([row for row in incidents if not excuse(row)]),
    }


def render(page: Row) -> str:
    """The index as HTML. All of its text is escaped; it refers to the pages of incidents and to nothing else."""
    title = "Sensor audit: no attack found" if page["audited"] else "Sensor audit: nothing could be audited"
    if page["open"]:
        where = count(page["recordings"], "recording")
        title = f"Sensor audit: {page['open']} in {where}"
    values = {"page": page, "title": title, "least_coverage": LEAST_COVERAGE, "max_days": MOST_DAYS, "counted": counted}
    return fill("fleet.html", values, filters=FILTERS)


def _vehicles(cells: Sequence[Row]) -> list[Row]:
    """The vehicles with their days, those with the most incidents and alerts that no review excuses first."""
    by_vehicle: defaultdict[str | None, dict[date | None, Row]] = defaultdict(dict)
    for cell in cells:
        day = None if cell["day"] is None else date.fromisoformat(str(cell["day"]))
        by_vehicle[cell["vehicle"]][day] = cell
    vehicles = [{"vehicle": vehicle, "cells": of_days} for vehicle, of_days in by_vehicle.items()]
    return sorted(vehicles, key=lambda row: (-sum(map(_open, row["cells"].values())), row["vehicle"] or ""))


def _in_words(incidents: Sequence[Row]) -> str:
    """How many incidents and alerts these are; of none, nothing."""
    alerts = sum(row["grade"] == "alert" for row in incidents)
    return counted(len(incidents) - alerts, alerts)


def _open(cell: Row) -> int:
    """The incidents and alerts of a vehicle's day that no review excuses."""
    return int(cell["incidents"] + cell["alerts"])


def _listed(row: Row, recording: RecordingRecord) -> Row:
    """An incident of the list: its row, when it began, and why it needs nobody's attention, empty where it does."""
    clock = Clock(recording.from_ns if recording.from_ns is not None else row["from_ns"], recording.clock == "utc")
    file = f"{INCIDENTS}/{row['incident_id']}.html"
    return {**row, "when": clock.moment(row["from_ns"]), "excuse": excuse(row), "file": file}


def _write_incident(store: Store, incident: OneIncident, folder: Path, former: Iterable[str]) -> None:
    """Write the page of an incident under its name, and under those of its former names that have a page."""
    for name in (incident.row["incident_id"], *former):
        known_as = replace(incident, former=name) if name in former else incident
        store.write_page(folder / f"{name}.html", render_one(known_as, index=f"../{INDEX}"))


def _former_names(store: Store, rows: Iterable[Row], folder: Path) -> dict[str, list[str]]:
    """Names of pages in a folder that are those of incidents no more, by the ids of the incidents that they lead to."""
    left = {path.stem for path in folder.glob("*.html")} - {row["incident_id"] for row in rows}
    names: dict[str, list[str]] = {}
    for name, incident_id in sorted(incidents_named(store, left).items()) if left else ():
        if name in left:
            names.setdefault(incident_id, []).append(name)
    return names
