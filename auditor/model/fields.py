"""The fields of a plain description, as TOML and JSON give it: what is missing or of another kind is named."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from reprlib import repr as short
from typing import Any, TypeVar

import numpy as np

from auditor.errors import RigError
from auditor.model.optics.geometry import Matrix

Kind = TypeVar("Kind")


@dataclass(frozen=True)
class Fields:
    """The fields of one thing, `of` which people are told.

    Every method raises RigError that names the field, what it should be, and what it is.
    """

    of: str
    values: Mapping[str, Any]

    def text(self, key: str) -> str:
        """A text, required."""
        return self._get(key, "a text", lambda value: value if isinstance(value, str) else None)

    def flag(self, key: str) -> bool:
        """True or false, required."""
        return self._get(key, "true or false", lambda value: value if isinstance(value, bool) else None)

    def whole(self, key: str) -> int:
        """A whole number, required; 640.0 is one."""
        return self._get(key, "a whole number", _whole)

    def positive(self, key: str) -> float:
        """A finite number above 0, required."""
        return self._get(key, "a number above 0", _positive)

    def numbers(self, key: str) -> tuple[float, ...]:
        """A list of numbers, required."""
        return self._get(key, "a list of finite numbers", _numbers)

    def matrix(self, key: str, rows: int, columns: int) -> Matrix:
        """A matrix of finite numbers by rows, (rows, columns), required."""
        return self._get(key, f"{rows} x {columns} finite numbers", lambda value: _matrix(value, (rows, columns)))

    def table(self, key: str, of: str) -> "Fields":
        """The fields of a thing inside, required."""
        return Fields(of, self._get(key, "a table", lambda value: value if isinstance(value, Mapping) else None))

    def tables(self, key: str, of: str) -> "Iterator[Fields]":
        """The fields of each of several things inside, which are counted from 1; required."""
        listed: list[Any] = self._get(key, "a list of tables", _tables)
        yield from (Fields(f"{of} {number}", value) for number, value in enumerate(listed, start=1))

    def __contains__(self, key: str) -> bool:
        """True where the field is given; null is not."""
        return self.values.get(key) is not None

    def _get(self, key: str, kind: str, read: Callable[[Any], Kind | None]) -> Kind:
        if key not in self:
            raise RigError(f"{self.of} lacks {key}, which should be {kind}", where="rig")
        value = read(self.values[key])
        if value is None:
            raise RigError(f"{key} of {self.of} should be {kind}, but is {short(self.values[key])}", where="rig")
        return value


def _whole(value: object) -> int | None:
    if isinstance(value, bool) or not isinstance(value, int | float) or value % 1 != 0:
        return None
    return int(value)


def _positive(value: object) -> float | None:
    number = None if isinstance(value, bool) or not isinstance(value, int | float) else float(value)
    return number if number is not None and np.isfinite(number) and number > 0 else None


def _numbers(value: object) -> tuple[float, ...] | None:
    vector = _matrix(value, (len(value),)) if isinstance(value, list) else None
    return None if vector is None else tuple(vector.tolist())


def _matrix(value: object, shape: tuple[int, ...]) -> Matrix | None:
    try:
        matrix = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        return None
    return matrix if matrix.shape == shape and np.isfinite(matrix).all() else None


def _tables(value: object) -> list[Any] | None:
    return value if isinstance(value, list) and all(isinstance(entry, Mapping) for entry in value) else None
