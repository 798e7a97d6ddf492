"""Rows leave the store: as Python values, JSON, CSV or Parquet.

A moment leaves as text in the form of ISO 8601 with every digit that its column holds: a nanosecond has no Python type.
So does a length of time that has months or days (P1M2DT3.5S), which no number of seconds can tell. CSV is opened
with spreadsheets: its texts are made safe for them (`csv_cell`).
"""

import io
import json
import math
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from decimal import Decimal
from importlib.abc import MetaPathFinder
from types import ModuleType
from typing import Any

import numpy as np
import pyarrow as pa

from auditor.errors import QueryError
from auditor.model.text import csv_cell
from auditor.resources import plug_ins

_USUAL_YEAR = re.compile(rb"\d{4}-")

Table = pa.Table
"""The form of every answer: an Arrow table."""


class _NoPandas(MetaPathFinder):
    """Finds no pandas."""

    def find_spec(self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None) -> None:
        del path, target
        if fullname == "pandas":
            raise ModuleNotFoundError("pandas is left out", name=fullname)


def leave_pandas_out() -> None:
    """Have Arrow take pandas for missing in this process, unless it is imported already.

    Arrow imports it for the first list that becomes an array, wherever it is installed, in 0.17 s of CPU. For processes
    in which nobody asks Arrow for a data frame. Code of plug-ins may, so where one is installed pandas stays; code that
    imports pandas itself gets it in any case.
    """
    if "pandas" in sys.modules or plug_ins():
        return
    nowhere = _NoPandas()
    sys.meta_path.insert(0, nowhere)
    try:
        pa.array([0])
    finally:
        sys.meta_path.remove(nowhere)


def table_of(rows: list[dict[str, object]], columns: Mapping[str, str] | None = None) -> pa.Table:
    """Rows of equal columns as a table; `columns` has Arrow's names of their types, also where there are no rows."""
    schema = pa.schema([(name, pa.type_for_alias(kind)) for name, kind in columns.items()]) if columns else None
    table: pa.Table = pa.Table.from_pylist(rows, schema)
    return table


def rows_of(table: pa.Table) -> list[dict[str, Any]]:
    """Make rows of an answer.

    Parameters
    ----------
    table
        An answer of `query`.

    Returns
    -------
    list of dict
        One a row, by column. Dates, times and timestamps are text, also inside lists and structs; timestamps are UTC
        and say so: 2011-09-26T13:02:25.964389445Z.
    """
    columns = [_values(column) for column in table.columns]
    return [dict(zip(table.column_names, row, strict=True)) for row in zip(*columns, strict=True)]


def encode(table: pa.Table, form: str) -> bytes:
    """The bytes of a table in the form 'json' (a list of objects), 'csv' or 'parquet'.

    Parquet keeps the types of the columns, but for lengths of time, which it does not have; JSON and CSV hold the
    values of `rows_of`, CSV lists and structs as JSON text. Raises QueryError for a type that the form does not have.
    """
    try:
        return _encoded(table, form)
    except pa.ArrowException as error:
        reason = " ".join(str(error).split())
        remedy = "cast the column in SQL, or take another --format"
        raise QueryError(f"the answer cannot be written as {form} ({reason})", where="query", remedy=remedy) from error


def _encoded(table: pa.Table, form: str) -> bytes:
    if form == "json":
        return as_json(rows_of(table))
    from pyarrow import csv, parquet  # noqa: PLC0415 - heavy

    sink = io.BytesIO()
    if form == "csv":
        csv.write_csv(_for_csv(table), sink)
    else:
        parquet.write_table(_for_parquet(table), sink, compression="zstd")
    return sink.getvalue()


def with_texts(table: pa.Table, change: Callable[[str, str], str]) -> pa.Table:
    """A table with every text in it changed, also inside lists and structs: `change` gets the column, or the field of
    the struct, and the text.
    """

    def changed(name: str, value: object) -> object:
        if isinstance(value, str):
            return change(name, value)
        if isinstance(value, list):
            return [changed(name, item) for item in value]
        if isinstance(value, dict):
            return {key: changed(key, item) for key, item in value.items()}
        return value

    for place, field in enumerate(table.schema):
        if _holds(_is_text, field.type):
            column = pa.array([changed(field.name, value) for value in table[field.name].to_pylist()], field.type)
            table = table.set_column(place, field, column)
    return table


def as_json(value: object) -> bytes:
    """Rows, or what holds several lists of rows, as JSON text; it is ASCII, and what no number is becomes null."""
    return (json.dumps(_plain(value), indent=2, default=str, allow_nan=False) + "\n").encode()


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
    if pa.types.is_interval(times.type):
        return pa.array(
            [None if length is None else _length_as_text(length) for length in times.to_pylist()], pa.string()
        )
    stamps = pa.types.is_timestamp(times.type)
    if stamps or pa.types.is_date32(times.type):
        texts = [*_in_iso(times, times.type.unit if stamps else "D", "Z" if stamps else "")]
        if all(text is None or _USUAL_YEAR.match(text) for text in texts):
            return _texts(texts)
    if not stamps:
        return times.cast(pa.string())
    from pyarrow import compute  # noqa: PLC0415 - heavy

    return compute.strftime(times.cast(pa.timestamp(times.type.unit)), format="%Y-%m-%dT%H:%M:%SZ")


def _in_iso(times: pa.Array | pa.ChunkedArray, unit: str, end: str) -> Iterator[bytes | None]:
    """Times since 1970 as text, by numpy: what Arrow would do it with takes 0.06 CPU s to import."""
    for part in times.chunks if isinstance(times, pa.ChunkedArray) else [times]:
        counts = part.view(pa.int32() if unit == "D" else pa.int64()).to_pylist()
        texts = np.datetime_as_string(np.array([count or 0 for count in counts], f"datetime64[{unit}]"))
        yield from (
            None if count is None else f"{text}{end}".encode() for count, text in zip(counts, texts, strict=True)
        )


def _is_time(kind: pa.DataType) -> bool:
    kinds = (pa.types.is_timestamp, pa.types.is_time, pa.types.is_date, pa.types.is_interval)
    return any(is_one(kind) for is_one in kinds)


def _length_as_text(length: pa.MonthDayNano) -> str:
    """A length of time as an ISO 8601 duration; each of its three parts has a sign of its own."""
    seconds = f"{Decimal(length.nanoseconds).scaleb(-9):f}"
    return f"P{length.months}M{length.days}DT{seconds.rstrip('0').rstrip('.') if '.' in seconds else seconds}S"


def _holds_times(kind: pa.DataType) -> bool:
    return _holds(_is_time, kind)


def _holds(wanted: Callable[[pa.DataType], bool], kind: pa.DataType) -> bool:
    return wanted(kind) or any(_holds(wanted, kind.field(part).type) for part in range(kind.num_fields))


def _plain(value: object) -> object:
    """A value that JSON can hold: infinities and NaN become null, whole numbers of any size (HUGEINT) numbers."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Decimal) and value.as_tuple().exponent == 0:
        return int(value)
    if isinstance(value, list):
        return [_plain(item) for item in value]
    if isinstance(value, dict):
        return {name: _plain(item) for name, item in value.items()}
    return value


def _for_csv(table: pa.Table) -> pa.Table:
    """The columns of a table as CSV can have them: lists and structs as JSON text, bytes in hexadecimal digits."""
    columns = [_csv_column(column) for column in table.columns]
    return pa.table(columns, names=[csv_cell(name) for name in table.column_names])


def _csv_column(column: pa.ChunkedArray) -> pa.Array | pa.ChunkedArray:
    kind = column.type
    if _is_time(kind):
        return _times_as_text(column)
    if pa.types.is_nested(kind):
        return _as_json_texts(column)
    if _is_text(kind):
        return _safe_texts(column)
    return _each(bytes.hex, column) if pa.types.is_binary(kind) or pa.types.is_large_binary(kind) else column


def _for_parquet(table: pa.Table) -> pa.Table:
    """A table without what Parquet does not have: lengths of time become text, and what holds them JSON text."""
    for place, column in enumerate(table.columns):
        if pa.types.is_interval(column.type):
            table = table.set_column(place, table.column_names[place], _times_as_text(column))
        elif _holds(pa.types.is_interval, column.type):
            table = table.set_column(place, table.column_names[place], _as_json_texts(column))
    return table


def _as_json_texts(column: pa.ChunkedArray) -> pa.Array:
    return _each(lambda value: json.dumps(_plain(value), default=str), _values(column))


def _each(change: Callable[[Any], str], values: Iterable[Any]) -> pa.Array:
    """The texts that values become; of none there is none."""
    plain = values.to_pylist() if isinstance(values, pa.ChunkedArray) else values
    return _texts([None if value is None else change(value).encode() for value in plain])


def _texts(encoded: Sequence[bytes | None]) -> pa.Array:
    """Texts in UTF-8 as an array. `pa.array` imports pandas where that is installed, half of the time of a query."""
    ends = np.cumsum([0, *(len(text or b"") for text in encoded)], dtype=np.int64)
    there = np.packbits(np.array([text is not None for text in encoded], dtype=np.bool_), bitorder="little")
    content = b"".join(text or b"" for text in encoded)
    buffers = [pa.py_buffer(there), pa.py_buffer(ends), pa.py_buffer(content)]
    return pa.Array.from_buffers(pa.large_string(), len(encoded), buffers)


def _safe_texts(column: pa.ChunkedArray) -> pa.Array | pa.ChunkedArray:
    """Texts as CSV can have them; most are already, and stand in many rows."""
    safe = {text: csv_cell(text) for text in column.unique().to_pylist() if text is not None}
    if all(text == changed for text, changed in safe.items()):
        return column.cast(pa.string())
    return _each(safe.__getitem__, column)


def _is_text(kind: pa.DataType) -> bool:
    if pa.types.is_dictionary(kind):
        return _is_text(kind.value_type)
    kinds = (pa.types.is_string, pa.types.is_large_string, pa.types.is_string_view)
    return any(is_one(kind) for is_one in kinds)
