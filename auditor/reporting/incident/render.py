"""The incident report: one self-contained HTML page, made from the store alone."""

from pathlib import Path

from auditor.identification.evidence_parameters import LIKELIHOOD
from auditor.model.pictures import Pictures
from auditor.reporting.incident.examples import data_uri
from auditor.reporting.incident.loading import MOST_SECTIONS, IncidentList, OneIncident, load_page
from auditor.reporting.incident.page import IncidentPage
from auditor.reporting.plots import LEFT_PX, RIGHT_PX
from auditor.reporting.templates import FILTERS, counted, fill
from auditor.store.reviews import incident_called
from auditor.store.store import Store

MOST_LISTED = 60
"""Recordings of a calibration, and other incidents, that the page of an incident lists."""

LEAST_COVERAGE = 0.99
"""Below this share of audited frames the page warns at its top."""


def render_incident_report(
    store: Store, *, out: Path, recording: str | None = None, pictures: Pictures = Pictures.INCIDENTS
) -> Path:
    """Write the page of one recording, or of the whole store.

    Parameters
    ----------
    store
        An opened one.
    out
        The file that is written.
    recording
        The name of a recording, its id or the first digits of that; the page is of all where it is None.
    pictures
        Which kept pictures the page shows.

    Returns
    -------
    Path
        `out`.

    Raises
    ------
    StoreError
        The store has no such recording, nothing was measured, or the page cannot be written.
    """
    return store.write_page(out, render(load_page(store, recording, pictures)))


def render(page: IncidentPage) -> str:
    """The page as HTML. All of its text is escaped; it refers to nothing outside itself."""
    return fill(
        "incident.html",
        {
            "page": page,
            "title": _title(page),
            "counted": counted(page.incident_count, page.alert_count),
            "left": LEFT_PX,
            "right": RIGHT_PX,
            "least_coverage": LEAST_COVERAGE,
            "most_sections": MOST_SECTIONS,
        },
        filters=FILTERS,
    )


def render_incident_page(store: Store, beginning: str, *, out: Path, pictures: Pictures = Pictures.INCIDENTS) -> Path:
    """Write the page of the incident whose id begins so; answer `out`.

    Raises StoreError unless it is just one, and where the page cannot be written.
    """
    incidents = IncidentList(store, pictures)
    row = incident_called(store, incidents.rows, beginning)
    return store.write_page(out, render_one(incidents.one(row)))


def render_one(incident: OneIncident, *, index: str | None = None, beside: bool = False) -> str:
    """The page of one incident as HTML. `index` is where the index lies, seen from the page; None where there is none.

    All of its text is escaped; it refers to the index and to nothing else, but to its pictures where they are `beside`.
    """
    subject = " and ".join(incident.row["attacked_names"]) or "no sensor can be named"
    return fill(
        "one_incident.html",
        {
            "one": incident,
            "title": f"Incident {incident.row['incident_id'][:12]}: {subject}",
            "place": data_uri("svg", incident.sketch.encode()) if incident.sketch else "",
            "index": index,
            "beside": beside,
            "left": LEFT_PX,
            "right": RIGHT_PX,
            "most_listed": MOST_LISTED,
            "further_sensor": f"{LIKELIHOOD.further_sensor:g}",
        },
        filters=FILTERS,
    )


def _title(page: IncidentPage) -> str:
    if not page.judged:
        return "Sensor audit: not judged"
    if not page.incidents:
        return "Sensor audit: no attack found" if page.audited else "Sensor audit: nothing could be audited"
    return f"Sensor audit: {counted(page.incident_count, page.alert_count)}"
