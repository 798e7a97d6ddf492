"""Protobuf messages of known layouts, read without running or building anything from a recording.

Format: protobuf's wire encoding. The values of `bytes` fields are views of the message; nothing is allocated by a size
that the message declares, only by the bytes that are there.

The package `protobuf` would decode any message, from classes that it builds of the descriptors in the recording. It is
not used because nothing of a recording is to be built or run, and because a message of a million empty parts becomes as
many objects before they can be counted. The layouts that matter are few and known beforehand.
"""

import struct
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from auditor.errors import DecodingError
from auditor.recordings.decoding.foxglove_layouts import DESCRIPTORS, LAYOUTS, Field, FieldType

MAX_FIELDS = 100_000
"""More values than any supported message has: the bound on the work that a hostile message causes."""

MAX_SCHEMA_BYTES = 2**20

_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5
_REPEATED = 3
_DOUBLE = struct.Struct("<d")
_UINT32 = struct.Struct("<I")

_WIRE_TYPES = {
    FieldType.DOUBLE: _FIXED64,
    FieldType.FIXED32: _FIXED32,
    FieldType.INT64: _VARINT,
    FieldType.INT32: _VARINT,
    FieldType.ENUM: _VARINT,
    FieldType.STRING: _BYTES,
    FieldType.BYTES: _BYTES,
    FieldType.MESSAGE: _BYTES,
}

_ENUM_NAMES = {True: ("foxglove.PackedElementField.NumericType",), False: ()}


def decode_protobuf(
    name: str, data: memoryview, layouts: Mapping[str, Mapping[int, Field]] = LAYOUTS
) -> dict[str, Any]:
    """The fields of a message by name: numbers, str, memoryview, dicts of messages (None: absent), lists.

    Fields that the layout does not have are skipped. Raises DecodingError.
    """
    return _Reading(layouts).message(name, data)


class _Reading:
    """One message and those inside it, with the count of their fields."""

    def __init__(self, layouts: Mapping[str, Mapping[int, Field]]) -> None:
        self._layouts = layouts
        self._left = MAX_FIELDS

    def message(self, name: str, data: memoryview) -> dict[str, Any]:
        layout = self._layouts[name]
        values: dict[str, Any] = {field.name: _absent(field) for field in layout.values()}
        for number, wire_type, value in self._fields(data):
            field = layout.get(number)
            if field is None:
                continue
            if field.repeated and field.kind is FieldType.DOUBLE and wire_type == _BYTES:
                values[field.name].extend(_doubles(value))
                continue
            if wire_type != _WIRE_TYPES[field.kind]:
                raise DecodingError(f"the field {field.name!r} of {name} has another type")
            read = self._value(field, value)
            if field.repeated:
                values[field.name].append(read)
            else:
                values[field.name] = read
        return values

    def _value(self, field: Field, value: Any) -> Any:  # noqa: ANN401  # what the wire type holds
        if field.kind is FieldType.MESSAGE:
            return self.message(field.message, value)
        if field.kind is FieldType.STRING:
            return str(value, "utf-8", "replace")
        if field.kind is FieldType.DOUBLE:
            return _DOUBLE.unpack(value)[0]
        if field.kind is FieldType.FIXED32:
            return _UINT32.unpack(value)[0]
        if field.kind is FieldType.BYTES:
            return value
        return value - 2**64 if value >= 2**63 else value

    def _fields(self, data: memoryview) -> Iterator[tuple[int, int, Any]]:
        position = 0
        while position < len(data):
            self._left -= 1
            if self._left < 0:
                raise DecodingError(f"the message has more than {MAX_FIELDS} fields")
            key, position = _varint(data, position)
            wire_type = key & 7
            if wire_type == _VARINT:
                value, position = _varint(data, position)
                yield key >> 3, wire_type, value
                continue
            if wire_type == _BYTES:
                length, position = _varint(data, position)
            elif wire_type in {_FIXED32, _FIXED64}:
                length = 4 if wire_type == _FIXED32 else 8
            else:
                raise DecodingError("the message is not protobuf")
            end = position + length
            if end > len(data):
                raise DecodingError("the message is cut")
            yield key >> 3, wire_type, data[position:end]
            position = end


def _absent(field: Field) -> Any:  # noqa: ANN401  # protobuf's defaults
    if field.repeated:
        return []
    if field.kind is FieldType.MESSAGE:
        return None
    return {FieldType.STRING: "", FieldType.BYTES: memoryview(b""), FieldType.DOUBLE: 0.0}.get(field.kind, 0)


def _doubles(packed: memoryview) -> list[float]:
    if len(packed) % 8 or len(packed) > 8 * MAX_FIELDS:
        raise DecodingError("the message holds numbers that are cut, or too many of them")
    values: list[float] = np.frombuffer(packed, "<f8").tolist()
    return values


def _varint(data: memoryview, position: int) -> tuple[int, int]:
    value = 0
    for shift in range(0, 70, 7):
        if position >= len(data):
            raise DecodingError("the message is cut")
        byte = data[position]
        position += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value & (2**64 - 1), position
    raise DecodingError("the message is not protobuf")


def check_schema(name: str, schema: bytes) -> None:
    """Raises DecodingError where an embedded FileDescriptorSet defines a known message differently."""
    if len(schema) > MAX_SCHEMA_BYTES:
        raise DecodingError(f"its schema of {len(schema)} bytes is not accepted", where=name)
    for file in decode_protobuf("FileDescriptorSet", memoryview(schema), DESCRIPTORS)["file"]:
        for message in file["message_type"]:
            full_name = f"{file['package']}.{message['name']}"
            layout = LAYOUTS.get(full_name, {})
            known_names = {field.name: number for number, field in layout.items()}
            for definition in message["field"]:
                number = known_names.get(definition["name"], definition["number"])
                if number in layout and not _agrees(definition, number, layout[number]):
                    raise DecodingError(
                        f"{full_name}.{definition['name']} is defined otherwise than by foxglove", where=name
                    )


def _agrees(definition: Mapping[str, Any], number: int, field: Field) -> bool:
    return (definition["name"], definition["number"], definition["type"], definition["label"] == _REPEATED) == (
        field.name,
        number,
        field.kind,
        field.repeated,
    ) and definition["type_name"].lstrip(".") in {field.message, *_ENUM_NAMES[field.kind is FieldType.ENUM]}
