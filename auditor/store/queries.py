"""Questions to a store: the queries that come with auditor, what they are, and the user's own SQL in a sandbox."""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache

import duckdb
import pyarrow as pa

from auditor.errors import QueryError
from auditor.store.connection import (
    asking,
    connected,
    in_one_line,
    needed_by,
    raise_damage,
    shut_connection,
    with_views,
)
from auditor.store.folder import StoreFolder
from auditor.store.sandbox.limits import SqlLimits
from auditor.store.schema import Column
from auditor.store.sql_files import QueryParameter, SqlFile, Value, bind, described_column, queries, views

_BATCH_ROWS = 100_000
_REMEDY = "auditor query lists the views"
_OF_SQL = (
    duckdb.BinderException,
    duckdb.CatalogException,
    duckdb.ConversionException,
    duckdb.OutOfMemoryException,
    duckdb.ParserException,
    duckdb.PermissionException,
)
"""Errors that no damaged file causes."""

_READ_ONLY = "BEGIN TRANSACTION READ ONLY"
"""DuckDB 2 lets a SELECT hold INSERT, UPDATE and DELETE."""
_OUT_OF_MEMORY = "Out of Memory Error"
"""How DuckDB begins what it says there; inside an answer the error's class is Arrow's."""


def list_queries() -> list[SqlFile]:
    """All queries, by name, without those that are for pages only (`report_...`)."""
    return [known for known in queries().values() if not known.name.startswith("report_")]


def query(name: str) -> SqlFile:
    """The query of a name. Raises QueryError."""
    try:
        return queries()[name]
    except KeyError:
        if name in views():
            remedy = f'auditor query --sql "FROM {name} LIMIT 20" shows rows of it'
            raise QueryError("it is a view, not a query", where=name, remedy=remedy) from None
        raise QueryError(
            "there is no such query",
            where=name,
            remedy=_nearest(name, [known.name for known in list_queries()]),
        ) from None


def run_query(store: StoreFolder, name: str, parameters: Mapping[str, object] | None = None) -> pa.Table:
    """The answer to a query.

    Raises QueryError where there is no such query or a parameter does not fit, and StoreError where a file of the
    store cannot be read.
    """
    wanted = query(name)
    return _run(store, wanted.sql, bind(wanted, parameters or {}), f"query {name}")


def run_sql(store: StoreFolder, text: str) -> pa.Table:
    """The answer to one SELECT statement of our own, over the views, in this process; `sandbox` runs those of users.

    It can read the store's finished files and nothing else, and write nothing. Raises QueryError where it is no single
    SELECT, is not allowed, or fails, and StoreError where a file of the store cannot be read.
    """
    _refuse_but_select(text)
    return _run(store, text, {}, "SQL")


def run_sqls(store: StoreFolder, texts: Mapping[str, str | SqlFile]) -> dict[str, pa.Table]:
    """The answers to several SELECT statements of our own, or queries, by the names of these.

    The views are made once for all; queries have the values that their parameters have by default. Raises as `run_sql`
    does.
    """
    asked = {name: (one, {}) if isinstance(one, str) else (one.sql, bind(one, {})) for name, one in texts.items()}
    return _run_together(store, asked)


def run_queries(store: StoreFolder, wanted: Mapping[str, Mapping[str, object]]) -> dict[str, pa.Table]:
    """The answers to several queries with their parameters, by name: the views are made once for all.

    Raises as `run_query` does.
    """
    files = {name: query(name) for name in wanted}
    return _run_together(store, {name: (files[name].sql, bind(files[name], given)) for name, given in wanted.items()})


def _run_together(store: StoreFolder, asked: Mapping[str, tuple[str, dict[str, Value]]]) -> dict[str, pa.Table]:
    together = "\n".join(text for text, _ in asked.values())
    with asking(store, together) as connection, _in_one_line("SQL", store, together):
        return {name: _answer(connection, text, values) for name, (text, values) in asked.items()}


@contextmanager
def stream_sql(store: StoreFolder, text: str, limits: SqlLimits) -> Iterator[pa.RecordBatchReader]:
    """As `run_sql`, the answer batch by batch, never all of it in memory. Raises also LimitError."""
    _refuse_but_select(text)
    with connected(store, text, limits) as connection, _in_one_line("SQL", store, text, limits):
        connection.execute(_READ_ONLY)
        answer = connection.sql(text)
        yield answer.to_arrow_reader(_BATCH_ROWS)


def _run(store: StoreFolder, text: str, values: Mapping[str, Value], where: str) -> pa.Table:
    with asking(store, text) as connection, _in_one_line(where, store, text):
        connection.execute(_READ_ONLY)
        return _answer(connection, text, values)


def _answer(connection: duckdb.DuckDBPyConnection, text: str, values: Mapping[str, Value]) -> pa.Table:
    """The answer to one SELECT statement, all of it in memory.

    `connection.sql` would bind the text when it gets it, and once more when it runs it: a quarter of the time that a
    question of incidents takes.
    """
    answer = connection.execute(with_views(text), values)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Arrow output", UserWarning)  # DuckDB 2 says that it copies the rows
        return answer.to_arrow_table()


@contextmanager
def _in_one_line(where: str, store: StoreFolder, text: str, limits: SqlLimits | None = None) -> Iterator[None]:
    """Errors of DuckDB inside the block are ours, in one line: of a damaged file of the store, or of the SQL."""
    try:
        yield
    except (duckdb.Error, pa.ArrowException) as error:  # Arrow's where it cannot hold what DuckDB gives
        if limits is not None and _OUT_OF_MEMORY in str(error):
            raise limits.out_of_memory() from error
        if not isinstance(error, _OF_SQL):
            raise_damage(store, needed_by(text), error)
        raise QueryError(in_one_line(error), where=where, remedy=_REMEDY) from error


@cache
def _parser() -> duckdb.DuckDBPyConnection:
    """Reads statements and runs none."""
    return shut_connection()


def _refuse_but_select(text: str) -> None:
    """Raise QueryError for all but one SELECT statement, before any view is made."""
    try:
        text.encode()
    except UnicodeEncodeError as error:
        raise QueryError("it is not UTF-8", where="SQL", remedy=_REMEDY) from error
    with _parser().cursor() as parser:
        try:
            kinds = [_kind(statement) for statement in parser.extract_statements(text)]
        except duckdb.Error as error:
            raise QueryError(in_one_line(error), where="SQL", remedy=_REMEDY) from error
    if kinds != [duckdb.StatementType.SELECT.name]:
        raise QueryError(
            f"only one SELECT statement can be run, not {' and '.join(kinds) or 'nothing'}",
            where="SQL",
            remedy="ask one question at a time; nothing can be changed from SQL",
        )


def _kind(statement: duckdb.Statement) -> str:
    try:
        return statement.type.name
    except ValueError:  # DuckDB has statements that its Python package has no name for
        return "another"


def _nearest(name: str, names: Sequence[str]) -> str:
    near = get_close_matches(name, names, 1)
    return f"did you mean {near[0]}? auditor query lists all" if near else f"there are {', '.join(names)}"


@dataclass(frozen=True)
class Description:
    """One view or query (`what`): its sentences, its parameters where it is a query, and its columns."""

    name: str
    what: str
    text: str
    parameters: tuple[QueryParameter, ...]
    columns: tuple[Column, ...]


def describe(name: str) -> Description:
    """Describe a query or a view. Raises QueryError where there is none of this name."""
    if name in queries():
        return _described(queries()[name], "query")
    if name in views():
        return _described(views()[name], "view")
    names = [*(query.name for query in list_queries()), *views()]
    raise QueryError("there is no such query or view", where=name, remedy=_nearest(name, names))


def list_views() -> list[SqlFile]:
    """All views, by name."""
    return list(views().values())


def _described(file: SqlFile, category: str) -> Description:
    with asking(None, file.sql) as connection:
        answer = connection.sql(with_views(file.sql), params={parameter.name: None for parameter in file.parameters})
        types = dict(zip(answer.columns, map(str, answer.types), strict=True))
    columns = tuple(described_column(file, column, kind) for column, kind in types.items())
    return Description(file.name, category, file.text, file.parameters, columns)
