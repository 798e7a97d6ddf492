"""Snapshots: what a store on an object store consists of, and how the changes of two writers are put together.

    PREFIX/snapshot.json                    the places of all files, each with its size and sha256
    PREFIX/<table>/<id>.<sha256>.parquet    the files, under names that say their content: they never change

A store is what its snapshot says. It is replaced in one moment, and only by who has seen the one before: so files of
several tables appear together or not at all, and of two writers the slower one puts its changes on those of the other.
Mirrors lie in slots, folders of the user's cache, each one process's alone while it uses it.
"""

import fcntl
import hashlib
import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import count
from pathlib import Path, PurePosixPath

from auditor.errors import StoreError
from auditor.pipeline.remote.addresses import Address
from auditor.pipeline.remote.object_store import Written, read_small, replace_small
from auditor.store.files import make_folder
from auditor.store.schema import WRITTEN

SNAPSHOT = "snapshot.json"
_FORMAT = "auditor store snapshot 1"
_SHA_SHOWN = 16

File = tuple[int, str]
"""The size in bytes and the sha256 of a file."""

Files = Mapping[str, File]
"""Files by their places in a store."""

_MADE_ONCE = ("measurements", *WRITTEN, "pictures")
"""What a measurement consists of: of two that measured the same, the one that came first stays."""

_ALIKE = ("judgements", "verdicts", "rigs", "triples", "sensor_checks", "labels", "calibrations", "reports")
"""What two writers make of the same, or may replace: of two that did so at once, the one that came first stays."""

_TOGETHER = (
    ("calibration_versions", "calibration_history", "calibration_conditions", "calibration_recordings", "quarantine"),
    ("packs", "packs.csv"),
)
"""What makes sense only as one of two writers left it."""


@dataclass(frozen=True)
class Snapshot:
    """The files of a store at one moment, and the writing of the object that says so; None where there is none."""

    files: Files
    written: Written | None = None


def read_snapshot(address: Address) -> Snapshot:
    """The snapshot of the store at an address; one without files where there is none. Raises StoreError and others."""
    snapshot = read_small(_place(address))
    if snapshot is None:
        return Snapshot({})
    try:
        content = json.loads(snapshot[0])
        if content["format"] != _FORMAT:
            raise StoreError("it is no snapshot of a store", where=_place(address))
        files = {str(place): (int(size), str(sha256)) for place, (size, sha256) in content["files"].items()}
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise StoreError("it is no snapshot of a store", where=_place(address)) from error
    if any(place.startswith("/") or ".." in place.split("/") for place in files):
        raise StoreError("it names a place outside the store", where=_place(address))
    return Snapshot(files, snapshot[1])


def replace_snapshot(address: Address, before: Snapshot, files: Files) -> bool:
    """Put a snapshot in the place of another; False where somebody else was faster."""
    content = {"format": _FORMAT, "files": {place: files[place] for place in sorted(files)}}
    return replace_small(_place(address), json.dumps(content, indent=0).encode(), before.written)


def object_at(address: Address, place: str, file: File) -> Address:
    """Where the file of a place lies with this content."""
    path = PurePosixPath(place)
    return under(address, str(path.with_name(f"{path.stem}.{file[1][:_SHA_SHOWN]}{path.suffix}")))


def under(address: Address, name: str) -> Address:
    """Where a name lies in the store at an address."""
    return Address(address.root, f"{address.key.strip('/')}/{name}".lstrip("/"))


def _place(address: Address) -> Address:
    return under(address, SNAPSHOT)


@dataclass(frozen=True)
class PlaceMerge:
    """What becomes of places: those that are taken as `theirs` (None: removed), and those that both changed."""

    taken: Mapping[str, File | None]
    both: tuple[str, ...]
    refused: str = ""


def merged(base: Files, mine: Files, theirs: Files) -> PlaceMerge:
    """Put the changes of two writers together; `refused` says what of both cannot stand beside one another."""
    taken: dict[str, File | None] = {}
    both: list[str] = []
    for place in {*base, *mine, *theirs}:
        before, here, there = base.get(place), mine.get(place), theirs.get(place)
        made_once = here is not None and there is not None and place.split("/")[0] in _MADE_ONCE
        if here == there:
            continue
        if here == before:
            taken[place] = there
        elif there != before or made_once:
            both.append(place)
    return PlaceMerge(taken, tuple(sorted(both)), _refused(base, mine, theirs, both))


def _refused(base: Files, mine: Files, theirs: Files, both: list[str]) -> str:
    for place in both:
        table = place.split("/")[0]
        mergeable = table in {*_MADE_ONCE, *_ALIKE, "recordings"}
        if not mergeable or place not in mine or place not in theirs:
            return place
    for group in _TOGETHER:
        changed = [_changed(base, files, group) for files in (mine, theirs)]
        if all(changed):
            return changed[0]
    return ""


def _changed(base: Files, files: Files, group: tuple[str, ...]) -> str:
    """A place of some tables that was changed; empty where none was."""
    return next((p for p in sorted({*base, *files}) if p.split("/")[0] in group and base.get(p) != files.get(p)), "")


BASE, HASHED, USED = "base.json", "hashed.json", "used"
"""What a slot has beside the store: the snapshot that it began with, hashes, and a mark that something was written."""

Stamp = tuple[int, int, int]

_ADDRESS_DIGITS = 16


def free_slot(address: Address, *, left: bool) -> tuple[Path, int]:
    """A folder for a mirror that no process uses, and what this one holds it by.

    Raises FileNotFoundError where there is none in which an ended process `left` something.
    """
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()) / "auditor" / "mirrors"
    make_folder(base)
    name = hashlib.sha256(str(address).encode()).hexdigest()[:_ADDRESS_DIGITS]
    folders = sorted(one for one in base.glob(f"{name}-*") if "-aside-" not in one.name)
    slots: Iterable[Path] = (base / f"{name}-{number}" for number in count())
    for slot in (one for one in folders if (one / USED).exists()) if left else slots:
        make_folder(slot)
        lock = os.open(slot, os.O_RDONLY)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(lock)
        else:
            return slot, lock
    raise FileNotFoundError(name)


def read_hashed(slot: Path) -> dict[str, tuple[Stamp, str]]:
    """The hashes of files by their sizes, times and inodes, as they were when the mirror was last used."""
    try:
        content = json.loads((slot / HASHED).read_bytes())
        return {place: ((size, at, inode), sha256) for place, ((size, at, inode), sha256) in content.items()}
    except (OSError, ValueError):
        return {}


def read_base(slot: Path) -> Files:
    """The files of the snapshot that a mirror was last made equal to."""
    try:
        content = json.loads((slot / BASE).read_bytes())
        return {place: (size, sha256) for place, (size, sha256) in content.items()}
    except (OSError, ValueError):
        return {}
