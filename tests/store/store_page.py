"""The lists of docs/store.md, from the files that make tables, views and queries: `python -m tests.store.store_page`.

Writes them into the page, below the first paragraph of each heading; all other text of the page stays.
"""

import re
import textwrap
from collections.abc import Iterator
from pathlib import Path

from auditor.store.queries import list_queries, list_views
from auditor.store.schema import TABLES, table_schema
from auditor.store.sql_files import QueryParameter

PAGE = Path(__file__).parents[2] / "docs" / "store.md"


def paragraph(text: str, *, item: bool = False) -> str:
    first, rest = ("* ", "  ") if item else ("", "")
    return textwrap.fill(
        text, 112, initial_indent=first, subsequent_indent=rest, break_long_words=False, break_on_hyphens=False
    )


def parameter(known: QueryParameter) -> str:
    default = "required" if known.required else f"default {known.default or 'NULL'}"
    return paragraph(f"`{known.name}` {known.type}, {default}: {known.sentence}", item=True)


def questions() -> Iterator[str]:
    for query in list_queries():
        yield f"### {query.name}\n\n{paragraph(query.text)}\n"
        if query.parameters:
            yield "\n".join(map(parameter, query.parameters)) + "\n"


def lists() -> dict[str, str]:
    """What stands below each heading that is not written by hand."""
    tables = [paragraph(f"`{t.name}` (`{t.file}`): {t.sentence}", item=True) for t in map(table_schema, TABLES)]
    views = [paragraph(f"`{view.name}`: {view.text}", item=True) for view in list_views()]
    return {"Tables": "\n".join(tables) + "\n", "Views": "\n".join(views) + "\n", "Queries": "\n".join(questions())}


def written_anew(page: str) -> str:
    """The page with its lists as they should be."""
    for heading, text in lists().items():
        below = re.compile(rf"(^## {heading}\n\n.+?\n\n).*?(?=^## |\Z)", re.MULTILINE | re.DOTALL)
        more = "\n" if heading != "Queries" else ""
        page = below.sub(lambda found, text=text + more: found[1] + text, page, count=1)
    return page


if __name__ == "__main__":
    PAGE.write_text(written_anew(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
