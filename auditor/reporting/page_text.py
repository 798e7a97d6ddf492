"""Text on pages: the templates escape markup, and this what is no markup but still not only shown."""

from markupsafe import Markup

from auditor.model.text import one_line


def shown_on_page(value: object) -> object:
    """What a template writes for a value: text on one line, without controls and marks of direction."""
    return one_line(value) if isinstance(value, str) and not isinstance(value, Markup) else value
