"""From the store to the index of a fleet, which stays bounded however large the store is."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from datetime import UTC, date, datetime
from typing import Any

import auditor
from auditor.errors import StoreError
from auditor.model.verdict import VerdictKind
from auditor.reporting.fleet.page import DayCell, FleetPage, ListedIncident, UnauditedLine, VehicleRow
from auditor.reporting.incident.page import Clock
from auditor.store.export import rows_of
from auditor.store.queries import run_query
from auditor.store.records import RecordingRecord
from auditor.store.reviews import excuse
from auditor.store.store import Store

MOST_INCIDENTS = 100
"""Incidents that are listed, each with a page; of more, the gravest."""

MOST_REASONS = 20
MOST_VEHICLES = 50
"""Vehicles that are shown; of more, those with the most incidents."""

MOST_DAYS = 14
"""Days that are shown; of more, the last."""

_GRAVITY = (VerdictKind.ATTACKED, VerdictKind.UNIDENTIFIED, VerdictKind.SUSPECT)


def load_fleet(store: Store, incidents: Sequence[Mapping[str, Any]]) -> FleetPage:
    """Everything that the index shows; `incidents` are all of the store, the gravest first.

    Raises StoreError where nothing was measured.
    """
    rows = rows_of(run_query(store, "report_days"))
    if not rows or not store.ids("measurements"):
        raise StoreError("nothing was measured", where=store.folder, remedy="run auditor scan first")
    unaudited = [UnauditedLine(**row) for row in rows_of(run_query(store, "report_unaudited"))]
    vehicles = _vehicles(rows)
    days = sorted({day for row in vehicles for day in row.cells if day is not None})
    shown_days: list[date | None] = [*days[-MOST_DAYS:]]
    if any(None in row.cells for row in vehicles):
        shown_days.append(None)
    recordings = {one.recording_id: one for one in store.recordings()}
    return FleetPage(
        made_at=f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
        auditor_version=auditor.__version__,
        store=str(store.folder),
        cells=tuple(cell for row in vehicles for cell in row.cells.values()),
        vehicles=tuple(vehicles[:MOST_VEHICLES]),
        vehicle_count=len(vehicles),
        days=tuple(shown_days),
        day_count=len(days),
        unaudited=tuple(unaudited[:MOST_REASONS]),
        reason_count=len(unaudited),
        incidents=tuple(_listed(row, recordings[row["recording_id"]]) for row in incidents[:MOST_INCIDENTS]),
        incident_count=len(incidents),
        excused_count=sum(bool(excuse(row)) for row in incidents),
        alert_count=sum(row["grade"] == "alert" and not excuse(row) for row in incidents),
    )


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


def _vehicles(rows: Sequence[Mapping[str, Any]]) -> list[VehicleRow]:
    """The vehicles with their days, those with the most incidents that no review excuses first."""
    cells: defaultdict[str | None, dict[date | None, DayCell]] = defaultdict(dict)
    for row in rows:
        day = None if row["day"] is None else date.fromisoformat(str(row["day"]))
        counts = {name: row[name] for name in ("recordings", "frames", "audited", "incidents", "excused")}
        cells[row["vehicle"]][day] = DayCell(**counts)
    found = [VehicleRow(vehicle, of_days) for vehicle, of_days in cells.items()]
    return sorted(found, key=lambda row: (-sum(cell.open for cell in row.cells.values()), row.vehicle or ""))


def _listed(row: Mapping[str, Any], recording: RecordingRecord) -> ListedIncident:
    clock = Clock(recording.from_ns if recording.from_ns is not None else row["from_ns"], recording.clock == "utc")
    return ListedIncident(
        incident_id=row["incident_id"],
        grade=row["grade"],
        kind=row["kind"],
        sensors=tuple(row["attacked_names"]),
        recordings=tuple(part["name"] for part in row["parts"]),
        vehicle=row["vehicle"],
        when=clock.moment(row["from_ns"]),
        seconds=row["seconds"],
        frames=row["frames"],
        evidence=row["evidence"] or "",
        causes=row["causes"] or "",
        review=row["review"],
        excuse=excuse(row),
    )
