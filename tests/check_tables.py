"""The tables of checks in docs/method.md and docs/glossary.md: `python -m tests.check_tables` writes them."""

from collections.abc import Iterator
from pathlib import Path

from auditor.model.checks import Check
from auditor.model.checks.kind import Of, Vote

DOCS = Path(__file__).resolve().parent.parent / "docs"
METHOD = "| check | of | it says | votes of two | of more |\n|---|---|---|---|---|\n"
GLOSSARY = "| check | what it says | where |\n|---|---|---|\n"


def _method() -> Iterator[str]:
    for check in Check:
        kind = check.kind
        by_pairs = kind.of in (Of.PAIRS, Of.SEVERAL_PAIRS)
        more = kind.vote.value if by_pairs or kind.of is Of.CAMERAS else "-"
        two = "-" if by_pairs else Vote.MEAN.value if kind.vote is Vote.LIGHT else more
        yield f"| {kind.words.label} | {kind.of.sensor} | {kind.words.says} | {two} | {more} |"


def _glossary() -> Iterator[str]:
    for check in Check:
        words = check.kind.words
        yield f"| {words.label} | {words.says} | `checks/{check.where.replace('.', '/')}` |"


def tables() -> dict[Path, tuple[str, str]]:
    """By document the head of its table and the whole of it."""
    rows = {"method": (METHOD, _method()), "glossary": (GLOSSARY, _glossary())}
    return {DOCS / f"{name}.md": (head, head + "".join(f"{row}\n" for row in of)) for name, (head, of) in rows.items()}


if __name__ == "__main__":
    for document, (head, table) in tables().items():
        before, _, rest = document.read_text(encoding="utf-8").partition(head)
        document.write_text(before + table + rest[rest.index("\n\n") + 1 :], encoding="utf-8")
