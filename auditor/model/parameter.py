"""Numbers that decide a count or a verdict: each has a name, a value, a unit and a source.

Numbers of one subject are the fields of one frozen dataclass, and its only instance is the group that code reads:

    @dataclass(frozen=True)
    class DisparityError:
        absolute_px: float = parameter(3.0, unit="px", source="paper, Eq. 2")

    DISPARITY_ERROR = DisparityError()
"""

import dataclasses
import hashlib
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal
from functools import cache
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Number = int | float | Decimal
Value = TypeVar("Value", bound=Number | tuple[Number, ...])

BY_HAND = "chosen by hand; no experiment recorded"
"""The source of a number of which nothing else is known."""

_DIGEST_LENGTH = 12


@dataclass(frozen=True)
class Parameter:
    """One number, or a few that belong together, of a group."""

    group: str
    name: str
    value: Number | tuple[Number, ...]
    unit: str
    source: str


def parameter(value: Value, *, unit: str, source: str) -> Value:
    """A field of a group. `source` says who gives the value or which experiment chose it.

    Raises ValueError where unit or source is empty.
    """
    if not unit or not source:
        raise ValueError(f"a parameter of value {value} has no unit or no source")
    made: Value = dataclasses.field(default=value, metadata={"unit": unit, "source": source})
    return made


def list_parameters(*groups: "DataclassInstance") -> tuple[Parameter, ...]:
    """All parameters of some groups, in the order of the groups and of their fields."""
    return tuple(found for group in groups for found in _parameters(group))


def canonical_json(*groups: "DataclassInstance") -> str:
    """All values as JSON with sorted keys and no spaces: what is equal here measures or judges alike."""
    return _canonical_json(groups)


@cache
def _canonical_json(groups: tuple["DataclassInstance", ...]) -> str:
    values = {f"{one.group}.{one.name}": one.value for one in list_parameters(*groups)}
    return json.dumps(values, sort_keys=True, separators=(",", ":"), default=str)


def digest(*groups: "DataclassInstance") -> str:
    """The beginning of the SHA-256 of `canonical_json`, 12 hexadecimal digits."""
    return hashlib.sha256(canonical_json(*groups).encode()).hexdigest()[:_DIGEST_LENGTH]


def _parameters(group: "DataclassInstance") -> Iterator[Parameter]:
    name = re.sub(r"(?<!^)(?=[A-Z])", "_", type(group).__name__).lower()
    for field in dataclasses.fields(group):
        # Every field is made by `parameter`: one without a unit or a source raises KeyError.
        yield Parameter(name, field.name, getattr(group, field.name), field.metadata["unit"], field.metadata["source"])
