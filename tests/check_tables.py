"""The table of checks in docs/glossary.md: `python -m tests.check_tables` writes it."""

from collections.abc import Iterator
from pathlib import Path

from auditor.model.checks import Check
from auditor.model.checks.kind import Of, Vote

DOCUMENT = Path(__file__).resolve().parent.parent / "docs/glossary.md"
HEAD = "| check | of | it says | votes of two | of more | where |\n|---|---|---|---|---|---|\n"


def _rows() -> Iterator[str]:
    for check in Check:
        kind = check.kind
        by_pairs = kind.of in (Of.PAIRS, Of.SEVERAL_PAIRS)
        more = kind.vote.value if by_pairs or kind.of is Of.CAMERAS else "-"
        two = "-" if by_pairs else Vote.MEAN.value if kind.vote is Vote.LIGHT else more
        where = f"`checks/{check.where.replace('.', '/')}`"
        yield f"| {kind.words.label} | {kind.of.sensor} | {kind.words.says} | {two} | {more} | {where} |\n"


def table() -> str:
    """The whole of it."""
    return HEAD + "".join(_rows())


if __name__ == "__main__":
    before, _, rest = DOCUMENT.read_text(encoding="utf-8").partition(HEAD)
    DOCUMENT.write_text(before + table() + rest[rest.index("\n\n") + 1 :], encoding="utf-8")
