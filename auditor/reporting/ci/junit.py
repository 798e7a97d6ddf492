"""An audit as JUnit XML: one test case a recording, which fails where an incident does, or is an error if unaudited."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from auditor.reporting.ci.audit import Audit, sentence
from auditor.reporting.ci.policy import Decided
from auditor.reporting.templates import fill


@dataclass(frozen=True)
class _Case:
    """A recording: its incidents that fail and those that are excused, and why it was not fully audited."""

    name: str
    vehicle: str | None
    decided: Sequence[Decided]
    reason: str

    @property
    def failing(self) -> list[str]:
        return [sentence(one) for one in self.decided if one.fails]

    @property
    def error(self) -> str:
        return "" if self.failing else self.reason

    @property
    def kinds(self) -> str:
        return " ".join(sorted({one.incident["kind"] for one in self.decided if one.fails}))

    @property
    def text(self) -> str:
        return "; ".join([*self.failing, *filter(None, [self.reason])])

    @property
    def excused(self) -> str:
        return "; ".join(f"{sentence(one)} ({one.excuse})" for one in self.decided if not one.fails)


def junit(audit: Audit) -> str:
    """An audit as the text of a JUnit XML file."""
    return fill("junit.xml", {"cases": list(_cases(audit))}) + "\n"


def _cases(audit: Audit) -> Iterator[_Case]:
    """The recordings that have rows, and then those of which nothing could be read."""
    left = {(one.name, one.path): one for one in audit.left}
    for recording_id, row in {row["recording_id"]: row for row in audit.recordings}.items():
        of_it = left.pop((row["name"], audit.paths.get(recording_id, "")), None)
        decided = [
            one for one in audit.decided if any(part["recording_id"] == recording_id for part in one.incident["parts"])
        ]
        yield _Case(row["name"], row["vehicle"], decided, of_it.reason if of_it else "")
    for one in left.values():
        yield _Case(one.name, None, (), one.reason)
