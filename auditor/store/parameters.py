"""Parameters of queries: text from the command line, or Python values, become values to bind."""

import math
from collections.abc import Callable, Mapping
from decimal import Decimal, InvalidOperation

from auditor.errors import QueryError
from auditor.results import Statistic
from auditor.store.sql_files import Parameter, SqlFile

Value = str | int | float | bool | Decimal | list[str] | None


def bind(query: SqlFile, given: Mapping[str, object]) -> dict[str, Value]:
    """The value of each parameter of a query.

    Raises QueryError that names a parameter that is missing, unknown or of another type.
    """
    known = {parameter.name: parameter for parameter in query.parameters}
    for name in given:
        if name not in known:
            raise QueryError(
                f"it has no parameter {name!r}",
                where=f"query {query.name}",
                remedy=f"its parameters are {', '.join(known)}" if known else "it has none",
            )
    return {name: _value(query, parameter, given) for name, parameter in known.items()}


def _value(query: SqlFile, parameter: Parameter, given: Mapping[str, object]) -> Value:
    if parameter.name not in given and parameter.required:
        raise QueryError(
            f"parameter {parameter.name} is missing",
            where=f"query {query.name}",
            remedy=f"write {parameter.name}={_EXAMPLES.get(parameter.type, '...')}: {parameter.sentence}",
        )
    value = given.get(parameter.name, parameter.default)
    if value is None:
        return None
    try:
        return _CONVERSIONS[parameter.type](value)
    except (ValueError, TypeError, InvalidOperation):
        raise QueryError(
            f"parameter {parameter.name} is {value!r}, not {_MEANING[parameter.type]}",
            where=f"query {query.name}",
            remedy=parameter.sentence,
        ) from None


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise TypeError
    return value


def _integer(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, str | int):
        raise TypeError
    return int(value)


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, str | int | float | Decimal):
        raise TypeError
    number = float(value)
    if not math.isfinite(number):
        raise ValueError
    return number


def _rates(value: object) -> list[str]:
    """Designated false-alarm rates, exact: they travel as text and become DECIMAL in SQL."""
    parts = value.split(",") if isinstance(value, str) else value if isinstance(value, list | tuple) else [value]
    return [_rate(part) for part in parts]


def _rate(value: object) -> str:
    if isinstance(value, bool) or not isinstance(value, str | int | float | Decimal):
        raise TypeError
    rate = Decimal(str(value).strip())
    if not 0 <= rate <= 1 or rate != round(rate, 17):
        raise ValueError
    return format(rate, "f")


_CONVERSIONS: Mapping[str, Callable[[object], Value]] = {
    "VARCHAR": _text,
    "BIGINT": _integer,
    "DOUBLE": _number,
    "STATISTIC": lambda value: Statistic(_text(value)).value,
    "RATE": _rate,
    "RATE[]": _rates,
}
_EXAMPLES = {"BIGINT": "12", "DOUBLE": "0.5", "RATE": "0.01"}
_MEANING = {
    "VARCHAR": "a text",
    "BIGINT": "a whole number",
    "DOUBLE": "a number",
    "STATISTIC": "plain or gated",
    "RATE": "a number between 0 and 1",
    "RATE[]": "a list of numbers between 0 and 1",
}
