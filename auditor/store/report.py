"""The incident report: one self-contained HTML page, made from the store alone."""

import math
import os
from decimal import Decimal
from pathlib import Path

import jinja2
from markupsafe import Markup

from auditor.errors import StoreError
from auditor.resources import resource_folder
from auditor.store.page import IncidentPage
from auditor.store.plots import LEFT_PX, RIGHT_PX

LEAST_COVERAGE = 0.99
"""Below this share of audited frames the page says so at its top."""

MOST_SECTIONS = 12
"""Recordings that are shown in full; of more, those with the most frames raised."""

THIN_SPACE = "\u2009"
NO_BREAK_SPACE = "\u00a0"


def render(page: IncidentPage) -> str:
    """The page as HTML. All of its text is escaped; it refers to nothing outside itself."""
    return (
        _environment()
        .get_template("incident.html")
        .render(
            page=page,
            title=_title(page),
            left=LEFT_PX,
            right=RIGHT_PX,
            least_coverage=LEAST_COVERAGE,
            most_sections=MOST_SECTIONS,
        )
    )


def write_whole(text: str, out: Path) -> Path:
    """Write a file beside its place and rename it into it. Raises StoreError where that fails."""
    beside = out.with_name(f".{out.name}.{os.getpid()}.part")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        beside.write_text(text, encoding="utf-8")
        beside.replace(out)
    except OSError as error:
        beside.unlink(missing_ok=True)
        raise StoreError(
            f"the report cannot be written ({error.strerror})", where=out, remedy="choose another place"
        ) from error
    return out


def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(resource_folder("reports")),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
    )
    environment.filters |= {
        "count": _count,
        "duration": _duration,
        "first_upper": _first_upper,
        "percent": _percent,
        "rate": _rate,
        "thousands": _thousands,
    }
    return environment


def _title(page: IncidentPage) -> str:
    if not page.judged:
        return "Sensor audit: not judged"
    if not page.incidents:
        return "Sensor audit: no attack found" if page.audited else "Sensor audit: nothing could be audited"
    return f"Sensor audit: {_count(len(page.incidents), 'incident')}"


def _thousands(number: int) -> str:
    return f"{number:,}".replace(",", THIN_SPACE)


def _count(number: int, what: str) -> str:
    return f"{_thousands(number)}{NO_BREAK_SPACE}{what}{'' if number == 1 else 's'}"


def _percent(share: float) -> str:
    """Per cent to one decimal, cut and not rounded: 100 % is said of the whole only."""
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
