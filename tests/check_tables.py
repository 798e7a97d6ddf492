"""The table of checks in docs/glossary.md: `python -m tests.check_tables` writes it."""

from collections.abc import Iterator
from pathlib import Path

from auditor.model.checks import Check

DOCUMENT = Path(__file__).resolve().parent.parent / "docs/glossary.md"
HEAD = "| check | of | it says | votes |\n|---|---|---|---|\n"


def _rows() -> Iterator[str]:
    for check in Check:
        kind, votes = check.kind, check.kind.vote.value
        yield f"| {kind.words.label} | {kind.of.sensor} | {kind.words.says} | {votes} |\n"


def table() -> str:
    """The whole of it."""
    return HEAD + "".join(_rows())


if __name__ == "__main__":
    before, _, rest = DOCUMENT.read_text(encoding="utf-8").partition(HEAD)
    DOCUMENT.write_text(before + table() + rest[rest.index("\n\n") + 1 :], encoding="utf-8")
