"""The templates in `reports/`, filled: every page escapes all text, and fails where a value is missing."""

import math
import re
from collections.abc import Callable, Mapping
from decimal import Decimal
from types import CodeType
from typing import Any

import jinja2
from markupsafe import Markup, escape

from auditor.model.checks.words import label_of
from auditor.model.text import one_line
from auditor.resources import resource_folder

THIN_SPACE = "\u2009"
NO_BREAK_SPACE = "\u00a0"


def thousands(number: int) -> str:
    """Digits in groups of three."""
    return f"{number:,}".replace(",", THIN_SPACE)


def count(number: int, noun: str) -> str:
    """A number of things, in words."""
    return f"{thousands(number)}{NO_BREAK_SPACE}{noun}{'' if number == 1 else 's'}"


def counted(incidents: int, alerts: int) -> str:
    """How many incidents and alerts there are; of none, nothing."""
    return " and ".join(count(number, what) for number, what in ((incidents, "incident"), (alerts, "alert")) if number)


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


def with_indices(text: str) -> Markup:
    """Text with sensors as S_1, whose numbers are set as indices."""
    parts = re.split(r"\bS_(\d+)", text)
    return Markup("").join(
        Markup("S<sub>{}</sub>").format(one) if n % 2 else escape(one) for n, one in enumerate(parts)
    )


FILTERS: Mapping[str, Callable[..., Any]] = {
    one.__name__: one for one in (count, duration, first_upper, percent, rate, thousands, with_indices)
}
"""The filters of the templates of incidents and of the fleet."""


class _TemplateCache(jinja2.BytecodeCache):
    """The templates that this process has compiled: that takes longer than to fill one, and a fleet has many pages."""

    def __init__(self) -> None:
        self._code: dict[tuple[str, str], CodeType | None] = {}

    def load_bytecode(self, bucket: jinja2.bccache.Bucket) -> None:
        bucket.code = self._code.get((bucket.key, bucket.checksum))

    def dump_bytecode(self, bucket: jinja2.bccache.Bucket) -> None:
        self._code[bucket.key, bucket.checksum] = bucket.code


_COMPILED = _TemplateCache()


def fill(
    template: str,
    values: Mapping[str, object],
    *,
    filters: Mapping[str, Callable[..., Any]] | None = None,
    tests: Mapping[str, Callable[..., Any]] | None = None,
) -> str:
    """A template of `reports/` with its values, as text; the template may use the filters and tests by their names."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(resource_folder("reports")),
        autoescape=True,
        finalize=_shown_on_page,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        bytecode_cache=_COMPILED,
    )
    environment.filters.update({"label_of": label_of, **(filters or {})})
    environment.tests.update(tests or {})
    return environment.get_template(template).render(values)


def _shown_on_page(value: object) -> object:
    """What a template writes for a value: text on one line, without controls and marks of direction."""
    return one_line(value) if isinstance(value, str) and not isinstance(value, Markup) else value
