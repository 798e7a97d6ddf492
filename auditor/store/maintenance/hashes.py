"""Hashes of a store's files, and which files have changed since they were last hashed.

What was hashed and found right is kept in the user's own cache, by size, time of change and inode, and not in the
store: whoever may write to a store cannot say there what was checked.
"""

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from auditor.errors import StoreError
from auditor.store.files import write_whole
from auditor.store.log.entry import OutputFile, hash_file

PAGES = "reports/"
"""Where pages lie, which anybody may change."""

Stamp = tuple[int, int, int]
"""Size in bytes, time of change in nanoseconds, and inode."""


@dataclass(frozen=True)
class FileCheck:
    """A file when it was last found right: its stamp and its hash."""

    stamp: Stamp
    sha256: str


class Hashes:
    """The hashes of a store's files; of `trusted` ones those of before, while they have the stamps of then."""

    def __init__(self, folder: Path, trusted: Mapping[str, FileCheck]) -> None:
        self._folder = folder
        self._trusted = trusted
        self._hashed: dict[str, FileCheck] = {}

    def of(self, place: str) -> OutputFile | None:
        """What lies in a place; None where nothing does or it cannot be read."""
        try:
            stamp = _stamp((self._folder / place).stat())
        except OSError:
            return None
        check = self._trusted.get(place)
        if check is None or check.stamp != stamp:
            try:
                check = FileCheck(stamp, hash_file(self._folder / place)[1])
            except StoreError:
                return None
        self._hashed[place] = check
        return OutputFile(place, stamp[0], check.sha256)

    def keep(self, wrong: set[str]) -> None:
        """Keep the files that were found right, for the next time: those that were looked at, and those trusted."""
        untouched = {place: one for place, one in self._trusted.items() if (self._folder / place).is_file()}
        right = {place: one for place, one in {**untouched, **self._hashed}.items() if place not in wrong}
        write_checked(self._folder, right)


def stamps(folder: Path) -> dict[str, Stamp]:
    """The files in a store by place, with their stamps."""
    return dict(_walk(folder, ""))


def _walk(folder: Path | str, place: str) -> Iterator[tuple[str, Stamp]]:
    with os.scandir(folder) as there:
        for entry in there:
            if entry.is_dir(follow_symlinks=False):
                yield from _walk(entry.path, f"{place}{entry.name}/")
            else:
                with suppress(OSError):  # it went meanwhile
                    yield f"{place}{entry.name}", _stamp(entry.stat())


def _stamp(stat: os.stat_result) -> Stamp:
    return stat.st_size, stat.st_mtime_ns, stat.st_ino


def read_checked(folder: Path) -> dict[str, FileCheck]:
    """What was found right of the store in a folder, by place; nothing where that is not known."""
    try:
        content = json.loads(_cache(folder).read_bytes())
        return {place: FileCheck((size, time, inode), sha) for place, (size, time, inode, sha) in content.items()}
    except (OSError, ValueError, TypeError, AttributeError):
        return {}


def changed(folder: Path, checked: Mapping[str, FileCheck]) -> set[str]:
    """The places of a store, pages apart, where something has changed since it was found right."""
    there = stamps(folder)
    places = (place for place in checked.keys() | there.keys() if not place.startswith(PAGES))
    return {place for place in places if place not in checked or checked[place].stamp != there.get(place)}


def write_checked(folder: Path, checked: Mapping[str, FileCheck]) -> None:
    """Keep what was found right of the store in a folder; where that cannot be written, it is found again next time."""
    content = {place: [*one.stamp, one.sha256] for place, one in sorted(checked.items())}
    with suppress(StoreError):
        write_whole(_cache(folder), json.dumps(content).encode())


def _cache(folder: Path) -> Path:
    base = os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()
    name = hashlib.sha256(str(folder).encode()).hexdigest()[:32]
    return Path(base) / "auditor" / f"checked-{name}.json"
