"""Definitions in ROS 2's IDL, as rosbag2 writes them where a package has only that: from rosbags' own type table."""

from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

_RULER = "=" * 80
_NAMES = {
    "bool": "boolean",
    "byte": "octet",
    "int8": "int8",
    "uint8": "uint8",
    "int16": "int16",
    "uint16": "uint16",
    "int32": "int32",
    "uint32": "uint32",
    "int64": "int64",
    "uint64": "uint64",
    "float32": "float",
    "float64": "double",
    "string": "string",
}


def idl_definition(schema: str, store: Typestore) -> str:
    """The IDL of a schema and of all it is made of."""
    found: dict[str, str] = {}
    _collect(schema, store, found)
    return "\n".join(f"{_RULER}\nIDL: {name}\n{text}" for name, text in found.items())


def _collect(schema: str, store: Typestore, found: dict[str, str]) -> None:
    if schema in found:
        return
    found[schema] = ""
    package, _, name = schema.split("/")
    lines, before = [], []
    for place, (field, kind) in enumerate(store.fielddefs[schema][1]):
        spelt, dimension = _type(kind, store, found)
        if dimension:
            before.append(f"typedef {spelt} {name}__{field}_{place}[{dimension}];")
            spelt = f"{name}__{field}_{place}"
        lines.append(f"{spelt} {field};")
    members = "\n        ".join(lines)
    typedefs = "\n      ".join(before)
    found[schema] = (
        f"module {package} {{\n  module msg {{\n      {typedefs}\n    struct {name} {{\n        {members}\n    }};\n"
        "  };\n};\n"
    )


def _type(kind: Any, store: Typestore, found: dict[str, str]) -> tuple[str, int]:
    node, value = kind
    if node == Nodetype.BASE:
        return _NAMES[value[0]], 0
    if node == Nodetype.NAME:
        _collect(value, store, found)
        return value.replace("/", "::"), 0
    inner, _ = _type(value[0], store, found)
    return (f"sequence<{inner}>", 0) if node == Nodetype.SEQUENCE else (inner, value[1])
