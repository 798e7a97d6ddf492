"""What readers are told of checks by their names, also of names that nobody declares any more."""

from auditor.model.checks.kind import Words
from auditor.model.checks.kinds import Check

FORMER = {"brightness_difference": "S_{i} or S_{k} alone sees light"}
"""The evidence of checks that verdicts of before know, of two sensors."""


def label_of(name: str) -> str:
    """The name of a check for readers; another name with spaces."""
    words = _words_of(name)
    return words.label if words else name.replace("_", " ")


def found_of(name: str, *, by_two: bool) -> str:
    """That a check fires, as a page says it of one sensor, or of one of two; its name where nothing is declared."""
    words = _words_of(name)
    return (words and (words.found_by_two if by_two else words.found)) or label_of(name)


def _words_of(name: str) -> Words | None:
    return Check(name).kind.words if name in Check.__members__.values() else None
