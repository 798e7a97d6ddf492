"""SQL files that describe themselves: a comment at their head says what they answer, from what, and in which columns.

-- One sentence.
--
-- param gap_s DOUBLE = 0.5: What it is.          (without a default it has to be given)
-- column seconds: What it is.
"""

import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from auditor.errors import StoreError
from auditor.resources import resource_folder

_PARAMETER = re.compile(r"param (?P<name>\w+) (?P<type>[A-Z]+(?:\[\])?)(?: = (?P<default>.+?))?: (?P<sentence>.+)")
_COLUMN = re.compile(r"column (?P<name>\w+): (?P<sentence>.+)")


@dataclass(frozen=True)
class Parameter:
    """One parameter of a query; `default` is as text would be given, None where NULL, and unused where required."""

    name: str
    type: str
    sentence: str
    required: bool
    default: str | None


@dataclass(frozen=True)
class SqlFile:
    """One view or query: what it says, its parameters, the columns it explains itself, and its SQL."""

    name: str
    text: str
    parameters: tuple[Parameter, ...]
    columns: dict[str, str]
    sql: str


def sql_files(folder: Path) -> tuple[SqlFile, ...]:
    """All SQL files of a folder, by name. Raises StoreError for a head that cannot be read."""
    return tuple(read_sql_file(path) for path in sorted(folder.glob("*.sql")))


@cache
def queries() -> dict[str, SqlFile]:
    """The queries by name: one question each."""
    return {query.name: query for query in sql_files(resource_folder("queries"))}


@cache
def views() -> dict[str, SqlFile]:
    """The views by name."""
    return {view.name: view for view in sql_files(resource_folder("queries") / "views")}


@cache
def macros() -> tuple[str, ...]:
    """The SQL text of all macros."""
    return tuple(macro.sql for macro in sql_files(resource_folder("queries") / "macros"))


def read_sql_file(path: Path) -> SqlFile:
    """Take a SQL file apart. Raises StoreError for a head that cannot be read."""
    lines = path.read_text(encoding="utf-8").splitlines()
    length = next((number for number, line in enumerate(lines) if not line.startswith("--")), len(lines))
    sentences: list[str] = []
    parameters: list[Parameter] = []
    columns: dict[str, str] = {}
    for line in (line.removeprefix("--").strip() for line in lines[:length]):
        if parameter := _PARAMETER.fullmatch(line):
            parameters.append(_parameter(parameter))
        elif column := _COLUMN.fullmatch(line):
            columns[column["name"]] = column["sentence"]
        elif line.startswith(("param ", "column ")):
            raise StoreError(f"the line {line!r} describes nothing", where=path)
        else:
            sentences.append(line)
    text = " ".join(" ".join(sentences).split())
    return SqlFile(path.stem, text, tuple(parameters), columns, "\n".join(lines[length:]))


def _parameter(found: re.Match[str]) -> Parameter:
    default = found["default"]
    return Parameter(
        name=found["name"],
        type=found["type"],
        sentence=found["sentence"],
        required=default is None,
        default=None if default == "NULL" else default,
    )
