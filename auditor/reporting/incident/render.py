"""The incident report: one self-contained HTML page, made from the store alone."""

import math
from decimal import Decimal
from pathlib import Path

from markupsafe import Markup

from auditor.model.pictures import Pictures
from auditor.reporting.incident.loading import MOST_SECTIONS, load_page
from auditor.reporting.incident.page import IncidentPage
from auditor.reporting.plots import LEFT_PX, RIGHT_PX
from auditor.reporting.templates import fill
from auditor.store.store import Store

LEAST_COVERAGE = 0.99
"""Below this share of audited frames the page warns at its top."""

THIN_SPACE = "\u2009"
NO_BREAK_SPACE = "\u00a0"


def render_incident_report(
    store: Store, *, out: Path, recording: str | None = None, pictures: Pictures = Pictures.INCIDENTS
) -> Path:
    """Write the page of one recording (by name, id or first digits of its id), or of the whole store; answer `out`.

    Raises StoreError where the store has no such recording, nothing was measured, or the page cannot be written.
    """
    text = render(load_page(store, recording, pictures))
    store.write_page(out, text.encode())
    return out


def render(page: IncidentPage) -> str:
    """The page as HTML. All of its text is escaped; it refers to nothing outside itself."""
    return fill(
        "incident.html",
        {
            "page": page,
            "title": _title(page),
            "left": LEFT_PX,
            "right": RIGHT_PX,
            "least_coverage": LEAST_COVERAGE,
            "most_sections": MOST_SECTIONS,
        },
        filters={
            "count": _count,
            "duration": _duration,
            "first_upper": _first_upper,
            "percent": _percent,
            "rate": _rate,
            "thousands": _thousands,
        },
    )


def _title(page: IncidentPage) -> str:
    if not page.judged:
        return "Sensor audit: not judged"
    if not page.incidents:
        return "Sensor audit: no attack found" if page.audited else "Sensor audit: nothing could be audited"
    return f"Sensor audit: {_count(page.incident_count, 'incident')}"


def _thousands(number: int) -> str:
    return f"{number:,}".replace(",", THIN_SPACE)


def _count(number: int, what: str) -> str:
    return f"{_thousands(number)}{NO_BREAK_SPACE}{what}{'' if number == 1 else 's'}"


def _percent(share: float) -> str:
    """Per cent to one decimal, cut and not rounded: 100 % is shown for the whole only."""
    return f"{math.floor(share * 1000 + 1e-9) / 10:.1f}{NO_BREAK_SPACE}%"


def _rate(r: Decimal) -> str:
    return f"{(r * 100).normalize():f}{NO_BREAK_SPACE}%"


def _duration(seconds: float) -> str:
    if seconds < 60:
        return f"{seconds:.1f}{NO_BREAK_SPACE}s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes}{NO_BREAK_SPACE}min {rest:02d}{NO_BREAK_SPACE}s"
    return f"{minutes // 60}{NO_BREAK_SPACE}h {minutes % 60:02d}{NO_BREAK_SPACE}min"


def _first_upper(text: str | Markup) -> str | Markup:
    return text[:1].upper() + text[1:]
