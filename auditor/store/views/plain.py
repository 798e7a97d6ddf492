"""A DuckDB connection to a store that stays open: for notebooks."""

from contextlib import suppress

import duckdb

from auditor.store.connection import connected
from auditor.store.store import Store

Connection = duckdb.DuckDBPyConnection


def plain_connection(store: Store) -> Connection:
    """A connection with all views of a store as they are now, with their comments.

    It can read the store's finished files and no others, and write none; tables of one's own live in its memory. Raises
    StoreError where a file of the store cannot be read.
    """
    connection = connected(store)
    with suppress(duckdb.TransactionException):  # within one, the first mistake would be the last question
        connection.rollback()
    return connection
