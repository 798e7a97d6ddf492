"""Pages from a store; no recording is needed to make them."""

from auditor.reporting.drift_page import render_drift_page
from auditor.reporting.evaluation.loading import render_evaluation_report
from auditor.reporting.fleet import render_fleet_report
from auditor.reporting.incident.render import render_incident_page, render_incident_report
from auditor.reporting.refresh_page import render_refresh_page

__all__ = [
    "render_drift_page",
    "render_evaluation_report",
    "render_fleet_report",
    "render_incident_page",
    "render_incident_report",
    "render_refresh_page",
]
