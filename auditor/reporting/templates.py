"""The templates in `reports/`, filled: every page escapes all text, and fails where a value is missing."""

from collections.abc import Callable, Mapping
from typing import Any

import jinja2

from auditor.reporting.page_text import shown_on_page
from auditor.resources import resource_folder


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
        finalize=shown_on_page,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
    )
    environment.filters.update(filters or {})
    environment.tests.update(tests or {})
    return environment.get_template(template).render(values)
