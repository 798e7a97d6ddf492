"""Pages from a store; no recording is needed to make them.

Names are imported when they are first used: a drawing of a rig needs none of what makes pages.
"""

from typing import TYPE_CHECKING

from auditor.model.lazy_names import imported_when_used

if TYPE_CHECKING:
    from auditor.reporting.evaluation.loading import render_evaluation_report
    from auditor.reporting.fleet import render_fleet_report
    from auditor.reporting.incident.render import render_incident_page, render_incident_report
    from auditor.reporting.refresh_page import render_drift_page, render_refresh_page

__all__ = [
    "render_drift_page",
    "render_evaluation_report",
    "render_fleet_report",
    "render_incident_page",
    "render_incident_report",
    "render_refresh_page",
]

__getattr__ = imported_when_used(
    __name__,
    {
        "evaluation.loading": "render_evaluation_report",
        "fleet": "render_fleet_report",
        "incident.render": "render_incident_page render_incident_report",
        "refresh_page": "render_drift_page render_refresh_page",
    },
)
