"""What SQL says of views and columns: the sentences of the files that make them."""

import re

import duckdb

from auditor.store.schema import TABLES, Column, table_schema
from auditor.store.sql_files import SqlFile, views


def comments(connection: duckdb.DuckDBPyConnection) -> str:
    """The statements that comment on the views of a connection, the stored tables behind them, and their columns."""
    found = connection.execute(
        "SELECT table_name, table_name IN (SELECT view_name FROM duckdb_views()), column_name, data_type"
        " FROM duckdb_columns() WHERE NOT internal ORDER BY table_name, column_index"
    ).fetchall()
    statements = {}
    for table, is_view, name, kind in found:
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
    for known in (own, named, others):
        if len(known) == 1 or (known and name.endswith("_id")):
            return known[0]
    return Column(name, kind, "")


def literal(text: str) -> str:
    """A text as a literal of SQL."""
    return "'" + text.replace("'", "''") + "'"


def _stored(table: str) -> tuple[Column, ...]:
    return table_schema(table).columns if table in TABLES else ()
