"""What views and queries are: taken from the files that make them, so it cannot differ from what they do."""

import re
from dataclasses import dataclass

from auditor.errors import QueryError
from auditor.store.connection import connected
from auditor.store.queries import list_queries
from auditor.store.schema import TABLES, Column, table_schema
from auditor.store.sql_files import Parameter, SqlFile, queries, views


@dataclass(frozen=True)
class Description:
    """One view or query (`what`): its sentences, its parameters where it is a query, and its columns."""

    name: str
    what: str
    text: str
    parameters: tuple[Parameter, ...]
    columns: tuple[Column, ...]


def describe(name: str) -> Description:
    """Describe a query or a view. Raises QueryError where there is none of this name."""
    if name in queries():
        return _described(queries()[name], "query")
    if name in views():
        return _described(views()[name], "view")
    known = ", ".join([*(known.name for known in list_queries()), *views()])
    raise QueryError("there is no such query or view", where=name, remedy=f"there are {known}")


def list_views() -> list[SqlFile]:
    """All views, by name."""
    return list(views().values())


def _described(file: SqlFile, what: str) -> Description:
    with connected(None, file.sql) as connection:
        answer = connection.sql(file.sql, params={parameter.name: None for parameter in file.parameters})
        types = dict(zip(answer.columns, map(str, answer.types), strict=True))
    columns = tuple(_column(file, column, kind) for column, kind in types.items())
    return Description(file.name, what, file.text, file.parameters, columns)


def _column(file: SqlFile, name: str, kind: str) -> Column:
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
    for known in (own, named, others):
        if len(known) == 1 or (known and name.endswith("_id")):
            return known[0]
    return Column(name, kind, "")


def _stored(table: str) -> tuple[Column, ...]:
    return table_schema(table).columns if table in TABLES else ()
