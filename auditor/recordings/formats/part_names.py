"""The names of files that are recordings: their kind, and what tells the parts of one drive.

Recorders name the parts of a drive `drive_0.mcap`, `drive_1.mcap`, `drive_<time>_2.bag`, or each by the time at which
it begins: `drive_<time>.mcap`.
"""

import re
from collections.abc import Sequence
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from auditor.model.stamps import NANOSECONDS
from auditor.recordings.formats.found import Span
from auditor.recordings.formats.unpacking import PACKED, kind_of
from auditor.recordings.parameters import DRIVE_PARTS

_EPOCH = re.compile(r"(.*?)[_.-]?(?<!\d)(1\d{9})(?:\d{3}){0,3}", re.DOTALL)
"""Seconds since 1970, also with the digits of ms, us or ns behind."""

_DATE_AND_TIME = re.compile(
    r"(?P<series>.*?)[_.-]?(?<!\d)(?P<year>(?:19|20)\d\d)(?P<sep>[-_.]?)(?P<month>\d\d)(?P=sep)(?P<day>\d\d)"
    r"(?:T?|[-_. ](?=\d\d[-_.:]))(?P<hour>\d\d)(?P<between>[-_.:]?)(?P<minute>\d\d)"
    r"(?:(?P=between)(?P<second>\d\d)(?:\d{3})?)?Z?",
    re.DOTALL,
)
"""A date and a time that are no counter: with nothing or a T between, or with the parts of the time apart."""

_NUMBERED = re.compile(r"(.*?)[_.-]?(\d{1,6})", re.DOTALL)
_BAG_TIME = re.compile(r"[_-]?\d{4}-\d\d-\d\d-\d\d-\d\d-\d\d$")
"""rosbag writes into the name of each part when the part was begun."""

_ACTIVE = ".active"
BAG, DB3, MCAP = ".bag", ".db3", ".mcap"
KINDS = frozenset({BAG, DB3, MCAP})


class PartName(NamedTuple):
    """A name with a number at its end: parts of one drive have the folder, series and kind in common.

    The number is a counter or, where the name `is_dated`, the time in s at which the part begins. `digits` are those of
    a counter that has four or six, and so may be a time of day.
    """

    folder: Path
    series: str
    kind: str
    number: int
    stem: str
    is_dated: bool = False
    digits: str = ""

    @property
    def key(self) -> tuple[Path, str, str]:
        """What the parts of one drive have in common."""
        return self.folder, self.series, self.kind

    @property
    def may_tell_time(self) -> bool:
        """Whether its number is a time, or may be one."""
        return self.is_dated or _time_of_day_s(self.digits) is not None

    def tells_time_after(self, before: "PartName", begins_apart_ns: int) -> bool:
        """True where this name is that of a part which begins so long after another one, by the times in both names."""
        if self.is_dated or before.is_dated:
            return self.is_dated and before.is_dated and self.number > before.number
        seconds = [_time_of_day_s(name.digits) for name in (before, self)]
        if seconds[0] is None or seconds[1] is None or len(self.digits) != len(before.digits):
            return False
        rounded_s = 1 if len(self.digits) == len("HHMMSS") else 60
        return abs(seconds[1] - seconds[0] - begins_apart_ns / NANOSECONDS) <= rounded_s


def file_kind(file: Path) -> str:
    """.bag, .db3 or .mcap, also of a packed file and of a bag that was not closed; empty for any other name."""
    kind = BAG if file.name.lower().endswith(BAG + _ACTIVE) else kind_of(file)
    return kind if kind in KINDS else ""


def stem_of(file: Path) -> str:
    """A name without its extensions."""
    name = file.stem if file.suffix.lower() in {*PACKED, _ACTIVE} else file.name
    return Path(name).stem


def part_name(file: Path) -> PartName | None:
    """The parts of a file's name; None where it has no number at its end, or is no recording in one file."""
    kind, stem = file_kind(file), stem_of(file)
    if not kind:
        return None
    if (dated := _dated(stem)) is not None:
        series, time_s = dated
        return PartName(file.parent, series, kind, time_s, series, is_dated=True)
    parts = _NUMBERED.fullmatch(stem)
    if parts is None:
        return None
    series = _BAG_TIME.sub("", parts[1]) if kind == BAG else parts[1]
    is_block = not stem[: parts.start(2)][-1:].isdigit()
    return PartName(file.parent, series, kind, int(parts[2]), parts[1], digits=parts[2] if is_block else "")


def _dated(stem: str) -> tuple[str, int] | None:
    """The series and the time in s of a name that ends with a date and a time, or with the seconds since 1970."""
    if (epoch := _EPOCH.fullmatch(stem)) is not None:
        return epoch[1], int(epoch[2])
    parts = _DATE_AND_TIME.fullmatch(stem)
    if parts is None or (parts["between"] and not parts["second"]):
        return None
    fields = parts.group("year", "month", "day", "hour", "minute", "second")
    with suppress(ValueError):  # no date: a thirteenth month
        begin = datetime.strptime(" ".join(field or "00" for field in fields), "%Y %m %d %H %M %S")
        return parts["series"], int(begin.replace(tzinfo=UTC).timestamp())  # of any zone: only differences count
    return None


def _time_of_day_s(digits: str) -> int | None:
    """The seconds since midnight that HHMM or HHMMSS stand for; None of other digits."""
    if len(digits) not in {len("HHMM"), len("HHMMSS")}:
        return None
    hours, minutes, seconds = (int(digits[place : place + 2] or 0) for place in (0, 2, 4))
    return 3600 * hours + 60 * minutes + seconds if hours < 24 and max(minutes, seconds) < 60 else None


def common_name(files: Sequence[Path]) -> str:
    """`drive` for drive_0.mcap and drive_1.mcap; where part 0 and part 1 are not among them `drive_4`."""
    name = part_name(files[0])
    if len(files) == 1 or name is None or name.number > 1:
        return stem_of(files[0])
    return name.stem or files[0].parent.name


def missing_between(file: Path, following: Path) -> str:
    """A sentence on the hole between the numbers of two parts of one drive; empty where there is none."""
    name, after = part_name(file), part_name(following)
    if name is None or after is None or name.key != after.key or name.is_dated or after.number <= name.number + 1:
        return ""
    first, last = name.number + 1, after.number - 1
    which = f"part {first} is" if first == last else f"parts {first} to {last} are"
    return f"{which} missing between {file.name} and {following.name}"


def follows_at_once(before: Span, after: Span) -> bool:
    """True where no time is left between two parts in which another one may have been recorded."""
    return after[0] - before[1] <= DRIVE_PARTS.most_pause_share * shorter_length_ns(before, after)


def shorter_length_ns(before: Span, after: Span) -> int:
    """The time that the shorter of two parts covers."""
    return min(end_ns - begin_ns for begin_ns, end_ns in (before, after))


def other_parts(files: Sequence[Path]) -> tuple[Path, ...]:
    """The files beside those of a recording that are named as parts of the same drive, in the order of their numbers.

    Raises nothing: a folder that cannot be read has none.
    """
    own = {name.key for file in files if (name := part_name(file)) is not None}
    beside: list[tuple[int, Path]] = []
    for folder in sorted({folder for folder, _, _ in own}):
        try:
            listed = [file for file in folder.iterdir() if file not in files and file.is_file()]
        except OSError:
            continue
        beside += [(name.number, file) for file in listed if (name := part_name(file)) is not None and name.key in own]
    return tuple(file for _, file in sorted(beside))
