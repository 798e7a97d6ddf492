"""What SQL says of views and columns: the sentences of the files that make them."""

import duckdb

from auditor.store.schema import TABLES, Column, table_schema
from auditor.store.sql_files import SqlFile, views


def comments(connection: duckdb.DuckDBPyConnection) -> str:
    """The statements that comment on the views of a connection and on their columns."""
    columns = connection.execute(
        "SELECT table_name, column_name, data_type FROM duckdb_columns() WHERE NOT internal ORDER BY ALL"
    ).fetchall()
    described = [(views()[view], name, kind) for view, name, kind in columns if view in views()]
    of_views = {f"COMMENT ON VIEW {view.name} IS {literal(view.text)};" for view, _, _ in described}
    of_columns = [
        f'COMMENT ON COLUMN {view.name}."{name}" IS {literal(described_column(view, name, kind).in_words)};'
        for view, name, kind in described
    ]
    return "\n".join([*sorted(of_views), *of_columns])


def described_column(file: SqlFile, name: str, kind: str) -> Column:
    """A column of a view or query: as its own head explains it, or as the one table does that it can come from."""
    if name in file.columns:
        return Column(name, kind, file.columns[name])
    own = [column for column in _stored(file.name) if column.name == name]
    others = [column for table in TABLES for column in _stored(table) if (column.name, column.type) == (name, kind)]
    if own or name.endswith("_id") or len(others) == 1:
        return (own or others)[0]
    return Column(name, kind, "")


def literal(text: str) -> str:
    """A text as a literal of SQL."""
    return "'" + text.replace("'", "''") + "'"


def _stored(table: str) -> tuple[Column, ...]:
    return table_schema(table).columns if table in TABLES else ()
