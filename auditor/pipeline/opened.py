"""A store opened for a notebook: the answers of `auditor query` as tables of Arrow, pandas and polars."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from auditor.errors import QueryError, SettingError
from auditor.pipeline.asking import opened, query
from auditor.store import Connection, StoreFolder, list_queries, list_views, plain_connection
from auditor.store.export import Table

if TYPE_CHECKING:
    import pandas
    import polars


def open_store(path: str | Path) -> "OpenedStore":
    """Open a store to ask it questions; one at an address such as s3://bucket/audit is asked as it is now.

    Raises StoreError where there is none, or one of another version.
    """
    return OpenedStore(opened(path))


@dataclass(frozen=True)
class OpenedStore:
    """One store that answers as it is at each call: also after a new scan or judgement.

    `question` is the name of a query, with its parameters as keywords; the name of a view, for all of its rows; or one
    SELECT statement over the views.
    """

    store: StoreFolder

    def query(self, question: str, /, **parameters: object) -> Table:
        """The answer as a `pyarrow.Table`.

        Raises QueryError where there is no such query or view, a parameter does not fit or names nothing in the store,
        or the SQL is not allowed, and StoreError.
        """
        if question in {known.name for known in list_queries()}:
            return query(self.store, question, sql=None, **parameters)
        if parameters:
            raise QueryError("only a query has parameters", where=question, remedy="auditor query lists the queries")
        if question in {view.name for view in list_views()}:
            return query(self.store, sql=f"FROM {question}")  # our own name
        if re.fullmatch(r"\w+", question):
            raise QueryError("there is no such query or view", where=question, remedy="auditor query lists them")
        return query(self.store, sql=question)

    def df(self, question: str, /, **parameters: object) -> "pandas.DataFrame":
        """The answer as a pandas DataFrame. Raises as `query` does, and SettingError without pandas."""
        try:
            return self.query(question, **parameters).to_pandas()
        except ModuleNotFoundError as error:
            raise _not_installed(error) from error

    def pl(self, question: str, /, **parameters: object) -> "polars.DataFrame":
        """The answer as a polars DataFrame. Raises as `query` does, and SettingError without polars."""
        try:
            import polars  # noqa: PLC0415 - not everybody has it

            return polars.DataFrame(polars.from_arrow(self.query(question, **parameters)))
        except ModuleNotFoundError as error:
            raise _not_installed(error) from error

    def connection(self) -> Connection:
        """A connection of the package duckdb, with all views of the store as it is now. Raises StoreError.

        What views and columns mean stands in `duckdb_views()` and `duckdb_columns()`. The store can be read and
        not written; tables of one's own live in the connection's memory.
        """
        return plain_connection(self.store)


def _not_installed(error: ModuleNotFoundError) -> SettingError:
    return SettingError(
        f"the package {error.name} is not installed", where="open_store", remedy=f"pip install {error.name}"
    )
