"""SQL type names, as the schema files write them, become Arrow types."""

import re
from collections.abc import Iterator

import pyarrow as pa

from auditor.errors import StoreError

_SIMPLE = {
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
_NESTED = re.compile(r"(STRUCT|MAP|DECIMAL)\((.*)\)")


def arrow_type(text: str) -> pa.DataType:
    """The Arrow type of a SQL type such as `DOUBLE[]` or `STRUCT(i TINYINT, s VARCHAR)[]`.

    Raises StoreError for a type that schema files do not use.
    """
    text = text.strip()
    if text.endswith("[]"):
        return pa.list_(arrow_type(text[:-2]))
    if text in _SIMPLE:
        return _SIMPLE[text]
    nested = _NESTED.fullmatch(text)
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
