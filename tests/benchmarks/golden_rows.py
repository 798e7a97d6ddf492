"""Rows of a store in one canonical form, so that two versions of the program can be compared byte for byte."""

from collections.abc import Iterator
from typing import Any

import pyarrow as pa

RENAMED_TABLES: dict[str, str] = {"symptoms": "fault_features"}
RENAMED_COLUMNS: dict[str, str] = {
    "in_step": "row_aligned",
    "late_i": "lagged_i",
    "late_k": "lagged_k",
    "unlike_px": "inconsistent_px",
    "turned_only": "rotated_only",
    "unturned_only": "unrotated_only",
    "specks_near": "isolated_near",
    "specks_beyond": "isolated_beyond",
    "turned": "rotated",
    "against": "inconsistent",
    "margin": "gap",
}
RENAMED_FIELDS: dict[str, str] = {"witness": "check_name", "margin": "score"}
RENAMED_WORDS: dict[str, str] = {
    "contradicted": "lidar_conflict",
    "unlike": "photometric_inconsistency",
    "light": "brightness_difference",
    "empty": "point_dropout",
    "scattered": "isolated_points",
}
"""Old name -> new name, for rows kept before stored tables, columns, fields of structs and words changed.

A word is a whole value of a VARCHAR column or field.
"""


def canonical(table: pa.Table) -> bytes:
    """An Arrow file of the same rows in today's names: without ids and metadata, columns by name, rows sorted."""
    rows = sorted(
        (renamed(row, RENAMED_COLUMNS) for row in table.to_pylist()), key=lambda row: (row["frame"], repr(row))
    )
    schema, sink = pa.schema(_fields(table.schema, RENAMED_COLUMNS)), pa.BufferOutputStream()
    with pa.ipc.new_file(sink, schema, options=pa.ipc.IpcWriteOptions(compression="zstd")) as writer:
        writer.write_table(pa.Table.from_pylist(rows, schema))
    return sink.getvalue().to_pybytes()


def renamed(value: Any, names: dict[str, str]) -> Any:
    """A value, or a whole row, in today's names and without ids; `names` are those of its columns or fields."""
    if isinstance(value, dict):
        named = {names.get(name, name): renamed(part, RENAMED_FIELDS) for name, part in value.items()}
        return {name: named[name] for name in sorted(named) if not name.endswith("_id")}
    if isinstance(value, list):
        return [renamed(part, RENAMED_FIELDS) for part in value]
    return RENAMED_WORDS.get(value, value) if isinstance(value, str) else value


def differences(old: pa.Table, new: pa.Table) -> Iterator[str]:
    """What differs between two tables of canonical form, one sentence a column."""
    if len(old) != len(new):
        yield f"{len(old)} rows in the golden store, {len(new)} now"
        return
    for name in sorted({*old.column_names, *new.column_names}):
        if name not in old.column_names or name not in new.column_names:
            yield f"column {name} is only {'there now' if name in new.column_names else 'in the golden store'}"
            continue
        pairs = zip(old[name].to_pylist(), new[name].to_pylist(), strict=True)
        count = sum(repr(before) != repr(after) for before, after in pairs)  # 0.0 and -0.0 are not the same
        if count:
            yield f"column {name} differs in {count} of {len(old)} rows"
        elif old[name].type != new[name].type:
            yield f"column {name} is {new[name].type}, no longer {old[name].type}"


def _fields(fields: Any, names: dict[str, str]) -> list[pa.Field]:
    """Fields in today's names, by name and without ids."""
    named = [pa.field(names.get(field.name, field.name), _type(field.type)) for field in fields]
    return sorted((field for field in named if not field.name.endswith("_id")), key=lambda field: str(field.name))


def _type(kind: pa.DataType) -> pa.DataType:
    if pa.types.is_list(kind):
        return pa.list_(_type(kind.value_type))
    return pa.struct(_fields(kind, RENAMED_FIELDS)) if pa.types.is_struct(kind) else kind
