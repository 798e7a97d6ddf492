"""Foxglove's messages as protobuf, by the layouts that reading knows, and the descriptors that viewers need."""

import struct
from collections.abc import Mapping
from typing import Any

from auditor.recordings.decoding.foxglove_layouts import DESCRIPTORS, LAYOUTS, TIMESTAMP, Field, Kind

_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5
_OPTIONAL, _REPEATED = 1, 3
_ENUM = "foxglove.PackedElementField.NumericType"
_NUMERIC_TYPES = ("UNKNOWN", "UINT8", "INT8", "UINT16", "INT16", "UINT32", "INT32", "FLOAT32", "FLOAT64")
FLOAT32 = _NUMERIC_TYPES.index("FLOAT32")
"""As `type` of a foxglove.PackedElementField."""

_WRITTEN = {
    **DESCRIPTORS,
    "FileDescriptorProto": {
        1: Field("name", Kind.STRING),
        **DESCRIPTORS["FileDescriptorProto"],
        3: Field("dependency", Kind.STRING, repeated=True),
        12: Field("syntax", Kind.STRING),
    },
    "DescriptorProto": {
        **DESCRIPTORS["DescriptorProto"],
        4: Field("enum_type", Kind.MESSAGE, "EnumDescriptorProto", repeated=True),
    },
    "EnumDescriptorProto": {
        1: Field("name", Kind.STRING),
        2: Field("value", Kind.MESSAGE, "EnumValueDescriptorProto", repeated=True),
    },
    "EnumValueDescriptorProto": {1: Field("name", Kind.STRING), 2: Field("number", Kind.INT32)},
}
"""What a descriptor needs beyond what is compared when one is read."""


def protobuf(name: str, values: Mapping[str, Any], layouts: Mapping[str, Mapping[int, Field]] = LAYOUTS) -> bytes:
    """A message of a known layout; `values` are as `decode_protobuf` gives them, and what they lack is left out."""
    written = bytearray()
    for number, field in layouts[name].items():
        value = values.get(field.name)
        for one in value or () if field.repeated else () if value is None else (value,):
            written += _field(number, field, one, layouts)
    return bytes(written)


def descriptors(name: str) -> bytes:
    """The FileDescriptorSet of a message and of those inside it, as MCAP keeps it beside the messages."""
    wanted = [TIMESTAMP, *sorted(_inside(name) - {TIMESTAMP})]
    packages = {
        package: [one for one in wanted if one.startswith(package)] for package in ("google.protobuf", "foxglove")
    }
    files = [_file(package, names) for package, names in packages.items()]
    files[1]["dependency"] = [files[0]["name"]]
    return protobuf("FileDescriptorSet", {"file": files}, _WRITTEN)


def _field(number: int, field: Field, value: Any, layouts: Mapping[str, Mapping[int, Field]]) -> bytes:  # noqa: ANN401
    match field.kind:
        case Kind.DOUBLE:
            return _varint(number << 3 | _FIXED64) + struct.pack("<d", value)
        case Kind.FIXED32:
            return _varint(number << 3 | _FIXED32) + struct.pack("<I", value)
        case Kind.INT64 | Kind.INT32 | Kind.ENUM:
            return _varint(number << 3 | _VARINT) + _varint(value % 2**64)
        case Kind.MESSAGE:
            data = protobuf(field.message, value, layouts)
        case _:
            data = value.encode() if isinstance(value, str) else bytes(value)
    return _varint(number << 3 | _BYTES) + _varint(len(data)) + data


def _varint(value: int) -> bytes:
    written = bytearray()
    while value > 0x7F:
        written.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*written, value])


def _inside(name: str) -> set[str]:
    """A message and all that its fields hold."""
    parts = [field.message for field in LAYOUTS[name].values() if field.kind is Kind.MESSAGE]
    return {name}.union(*map(_inside, parts))


def _file(package: str, names: list[str]) -> dict[str, Any]:
    described = [_described(name) for name in names]
    return {
        "name": f"{package.replace('.', '/')}.proto",
        "package": package,
        "message_type": described,
        "syntax": "proto3",
    }


def _described(name: str) -> dict[str, Any]:
    fields = [
        {
            "name": field.name,
            "number": number,
            "label": _REPEATED if field.repeated else _OPTIONAL,
            "type": field.kind,
            "type_name": f".{field.message or _ENUM}" if field.kind in (Kind.MESSAGE, Kind.ENUM) else None,
        }
        for number, field in LAYOUTS[name].items()
    ]
    values = [{"name": one, "number": number} for number, one in enumerate(_NUMERIC_TYPES)]
    enums = [{"name": _ENUM.rpartition(".")[2], "value": values}] if _ENUM.startswith(f"{name}.") else []
    return {"name": name.rpartition(".")[2], "field": fields, "enum_type": enums}
