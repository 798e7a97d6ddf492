"""Numbers as pages show them."""

import math
from collections.abc import Callable, Mapping
from decimal import Decimal
from typing import Any

from markupsafe import Markup

THIN_SPACE = "\u2009"
NO_BREAK_SPACE = "\u00a0"


def thousands(number: int) -> str:
    """Digits in groups of three."""
    return f"{number:,}".replace(",", THIN_SPACE)


def count(number: int, what: str) -> str:
    """A number of things, in words."""
    return f"{thousands(number)}{NO_BREAK_SPACE}{what}{'' if number == 1 else 's'}"


def percent(share: float) -> str:
    """Per cent to one decimal, cut and not rounded: 100 % is shown for the whole only."""
    return f"{math.floor(share * 1000 + 1e-9) / 10:.1f}{NO_BREAK_SPACE}%"


def rate(r: Decimal) -> str:
    """A designated rate in per cent, with all its digits."""
    return f"{(r * 100).normalize():f}{NO_BREAK_SPACE}%"


def duration(seconds: float) -> str:
    """A length of time in its largest two units."""
    if seconds < 60:
        return f"{seconds:.1f}{NO_BREAK_SPACE}s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes}{NO_BREAK_SPACE}min {rest:02d}{NO_BREAK_SPACE}s"
    return f"{minutes // 60}{NO_BREAK_SPACE}h {minutes % 60:02d}{NO_BREAK_SPACE}min"


def first_upper(text: str | Markup) -> str | Markup:
    """The same, with a capital letter at its beginning."""
    return text[:1].upper() + text[1:]


FILTERS: Mapping[str, Callable[..., Any]] = {
    one.__name__: one for one in (count, duration, first_upper, percent, rate, thousands)
}
"""The filters of the templates of incidents and of the fleet."""
