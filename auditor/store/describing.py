"""What views and queries are: taken from the files that make them, so it cannot differ from what they do."""

from dataclasses import dataclass

from auditor.errors import QueryError
from auditor.store.connection import asking
from auditor.store.queries import list_queries
from auditor.store.schema import Column
from auditor.store.sql_files import Parameter, SqlFile, queries, views
from auditor.store.views.comments import described_column


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
    with asking(None, file.sql) as connection:
        answer = connection.sql(file.sql, params={parameter.name: None for parameter in file.parameters})
        types = dict(zip(answer.columns, map(str, answer.types), strict=True))
    columns = tuple(described_column(file, column, kind) for column, kind in types.items())
    return Description(file.name, what, file.text, file.parameters, columns)
