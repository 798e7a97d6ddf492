"""The pages of a fleet: an index, and a page for each incident under its id."""

from collections.abc import Mapping
from pathlib import Path

from auditor.model.pictures import Pictures
from auditor.reporting.fleet.loading import MOST_DAYS, MOST_INCIDENTS, by_gravity, excuses_by_review, load_fleet
from auditor.reporting.fleet.page import FleetPage
from auditor.reporting.incident.one import Incidents
from auditor.reporting.incident.render import LEAST_COVERAGE, render_one
from auditor.reporting.numbers import FILTERS, count
from auditor.reporting.templates import fill
from auditor.store.store import Store

INDEX = "index.html"


def render_fleet_report(
    store: Store,
    *,
    out: Path,
    pictures: Pictures = Pictures.INCIDENTS,
    excuses: Mapping[str, str] | None = None,
) -> Path:
    """Write the pages of a store into a folder: those of its gravest incidents, then the index; answer the index.

    `excuses` say by id why incidents need nobody's attention; without them reviews do. Pages of incidents that are no
    longer found stay: others may point to them. Raises StoreError where nothing was measured, or a page cannot be
    written.
    """
    incidents = Incidents(store, pictures)
    known = excuses_by_review(incidents.rows) if excuses is None else excuses
    rows = by_gravity(incidents.rows, known)
    page = load_fleet(store, rows, known)
    # by measurement, so that what incidents of one recording share is read once
    for row in sorted(rows[:MOST_INCIDENTS], key=lambda row: row["measurement_id"]):
        text = render_one(incidents.one(row), index=f"../{INDEX}")
        store.write_page(out / "incidents" / f"{row['incident_id']}.html", text.encode())
    store.write_page(out / INDEX, render(page).encode())
    return out / INDEX


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
