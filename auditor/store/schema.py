"""The tables of a store, as the files in `schemas/` describe them: one file a table."""

import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property

import pyarrow as pa

from auditor.errors import StoreError
from auditor.resources import resource_folder

_SIMPLE_TYPES = {
    "BOOLEAN": pa.bool_(),
    "TINYINT": pa.int8(),
    "SMALLINT": pa.int16(),
    "INTEGER": pa.int32(),
    "BIGINT": pa.int64(),
    "DOUBLE": pa.float64(),
    "VARCHAR": pa.string(),
    "BLOB": pa.binary(),
    "DATE": pa.date32(),
    "TIMESTAMP": pa.timestamp("us"),
}
_NESTED_TYPE = re.compile(r"(STRUCT|MAP|DECIMAL)\((.*)\)")

SCHEMA_VERSION = 13
"""Raised whenever what scans keep changes: a table, a column or a stored word. Evaluations go by EXPERIMENTS_VERSION.

`upgrade` brings stores of the versions UPGRADED_FROM to this one.
"""

TABLES = (
    "recordings",
    "rigs",
    "triples",
    "sensor_checks",
    "measurements",
    "frames",
    "cells",
    "fault_features",
    "regions",
    "poses",
    "calibrations",
    "calibration_versions",
    "calibration_recordings",
    "calibration_conditions",
    "calibration_history",
    "quarantine",
    "judgements",
    "verdicts",
    "labels",
    "given_labels",
    "reviews",
    "inputs",
    "evaluations",
    "cases",
    "case_verdicts",
    "missed_pictures",
    "object_evaluations",
    "object_cases",
)

WRITTEN = ("cells", "fault_features", "regions", "poses", "frames")
"""The tables that a measurement fills, in the order in which they are finished."""

MANIFESTS = {
    **dict.fromkeys(WRITTEN, "measurements"),
    "verdicts": "judgements",
    "cases": "evaluations",
    "object_cases": "object_evaluations",
}
"""The table whose rows say which files of another are finished."""

_VERSION_KEY = b"schema_version"


@dataclass(frozen=True)
class Column:
    """One column: its SQL type, its unit where it has one, and its meaning in one sentence."""

    name: str
    type: str
    sentence: str
    unit: str = ""
    dictionary: bool = False

    @property
    def in_words(self) -> str:
        """Its meaning, with its unit where it has one."""
        return f"{self.sentence} ({self.unit})" if self.unit else self.sentence


@dataclass(frozen=True)
class TableSchema:
    """One table: what a row is, where its files lie, and its columns in order."""

    name: str
    sentence: str
    file: str
    columns: tuple[Column, ...]

    @cached_property
    def arrow(self) -> pa.Schema:
        """The Arrow schema, which carries `schema_version`."""
        fields = [pa.field(column.name, arrow_type(column.type)) for column in self.columns]
        return pa.schema(fields, metadata={_VERSION_KEY: str(SCHEMA_VERSION).encode()})

    @property
    def id_column(self) -> str:
        """The column that has the id of the file."""
        return self.file.partition("<")[2].partition(">")[0]

    @cached_property
    def dictionary_columns(self) -> list[str]:
        """Parquet paths of the columns that repeat few values: ids and words."""
        return [_leaf(column) for column in self.columns if column.dictionary]

    @property
    def holds_grids(self) -> bool:
        """True where a single row may be large."""
        return any(column.type == "BLOB" for column in self.columns)

    @cached_property
    def encodings(self) -> dict[str, str]:
        """Parquet encodings by path: floats are split by byte, stamps stored as differences."""
        by_type = {pa.float64(): "BYTE_STREAM_SPLIT", pa.int64(): "DELTA_BINARY_PACKED"}
        chosen = {}
        for column in self.columns:
            value = arrow_type(column.type.removesuffix("[]"))
            if value in by_type and (value == pa.float64() or column.unit == "ns"):
                chosen[_leaf(column)] = by_type[value]
        return chosen


@cache
def table_schema(name: str) -> TableSchema:
    """Read the schema file of one of TABLES."""
    description = tomllib.loads((resource_folder("schemas") / f"{name}.toml").read_text(encoding="utf-8"))
    columns = tuple(Column(name=column, **fields) for column, fields in description["columns"].items())
    return TableSchema(name, description["sentence"], description["file"], columns)


def id_column(table: str) -> str:
    """The column of a table that has the id of the file."""
    return table_schema(table).id_column


def version_of(schema: pa.Schema) -> int | None:
    """The `schema_version` that a file was written with; None where it carries none."""
    text = (schema.metadata or {}).get(_VERSION_KEY, b"")
    return int(text) if text.isdigit() else None


def newer_version(version: int, where: object) -> StoreError:
    """The error for a file or store that a newer auditor has written."""
    return StoreError(
        f"it has schema version {version}, and this auditor knows {SCHEMA_VERSION}",
        where=where,
        remedy="use the auditor that wrote it, or a newer one",
    )


def _leaf(column: Column) -> str:
    return f"{column.name}.list.element" if column.type.endswith("[]") else column.name


def arrow_type(text: str) -> pa.DataType:
    """The Arrow type of a SQL type such as `DOUBLE[]` or `STRUCT(i TINYINT, s VARCHAR)[]`.

    Raises StoreError for a type that schema files do not use.
    """
    text = text.strip()
    if text.endswith("[]"):
        return pa.list_(arrow_type(text[:-2]))
    if text in _SIMPLE_TYPES:
        return _SIMPLE_TYPES[text]
    nested = _NESTED_TYPE.fullmatch(text)
    if nested is None:
        raise StoreError(f"{text!r} is no type of a column", where="schema")
    parts = list(_parts(nested[2]))
    if nested[1] == "DECIMAL":
        return pa.decimal128(int(parts[0]), int(parts[1]))
    if nested[1] == "MAP":
        return pa.map_(arrow_type(parts[0]), arrow_type(parts[1]))
    return pa.struct([(name, arrow_type(kind)) for name, kind in (part.split(maxsplit=1) for part in parts)])


def _parts(text: str) -> Iterator[str]:
    """Split at the commas that stand outside all brackets."""
    start = depth = 0
    for position, character in enumerate(text):
        depth += {"(": 1, ")": -1}.get(character, 0)
        if character == "," and depth == 0:
            yield text[start:position].strip()
            start = position + 1
    yield text[start:].strip()
