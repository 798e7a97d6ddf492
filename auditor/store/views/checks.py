"""SQL of what is declared of checks: the rows of the view `checks`, and their evidence in words."""

from collections.abc import Iterator

from auditor.model.checks import Check
from auditor.model.checks.kinds import FORMER
from auditor.store.views.comments import literal


def _row(check: Check) -> str:
    kind = check.kind
    texts = {
        "check_name": check.value,
        "label": kind.words.label,
        "sensor": kind.of.sensor,
        "others": kind.of.by,
        "says": kind.words.says,
        "counted": kind.counted.value,
    }
    fields = [f"{name}: {literal(text)}" for name, text in texts.items()]
    return "{" + ", ".join([*fields, f"position: {[*Check].index(check) + 1}"]) + "}"


def _cases() -> Iterator[str]:
    for check in Check:
        words = check.kind.words
        alone, two = (literal(text) for text in (words.evidence, words.evidence_by_two or words.evidence))
        yield f"WHEN '{check}' THEN CASE WHEN by_two THEN {two} ELSE {alone} END"
    yield from (f"WHEN '{name}' THEN CASE WHEN by_two THEN {literal(text)} END" for name, text in FORMER.items())


DECLARED_CHECKS = f"[{', '.join(map(_row, Check))}]"
"""A list of all checks."""

EVIDENCE_TEMPLATE = f"CASE check_name {' '.join(_cases())} END"
"""The evidence of a check_name, of one sensor {i} or by_two {i} and {k}; NULL of another name."""
