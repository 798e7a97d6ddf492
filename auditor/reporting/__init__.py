"""Self-contained pages from a store."""

from auditor.reporting.drift.render import render_drift_page
from auditor.reporting.evaluation.render import render_evaluation_report
from auditor.reporting.incident.render import render_incident_report
from auditor.reporting.refresh.render import render_refresh_page

__all__ = ["render_drift_page", "render_evaluation_report", "render_incident_report", "render_refresh_page"]
