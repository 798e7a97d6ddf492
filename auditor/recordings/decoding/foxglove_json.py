"""Foxglove messages in JSON: checked against the known layouts, within bounds."""

import json
from binascii import Error as Base64Error
from binascii import a2b_base64
from collections.abc import Collection
from typing import Any

from auditor.errors import DecodingError
from auditor.recordings.decoding.foxglove_layouts import LAYOUTS, TIMESTAMP, Field, Kind

MAX_BYTES = 48 * 2**20
MAX_PARTS = 100_000
"""A parsed list or object takes 20 times its text: they are counted first. Pixels and points are one string of text."""

_TIMES = {"seconds": "sec", "nanos": "nsec"}
_NUMBERS = {Kind.INT64, Kind.INT32, Kind.FIXED32, Kind.ENUM}


def decode_json(name: str, data: bytes, without: Collection[str] = ()) -> dict[str, Any]:
    """The fields of a message by name, as `decode_protobuf` gives them, but for some left out. Raises DecodingError."""
    if len(data) > MAX_BYTES or sum(data.count(mark) for mark in (b",", b"[", b"{")) > MAX_PARTS:
        raise DecodingError("the JSON message is too large or has too many parts")
    if not data.isascii() and len(data) > 2**20:
        # One character beyond ASCII makes the whole text take up to four times its bytes.
        raise DecodingError("the JSON message is large and not plain ASCII")
    try:
        parsed = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise DecodingError("the message is no JSON") from error
    return _message(name, parsed, without)


def _message(name: str, parsed: object, without: Collection[str] = ()) -> dict[str, Any]:
    if not isinstance(parsed, dict):
        raise DecodingError(f"the message holds no {name}")
    values: dict[str, Any] = {}
    for field in LAYOUTS[name].values():
        if field.name in without:
            continue
        found = parsed.get(_TIMES[field.name] if name == TIMESTAMP else field.name)
        if field.repeated:
            if not isinstance(found, list | None):
                raise DecodingError(f"the field {field.name!r} of {name} is no list")
            values[field.name] = [_value(field, part) for part in found or ()]
        else:
            values[field.name] = _value(field, found)
    return values


def _value(field: Field, found: object) -> Any:  # noqa: ANN401  # what the field's kind holds
    if field.kind is Kind.MESSAGE:
        return None if found is None else _message(field.message, found)
    if field.kind in {Kind.STRING, Kind.BYTES}:
        if not isinstance(found, str | None):
            raise DecodingError(f"the field {field.name!r} is no text")
        return found or "" if field.kind is Kind.STRING else _bytes(found or "")
    if not isinstance(found, int | float | None) or (field.kind in _NUMBERS and not isinstance(found, int | None)):
        raise DecodingError(f"the field {field.name!r} is no number")
    try:
        number = float(found or 0) if field.kind is Kind.DOUBLE else int(found or 0)
    except OverflowError as error:
        raise DecodingError(f"the field {field.name!r} is too large") from error
    if field.kind is Kind.FIXED32 and not 0 <= number < 2**32:
        raise DecodingError(f"the field {field.name!r} is out of range")
    return number


def _bytes(text: str) -> memoryview:
    try:
        return memoryview(a2b_base64(text, strict_mode=True))
    except (Base64Error, ValueError) as error:
        raise DecodingError("its data are no base64") from error
