"""Macros of what Python declares: numbers, the rows of the view `checks`, and the evidence of checks in words."""

from collections.abc import Iterator

from auditor.model.checks import Check
from auditor.model.checks.kinds import FORMER
from auditor.model.measurement import MIN_VALID_PX
from auditor.model.parameters import RIG_KIND_TOLERANCE
from auditor.store.evaluation_tables import CHUNK_FRAMES, INTERVAL_FRAMES
from auditor.store.views.comments import literal

_NUMBERS = {
    "robust_block_frames": CHUNK_FRAMES,
    "interval_frames": INTERVAL_FRAMES,
    "min_valid_px": MIN_VALID_PX,
    "kind_tolerance_share": RIG_KIND_TOLERANCE.share,
    "kind_tolerance_m": RIG_KIND_TOLERANCE.baseline_m,
}


def declared_macros() -> dict[str, str]:
    """The statements that make them, by the names of `connection.DECLARED`.

    The evidence of a check is of one sensor {i} or by_two {i} and {k}; NULL of another name.
    """
    evidence = f"CASE check_name {' '.join(_cases())} END"
    return {
        **{name: f"CREATE MACRO {name}() AS {value};" for name, value in _NUMBERS.items()},
        "declared_checks": f"CREATE MACRO declared_checks() AS [{', '.join(map(_row, Check))}];",
        "evidence_template": f"CREATE MACRO evidence_template(check_name, by_two) AS {evidence};",
    }


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
