"""What the log says of the files of a store: which are in their places, with which content, and since which run."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import PurePosixPath

from auditor.store.log.entry import Entry, Kind
from auditor.store.log.outputs import Output
from auditor.store.log.runs import pending

_CHANGES = frozenset({Kind.WROTE, Kind.REMOVED, Kind.UPGRADED, Kind.PACKED})


@dataclass(frozen=True)
class Place:
    """What may lie in one place: the `accepted` outputs, None where nothing may; `entry` is the last one about it.

    There are several only while the run that changes it is open.
    """

    accepted: tuple[Output | None, ...]
    entry: Entry

    def accepts(self, found: Output | None) -> bool:
        """Whether this is what should lie there."""
        return found in self.accepted


@dataclass(frozen=True)
class Expected:
    """What the log says: `places` by path, the runs by their ids, and those that were not closed."""

    places: dict[str, Place] = field(default_factory=dict)
    runs: dict[str, Entry] = field(default_factory=dict)
    open_runs: tuple[Entry, ...] = ()

    def told(self, place: str) -> str:
        """Which command changed a place last, and when."""
        entry = self.places[place].entry
        opened = self.runs.get(entry.run)
        words = opened.what.get("command", ()) if opened is not None else ()
        return f"{' '.join(words[:2]) or 'a run'} at {entry.at[:19]}Z"


def expected(entries: Sequence[Entry]) -> Expected:
    """What entries, in their order, say of files."""
    opened = {entry.run: entry for entry in entries if entry.kind == Kind.OPENED}
    closed = {entry.run for entry in entries if entry.kind == Kind.CLOSED}
    under_way = [entry for run, entry in opened.items() if run not in closed]
    unsettled = {entry.order for one in under_way for entry in pending(entries, one.run)}
    untrue = {
        (order, path)
        for entry in entries
        if entry.kind == Kind.CLOSED
        for order, path in entry.what.get("unwritten", ())
    }
    places: dict[str, Place] = {}
    for entry in entries:
        if entry.kind in _CHANGES:
            changes = [file for file in entry.what["files"] if (entry.order, file["path"]) not in untrue]
            if entry.kind == Kind.UPGRADED and changes:
                places.clear()
            for file in changes:
                _change(places, entry, file, settled=entry.order not in unsettled)
    return Expected(places, opened, tuple(under_way))


def _change(places: dict[str, Place], entry: Entry, file: dict[str, object], *, settled: bool) -> None:
    path = str(file["path"])
    if not _is_inside(path):
        return
    new = Output.of_fields(file) if "sha256" in file else None
    if new is None and not settled and path not in places:
        return  # it may be there still, and the row that finished it says how it was
    before: tuple[Output | None, ...] = places[path].accepted if path in places else (None,)
    places[path] = Place((new,) if settled else (new, *before), entry)


def _is_inside(path: str) -> bool:
    place = PurePosixPath(path)
    return not place.is_absolute() and ".." not in place.parts
