"""Rows leave the store: as Python values, JSON, CSV or Parquet.

A moment leaves as text in the form of ISO 8601 with every digit that its column holds: a nanosecond has no Python type.
"""

import io
import json
import math
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import pyarrow.parquet as pq

from auditor.errors import QueryError

Table = pa.Table
"""The form of every answer: an Arrow table."""


def table_of(rows: list[dict[str, object]]) -> pa.Table:
    """Rows of equal columns as a table."""
    table: pa.Table = pa.Table.from_pylist(rows)
    return table


def rows_of(table: pa.Table) -> list[dict[str, Any]]:
    """The rows of an answer, by column; dates, times and timestamps are text, also inside lists and structs.

    Timestamps are UTC and say so: 2011-09-26T13:02:25.964389445Z.
    """
    columns = [_values(column) for column in table.columns]
    return [dict(zip(table.column_names, row, strict=True)) for row in zip(*columns, strict=True)]


def encode(table: pa.Table, form: str) -> bytes:
    """The bytes of a table in the form 'json' (a list of objects), 'csv' or 'parquet'.

    Parquet keeps the types of the columns; JSON and CSV hold the values of `rows_of`. Raises QueryError where the form
    has no such type.
    """
    try:
        return _encoded(table, form)
    except pa.ArrowException as error:
        reason = " ".join(str(error).split())
        remedy = "cast the column in SQL, or take another --format"
        raise QueryError(f"the answer cannot be written as {form} ({reason})", where="query", remedy=remedy) from error


def _encoded(table: pa.Table, form: str) -> bytes:
    if form == "json":
        rows = [{name: _plain(value) for name, value in row.items()} for row in rows_of(table)]
        return (json.dumps(rows, indent=2, default=str, allow_nan=False) + "\n").encode()
    sink = io.BytesIO()
    if form == "csv":
        pyarrow.csv.write_csv(_flattened(table), sink)
    else:
        pq.write_table(table, sink, compression="zstd")
    return sink.getvalue()


def _values(column: pa.ChunkedArray) -> list[Any]:
    """The values of a column; only those that hold times somewhere inside are walked one by one."""
    if pa.types.is_nested(column.type) and _holds_times(column.type):
        return [_value(scalar) for scalar in column]
    values: list[Any] = (_times_as_text(column) if _is_time(column.type) else column).to_pylist()
    return values


def _value(scalar: pa.Scalar) -> object:
    """One value as Python has it, its times as text."""
    kind = scalar.type
    if not scalar.is_valid or not _holds_times(kind):
        return scalar.as_py()
    if pa.types.is_struct(kind):
        return {name: _value(part) for name, part in scalar.items()}
    if pa.types.is_union(kind):
        return _value(scalar.value)
    return _times_as_text(pa.array([scalar], kind))[0].as_py() if _is_time(kind) else [*map(_value, scalar.values)]


def _times_as_text(times: pa.Array | pa.ChunkedArray) -> pa.Array | pa.ChunkedArray:
    """Times in the form of ISO 8601; a timestamp without a zone is UTC, as all of the store's are."""
    if not pa.types.is_timestamp(times.type):
        return times.cast(pa.string())
    return pc.strftime(times.cast(pa.timestamp(times.type.unit)), format="%Y-%m-%dT%H:%M:%SZ")


def _is_time(kind: pa.DataType) -> bool:
    return any(is_one(kind) for is_one in (pa.types.is_timestamp, pa.types.is_time, pa.types.is_date))


def _holds_times(kind: pa.DataType) -> bool:
    return _is_time(kind) or any(_holds_times(kind.field(part).type) for part in range(kind.num_fields))


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
        if pa.types.is_nested(column.type):
            texts = [None if v is None else json.dumps(_plain(v), default=str) for v in _values(column)]
            columns[name] = pa.array(texts, pa.string())
        else:
            columns[name] = _times_as_text(column) if _is_time(column.type) else column
    return pa.table(columns)
