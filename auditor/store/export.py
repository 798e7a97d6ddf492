"""Rows leave the store: as JSON, CSV or Parquet."""

import io
import json
import math

import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq

Table = pa.Table
"""The form of every answer: an Arrow table."""


def table_of(rows: list[dict[str, object]]) -> pa.Table:
    """Rows of equal columns as a table."""
    table: pa.Table = pa.Table.from_pylist(rows)
    return table


def encode(table: pa.Table, form: str) -> bytes:
    """The bytes of a table in the form 'json' (a list of objects), 'csv' or 'parquet'."""
    if form == "json":
        rows = [{name: _plain(value) for name, value in row.items()} for row in table.to_pylist()]
        return (json.dumps(rows, indent=2, default=str, allow_nan=False) + "\n").encode()
    sink = io.BytesIO()
    if form == "csv":
        pyarrow.csv.write_csv(_flattened(table), sink)
    else:
        pq.write_table(table, sink, compression="zstd")
    return sink.getvalue()


def _plain(value: object) -> object:
    """A value that JSON can hold: infinities and NaN become null."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, list):
        return [_plain(item) for item in value]
    if isinstance(value, dict):
        return {name: _plain(item) for name, item in value.items()}
    return value


def _flattened(table: pa.Table) -> pa.Table:
    """CSV has no lists or structs: they become JSON text."""
    columns = {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        nested = pa.types.is_nested(column.type)
        texts = (
            [None if v is None else json.dumps(_plain(v), default=str) for v in column.to_pylist()] if nested else None
        )
        columns[name] = pa.array(texts, pa.string()) if nested else column
    return pa.table(columns)
