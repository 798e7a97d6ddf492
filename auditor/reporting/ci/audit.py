"""An audit as its other forms take it: what became of each recording, and which incidents fail."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from auditor.model.text import one_line
from auditor.reporting.ci.policy import Decided


@dataclass(frozen=True)
class Left:
    """A recording that was not audited, or not fully, and why."""

    name: str
    path: str
    reason: str


@dataclass(frozen=True)
class Audit:
    """`recordings` are rows of the view `summary`, `paths` where they were read, by their ids."""

    recordings: Sequence[Mapping[str, Any]]
    paths: Mapping[str, str]
    decided: Sequence[Decided]
    left: Sequence[Left]
    exit_code: int


def sentence(one: Decided) -> str:
    """What was found, in one line."""
    row = one.incident
    what = f"{' and '.join(row['attacked_names'])} attacked" if row["attacked_names"] else _WORDS[row["kind"]]
    where = f"frames {row['first_frame']} to {row['last_frame']} of {row['name']}, {row['seconds']:.1f} s"
    evidence = f": {row['evidence']}" if row["evidence"] else ""
    return one_line(f"{what} in {where}{evidence}")


_WORDS = {
    "attacked": "an attack",
    "unidentified": "an attack whose sensor cannot be named",
    "suspect": "a suspected attack",
}
