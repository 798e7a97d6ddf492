"""The templates in `reports/`, filled: every page escapes all text, and fails where a value is missing."""

from collections.abc import Callable, Mapping
from types import CodeType
from typing import Any

import jinja2
from markupsafe import Markup

from auditor.model.text import one_line
from auditor.resources import resource_folder


class _Compiled(jinja2.BytecodeCache):
    """The templates that this process has compiled: that takes longer than to fill one, and a fleet has many pages."""

    def __init__(self) -> None:
        self._code: dict[tuple[str, str], CodeType | None] = {}

    def load_bytecode(self, bucket: jinja2.bccache.Bucket) -> None:
        bucket.code = self._code.get((bucket.key, bucket.checksum))

    def dump_bytecode(self, bucket: jinja2.bccache.Bucket) -> None:
        self._code[bucket.key, bucket.checksum] = bucket.code


_COMPILED = _Compiled()


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
    environment.filters.update(filters or {})
    environment.tests.update(tests or {})
    return environment.get_template(template).render(values)


def _shown_on_page(value: object) -> object:
    """What a template writes for a value: text on one line, without controls and marks of direction."""
    return one_line(value) if isinstance(value, str) and not isinstance(value, Markup) else value
