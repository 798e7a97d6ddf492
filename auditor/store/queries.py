"""Questions to a store: the queries that come with auditor, and the user's own SQL in a sandbox."""

import re
from collections.abc import Mapping

import duckdb
import pyarrow as pa

from auditor.errors import QueryError
from auditor.store.connection import connected, in_one_line
from auditor.store.sql_files import SqlFile, Value, bind, queries
from auditor.store.store import Store


def list_queries() -> list[SqlFile]:
    """All queries, by name, without those that are for pages only (`report_...`)."""
    return [known for known in queries().values() if not known.name.startswith("report_")]


def query(name: str) -> SqlFile:
    """The query of a name. Raises QueryError."""
    try:
        return queries()[name]
    except KeyError:
        raise QueryError(
            "there is no such query",
            where=name,
            remedy=f"the queries are {', '.join(known.name for known in list_queries())}",
        ) from None


def run_query(store: Store, name: str, parameters: Mapping[str, object] | None = None) -> pa.Table:
    """The answer to a query.

    Raises QueryError where there is no such query or a parameter does not fit, and StoreError where a file of the
    store cannot be read.
    """
    wanted = query(name)
    return _run(store, wanted.sql, bind(wanted, parameters or {}), f"query {name}")


def run_sql(store: Store, text: str) -> pa.Table:
    """The answer to one SELECT statement of the user's own, over the views.

    It can read the store's finished files and nothing else, and write nothing. Raises QueryError where it is no single
    SELECT, is not allowed, or fails, and StoreError where a file of the store cannot be read.
    """
    try:
        text.encode()
    except UnicodeEncodeError as error:
        raise QueryError("it is not UTF-8", where="SQL", remedy="auditor query lists the views") from error
    return _run(store, text, {}, "SQL")


def _run(store: Store, text: str, values: Mapping[str, Value], where: str) -> pa.Table:
    with connected(store, text) as connection:
        try:
            statements = connection.extract_statements(text)
            if [statement.type for statement in statements] != [duckdb.StatementType.SELECT]:
                raise QueryError(
                    f"only one SELECT statement can be run, not {_kinds(statements)}",
                    where=where,
                    remedy="ask one question at a time; nothing can be changed from SQL",
                )
            return connection.sql(text, params=values).to_arrow_table()
        except (duckdb.Error, pa.ArrowException) as error:  # Arrow's where it cannot hold what DuckDB gives
            raise QueryError(in_one_line(error), where=where, remedy="auditor query lists the views") from error


def _kinds(statements: list[duckdb.Statement]) -> str:
    return " and ".join(statement.type.name for statement in statements) or "nothing"
