"""Where a recording comes from: its vehicle, date, drive and weather, read from its path or its metadata."""

import datetime
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from auditor.errors import SettingError

WORDS = ("vehicle", "date", "drive", "weather")
_PLACE = re.compile(r"\{(\w*)\}|(\*)")
_DAY = re.compile(r"(\d{4})([-_.]?)(\d\d)\2(\d\d)")


def read_path(path: Path, pattern: str) -> dict[str, str]:
    """The text that stands for each word of a pattern, by word, where the end of the path matches it; else nothing.

    `{vehicle}`, `{date}`, `{drive}` and `{weather}` stand for any text without a slash, `*` for text that is ignored.
    Raises SettingError for a pattern with other words, a word twice, or none.
    """
    expression, position = "", 0
    for place in _PLACE.finditer(pattern):
        expression += re.escape(pattern[position : place.start()])
        expression += "[^/]*" if place[2] else f"(?P<{_word(place[1], pattern, expression)}>[^/]+?)"
        position = place.end()
    if "(?P<" not in expression:
        raise SettingError(
            "it holds none of {vehicle}, {date}, {drive} and {weather}", where=f"path pattern {pattern!r}"
        )
    found = re.search(f"(?:^|/){expression}{re.escape(pattern[position:])}$", path.as_posix())
    return found.groupdict() if found else {}


def _word(word: str, pattern: str, before: str) -> str:
    if word not in WORDS or f"(?P<{word}>" in before:
        raise SettingError(
            f"{{{word}}} is none of {', '.join(f'{{{known}}}' for known in WORDS)}, each once",
            where=f"path pattern {pattern!r}",
        )
    return word


@dataclass(frozen=True)
class Origin:
    """The origin of a recording; None where a part is unknown."""

    vehicle: str | None = None
    date: datetime.date | None = None
    drive: str | None = None
    weather: str | None = None

    def over(self, other: Self) -> "Origin":
        """This origin, with its unknown parts taken from another."""
        return Origin(
            self.vehicle or other.vehicle,
            self.date or other.date,
            self.drive or other.drive,
            self.weather or other.weather,
        )

    @classmethod
    def of_path(cls, path: Path, pattern: str) -> "Origin":
        """The origin that a path gives by a pattern, see read_path. Raises SettingError for a bad pattern or date."""
        declared = read_path(path.absolute(), pattern)
        date = _day(declared["date"]) if "date" in declared else None
        if "date" in declared and date is None:
            raise SettingError(
                f"{declared['date']!r} in {path} is not a date",
                where=f"path pattern {pattern!r}",
                remedy="{date} stands for a day such as 2026-01-31, 2026_01_31 or 20260131",
            )
        return cls(declared.get("vehicle"), date, declared.get("drive"), declared.get("weather"))

    @classmethod
    def of_metadata(cls, declared: Mapping[str, str]) -> "Origin":
        """The origin that a recording's metadata declares; an ill-formed date is ignored."""
        vehicle, drive, weather = (declared.get(name) or None for name in ("vehicle", "drive", "weather"))
        return cls(vehicle, _day(declared.get("date", "")), drive, weather)


def _day(text: str) -> datetime.date | None:
    found = _DAY.fullmatch(text)
    try:
        return datetime.date(int(found[1]), int(found[3]), int(found[4])) if found else None
    except ValueError:
        return None
