"""What the path of a recording says of it: `{vehicle}/{date}/{drive}.mcap`."""

import re
from pathlib import Path

from auditor.errors import SettingError

WORDS = ("vehicle", "date", "drive")
_PLACE = re.compile(r"\{(\w*)\}|(\*)")


def read_path(path: Path, pattern: str) -> dict[str, str]:
    """The words of a pattern, by name, where the end of the path fits it; else nothing.

    `{vehicle}`, `{date}` and `{drive}` stand for any text without a slash, `*` for text that nobody needs. Raises
    SettingError for a pattern with other words, a word twice, or none.
    """
    expression, position = "", 0
    for place in _PLACE.finditer(pattern):
        expression += re.escape(pattern[position : place.start()])
        expression += "[^/]*" if place[2] else f"(?P<{_word(place[1], pattern, expression)}>[^/]+?)"
        position = place.end()
    if "(?P<" not in expression:
        raise SettingError("it holds none of {vehicle}, {date} and {drive}", where=f"path pattern {pattern!r}")
    found = re.search(f"(?:^|/){expression}{re.escape(pattern[position:])}$", path.as_posix())
    return found.groupdict() if found else {}


def _word(word: str, pattern: str, before: str) -> str:
    if word not in WORDS or f"(?P<{word}>" in before:
        raise SettingError(
            f"{{{word}}} is none of {', '.join(f'{{{known}}}' for known in WORDS)}, each once",
            where=f"path pattern {pattern!r}",
        )
    return word
