"""Names of the parts into which recorders split a drive: `drive_0.mcap`, `drive_1.mcap`, `drive_<time>_2.bag`."""

import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from auditor.recordings.formats.unpacking import PACKED, kind_of

_NUMBERED = re.compile(r"(.*?)[_.-]?(\d{1,6})", re.DOTALL)
_BAG_TIME = re.compile(r"[_-]?\d{4}-\d\d-\d\d-\d\d-\d\d-\d\d$")
"""rosbag writes into the name of each part when the part was begun."""

_ACTIVE = ".active"
BAG, DB3, MCAP = ".bag", ".db3", ".mcap"
KINDS = frozenset({BAG, DB3, MCAP})


class PartName(NamedTuple):
    """A name with a number at its end: parts of one drive have the folder, series and kind in common."""

    folder: Path
    series: str
    kind: str
    number: int
    stem: str

    @property
    def key(self) -> tuple[Path, str, str]:
        """What the parts of one drive have in common."""
        return self.folder, self.series, self.kind


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
    kind, found = file_kind(file), _NUMBERED.fullmatch(stem_of(file))
    if not kind or found is None:
        return None
    series = _BAG_TIME.sub("", found[1]) if kind == BAG else found[1]
    return PartName(file.parent, series, kind, int(found[2]), found[1])


def common_name(files: Sequence[Path]) -> str:
    """`drive` for drive_0.mcap and drive_1.mcap; where part 0 and part 1 are not among them `drive_4`."""
    name = part_name(files[0])
    if len(files) == 1 or name is None or name.number > 1:
        return stem_of(files[0])
    return name.stem or files[0].parent.name


def missing_parts(files: Sequence[Path]) -> Iterator[str]:
    """A sentence for each hole in the numbers of the parts of one drive."""
    named = [part_name(file) for file in files]
    for (file, name), (following, after) in pairwise(zip(files, named, strict=True)):
        if name is None or after is None or name.key != after.key or after.number <= name.number + 1:
            continue
        first, last = name.number + 1, after.number - 1
        which = f"part {first} is" if first == last else f"parts {first} to {last} are"
        yield f"{which} missing between {file.name} and {following.name}"


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
