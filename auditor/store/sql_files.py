"""SQL files that describe themselves: a comment at their head has what they answer, from what, and in which columns.

From it come the comments on views and columns. The rows of the view `checks` come from what is declared of checks.

-- One sentence.
--
-- param gap_s DOUBLE = 0.5: What it is.          (without a default it has to be given)
-- column seconds: What it is.
"""

import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from decimal import Decimal, InvalidOperation
from functools import cache
from pathlib import Path

import duckdb

from auditor.errors import QueryError, StoreError
from auditor.model.checks import Check
from auditor.model.checks.words import FORMER
from auditor.model.text import storable
from auditor.resources import resource_folder
from auditor.store.schema import TABLES, Column, table_schema

_PARAMETER = re.compile(r"param (?P<name>\w+) (?P<type>[A-Z]+(?:\[\])?)(?: = (?P<default>.+?))?: (?P<sentence>.+)")


_STAMP = re.compile(r"\s*-?[0-9]+\s*")
_STAMPS_END = 2**63
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)

_MACRO = re.compile(r"^CREATE MACRO (\w+).*?;$", re.MULTILINE | re.DOTALL)

_COLUMN = re.compile(r"column (?P<name>\w+): (?P<sentence>.+)")


@dataclass(frozen=True)
class QueryParameter:
    """One parameter of a query; `default` is as text would be given, None where NULL, and unused where required."""

    name: str
    type: str
    sentence: str
    required: bool
    default: str | None


@dataclass(frozen=True)
class SqlFile:
    """One view or query: its sentences, its parameters, the columns it explains itself, and its SQL."""

    name: str
    text: str
    parameters: tuple[QueryParameter, ...]
    columns: dict[str, str]
    sql: str


def sql_files(folder: Path) -> tuple[SqlFile, ...]:
    """All SQL files of a folder, by name. Raises StoreError for a head that cannot be read."""
    return tuple(read_sql_file(path) for path in sorted(folder.glob("*.sql")))


@cache
def queries() -> dict[str, SqlFile]:
    """The queries by name: one question each. A view that has parameters is a query as well."""
    asked = [view for view in _view_files() if view.parameters]
    return {query.name: query for query in sorted([*sql_files(resource_folder("queries")), *asked], key=_name)}


@cache
def views() -> dict[str, SqlFile]:
    """The views by name; in the place of its parameters a view has their defaults."""
    return {view.name: replace(view, sql=_with_defaults(view), parameters=()) for view in _view_files()}


@cache
def _view_files() -> tuple[SqlFile, ...]:
    return sql_files(resource_folder("queries") / "views")


def _name(file: SqlFile) -> str:
    return file.name


def _with_defaults(view: SqlFile) -> str:
    """The SQL of a view, where a view can have no parameters."""
    values = {one.name: "NULL" if one.default is None else one.default for one in view.parameters}
    defaults = {one.name: f"CAST({values[one.name]} AS {one.type})" for one in view.parameters}
    return re.sub(r"\$(\w+)", lambda found: defaults[found[1]], view.sql)


@cache
def macros() -> dict[str, str]:
    """The statements that make the macros, by name."""
    files = sql_files(resource_folder("queries") / "macros")
    return {found[1]: found[0].strip() for file in files for found in _MACRO.finditer(file.sql)}


def read_sql_file(path: Path) -> SqlFile:
    """Take a SQL file apart. Raises StoreError for a head that cannot be read."""
    lines = path.read_text(encoding="utf-8").splitlines()
    length = next((number for number, line in enumerate(lines) if not line.startswith("--")), len(lines))
    sentences: list[str] = []
    parameters: list[QueryParameter] = []
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


def _parameter(declaration: re.Match[str]) -> QueryParameter:
    default = declaration["default"]
    return QueryParameter(
        name=declaration["name"],
        type=declaration["type"],
        sentence=declaration["sentence"],
        required=default is None,
        default=None if default == "NULL" else default,
    )


Value = str | int | float | bool | Decimal | list[str] | None


def bind(query: SqlFile, given: Mapping[str, object]) -> dict[str, Value]:
    """The value of each parameter of a query.

    Raises QueryError that names a parameter that is missing, unknown or of another type.
    """
    parameters = {parameter.name: parameter for parameter in query.parameters}
    for name in given:
        if name not in parameters:
            raise QueryError(
                f"it has no parameter {name!r}",
                where=f"query {query.name}",
                remedy=f"its parameters are {', '.join(parameters)}" if parameters else "it has none",
            )
    return {name: _value(query, parameter, given) for name, parameter in parameters.items()}


def _value(query: SqlFile, parameter: QueryParameter, given: Mapping[str, object]) -> Value:
    if parameter.name not in given and parameter.required:
        raise QueryError(
            f"parameter {parameter.name} is missing",
            where=f"query {query.name}",
            remedy=f"write {parameter.name}={_EXAMPLES.get(parameter.type, '...')}: {parameter.sentence}",
        )
    value = given.get(parameter.name, parameter.default)
    if value is None:
        return None
    try:
        return _CONVERSIONS[parameter.type](value)
    except (ValueError, TypeError, InvalidOperation):
        raise QueryError(
            f"parameter {parameter.name} is {value!r}, not {_MEANING[parameter.type]}",
            where=f"query {query.name}",
            remedy=parameter.sentence,
        ) from None


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise TypeError
    return storable(value)


def _integer(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, str | int):
        raise TypeError
    return int(value)


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, str | int | float | Decimal):
        raise TypeError
    number = float(value)
    if not math.isfinite(number):
        raise ValueError
    return number


def _time(value: object) -> int:
    """A stamp in nanoseconds: as it is given, or of a time; one without a zone is UTC."""
    if isinstance(value, str) and not _STAMP.fullmatch(value):
        value = datetime.fromisoformat(value.strip())
    if isinstance(value, datetime):
        moment = value if value.tzinfo else value.replace(tzinfo=UTC)
        return (moment - _EPOCH) // timedelta(microseconds=1) * 1000
    stamp_ns = _integer(value)
    if abs(stamp_ns) >= _STAMPS_END:
        raise ValueError
    return stamp_ns


def _rates(value: object) -> list[str]:
    """Designated false-alarm rates, exact: they travel as text and become DECIMAL in SQL."""
    parts = value.split(",") if isinstance(value, str) else value if isinstance(value, list | tuple) else [value]
    return [_rate(part) for part in parts]


def _rate(value: object) -> str:
    if isinstance(value, bool) or not isinstance(value, str | int | float | Decimal):
        raise TypeError
    rate = Decimal(str(value).strip())
    if not 0 <= rate <= 1 or rate != round(rate, 17):
        raise ValueError
    return format(rate, "f")


def _statistic(value: object) -> str:
    from auditor.model.measurement import Statistic  # noqa: PLC0415 - heavy, and few questions have one

    return Statistic(_text(value)).value


_CONVERSIONS: Mapping[str, Callable[[object], Value]] = {
    "VARCHAR": _text,
    "BIGINT": _integer,
    "DOUBLE": _number,
    "TIME": _time,
    "STATISTIC": _statistic,
    "RATE": _rate,
    "RATE[]": _rates,
}


_EXAMPLES = {"BIGINT": "12", "DOUBLE": "0.5", "RATE": "0.01", "TIME": "2026-01-05T18:40:00"}


_MEANING = {
    "VARCHAR": "a text",
    "BIGINT": "a whole number",
    "DOUBLE": "a number",
    "TIME": "a time such as 2026-01-05T18:40:00 or a stamp in nanoseconds",
    "STATISTIC": "plain or gated",
    "RATE": "a number between 0 and 1",
    "RATE[]": "a list of numbers between 0 and 1",
}


def comments(connection: duckdb.DuckDBPyConnection) -> str:
    """The statements that comment on the views of a connection, the stored tables behind them, and their columns."""
    columns = connection.execute(
        "SELECT table_name, table_name IN (SELECT view_name FROM duckdb_views()), column_name, data_type"
        " FROM duckdb_columns() WHERE NOT internal ORDER BY table_name, column_index"
    ).fetchall()
    statements = {}
    for table, is_view, name, kind in columns:
        if described := _described(table, name, kind):
            statements[f"{'VIEW' if is_view else 'TABLE'} {table}"] = described[0]
            statements[f'COLUMN {table}."{name}"'] = described[1]
    return "\n".join(f"COMMENT ON {what} IS {literal(words)};" for what, words in statements.items())


def _described(table: str, name: str, kind: str) -> tuple[str, str] | None:
    """The sentences of a view or stored table and of a column of it; None of what is neither."""
    if table in views():
        return views()[table].text, described_column(views()[table], name, kind).in_words
    schema = table.removeprefix("stored_")
    if schema != table and schema in TABLES:
        sentences = {column.name: column.in_words for column in _stored(schema)}
        return table_schema(schema).sentence, sentences[name]
    return None


def described_column(file: SqlFile, name: str, kind: str) -> Column:
    """A column of a view or query: as its own head explains it, or as the one table does that it can come from.

    Tables that its SQL names go before all others.
    """
    if name in file.columns:
        return Column(name, kind, file.columns[name])
    own = [column for column in _stored(file.name) if column.name == name]
    there = {table: [one for one in _stored(table) if (one.name, one.type) == (name, kind)] for table in TABLES}
    words = set(re.findall(r"\w+", file.sql))
    named = [column for table, columns in there.items() if {table, f"stored_{table}"} & words for column in columns]
    others = [column for columns in there.values() for column in columns]
    for candidates in (own, named, others):
        if len(candidates) == 1 or (candidates and name.endswith("_id")):
            return candidates[0]
    return Column(name, kind, "")


def literal(text: str) -> str:
    """A text as a literal of SQL."""
    return "'" + text.replace("'", "''") + "'"


def _stored(table: str) -> tuple[Column, ...]:
    return table_schema(table).columns if table in TABLES else ()


def _declared(check: Check) -> str:
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


def _evidence_cases() -> Iterator[str]:
    for check in Check:
        words = check.kind.words
        sentence = words.evidence or f"the LiDAR {words.found}"
        alone, two = (literal(text) for text in (sentence, words.evidence_by_two or sentence))
        yield f"WHEN '{check}' THEN CASE WHEN by_two THEN {two} ELSE {alone} END"
    yield from (f"WHEN '{name}' THEN CASE WHEN by_two THEN {literal(text)} END" for name, text in FORMER.items())


DECLARED_CHECKS = f"[{', '.join(map(_declared, Check))}]"
"""A list of all checks."""

EVIDENCE_TEMPLATE = f"CASE check_name {' '.join(_evidence_cases())} END"
"""The evidence of a check_name, of one sensor {i} or by_two {i} and {k}; NULL of another name."""
