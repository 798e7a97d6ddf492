"""The pages of a fleet: an index, and a page for each incident under its id."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from auditor.model.pictures import Pictures
from auditor.reporting.fleet.loading import MOST_DAYS, MOST_INCIDENTS, by_gravity, load_fleet
from auditor.reporting.fleet.page import FleetPage
from auditor.reporting.incident.one import Incidents, OneIncident
from auditor.reporting.incident.render import LEAST_COVERAGE, render_one
from auditor.reporting.numbers import FILTERS, count
from auditor.reporting.templates import fill
from auditor.store.reviews import incidents_named
from auditor.store.store import Store

INDEX, INCIDENTS = "index.html", "incidents"


def render_fleet_report(store: Store, *, out: Path, pictures: Pictures = Pictures.INCIDENTS) -> Path:
    """Write the pages of a store into a folder: those of its gravest incidents, then the index; answer the index.

    Where an incident has grown, its page is also written in the place of those under its former names: others may point
    to them. Pages of incidents that are no longer found stay. Raises StoreError where nothing was measured, or a page
    cannot be written.
    """
    incidents = Incidents(store, pictures)
    rows = by_gravity(incidents.rows)
    page = load_fleet(store, rows)
    former = _former_names(store, rows, out / INCIDENTS)
    # by measurement, so that what incidents of one recording share is read once
    for row in sorted(rows[:MOST_INCIDENTS], key=lambda row: row["measurement_id"]):
        _write_incident(store, incidents.one(row), out / INCIDENTS, former.get(row["incident_id"], ()))
    return store.write_page(out / INDEX, render(page))


def _write_incident(store: Store, one: OneIncident, folder: Path, former: Iterable[str]) -> None:
    """Write the page of an incident under its name, and under those of its former names that have a page."""
    for name in (one.row["incident_id"], *former):
        known_as = replace(one, former=name) if name in former else one
        store.write_page(folder / f"{name}.html", render_one(known_as, index=f"../{INDEX}"))


def _former_names(store: Store, rows: Iterable[Mapping[str, Any]], folder: Path) -> dict[str, list[str]]:
    """Names of pages in a folder that are those of incidents no more, by the ids of the incidents that they lead to."""
    left = {path.stem for path in folder.glob("*.html")} - {row["incident_id"] for row in rows}
    found: dict[str, list[str]] = {}
    for name, incident_id in sorted(incidents_named(store, left).items()) if left else ():
        if name in left:
            found.setdefault(incident_id, []).append(name)
    return found


def render(page: FleetPage) -> str:
    """The index as HTML. All of its text is escaped; it refers to the pages of incidents and to nothing else."""
    return fill(
        "fleet.html",
        {
            "page": page,
            "title": _title(page),
            "least_coverage": LEAST_COVERAGE,
            "max_days": MOST_DAYS,
        },
        filters=FILTERS,
    )


def _title(page: FleetPage) -> str:
    if page.open_count:
        return f"Sensor audit: {count(page.open_count, 'incident')} in {count(page.recordings, 'recording')}"
    return "Sensor audit: no attack found" if page.audited else "Sensor audit: nothing could be audited"
