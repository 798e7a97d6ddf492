"""The first page of a case: what is in its folder, what it lacks and why, its pictures, and how to check it."""

from dataclasses import dataclass

from auditor.reporting.incident.examples import ShownExample
from auditor.reporting.templates import fill


@dataclass(frozen=True)
class CasePage:
    """What the page shows; `words` is the evidence, `remarks` what the case lacks, `shown` its pictures."""

    title: str
    auditor_version: str
    incident_id: str
    words: str
    remarks: tuple[str, ...]
    shown: tuple[ShownExample, ...]
    has_place: bool
    files: tuple[str, ...]


def render_case(page: CasePage) -> str:
    """The page as HTML. All of its text is escaped; it refers to files of its folder alone."""
    return fill("case.html", {"page": page})
