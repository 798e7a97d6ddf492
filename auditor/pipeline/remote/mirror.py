"""Mirrors: a store on an object store, worked on as a folder of this computer, and put back.

A mirror is this process's alone while it lasts. It is brought up to date before a command, and what the command wrote
is put back behind it, and every minute of a scan: first the files, then the snapshot that names them.
"""

import json
import os
import random
import shutil
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import replace
from pathlib import Path
from threading import Event

from auditor.errors import AuditorError, SettingError, StoreError
from auditor.pipeline.remote.addresses import Address, address_of
from auditor.pipeline.remote.object_store import NoObjectError, copy_object, put_object, remove_object
from auditor.pipeline.remote.snapshots import (
    BASE,
    HASHED,
    USED,
    File,
    Files,
    PlaceMerge,
    Snapshot,
    free_slot,
    merged,
    object_at,
    read_base,
    read_hashed,
    read_snapshot,
    replace_snapshot,
    under,
)
from auditor.recordings.location import StoredObject
from auditor.store.files import is_part, make_folder, write_whole
from auditor.store.log.chains import LOG, foreign_chains, is_mirror, log_lock, note_foreign
from auditor.store.log.entry import hash_file
from auditor.store.log.runs import logged
from auditor.store.maintenance.relations import relate
from auditor.store.records import RecordingRecord
from auditor.store.rows import stored_recording
from auditor.store.store import Store
from auditor.store.tables import read_rows

EACH_S = 60.0
"""A scan puts back what was measured so often."""

_MOST_TRIES = 50
_AT_ONCE = 16
_COMING, _GOING = "coming", "going"
_OWNERS = 0o600


class Mirror:
    """A mirror of the store at an address, in a folder of the user's cache that no other process uses.

    Raises StoreError where it cannot be made, and what object stores raise.
    """

    def __init__(self, address: Address, *, left: bool = False) -> None:
        """One that may hold anything, or one in which an ended process `left` what it could not put back."""
        self.address = address
        self._slot, self._lock = free_slot(address, left=left)
        self.folder = self._slot / "store"
        make_folder(self.folder)
        self._base: Files = read_base(self._slot)
        self._hashed = read_hashed(self._slot)
        self._put_back_at = time.monotonic()
        self._outgrown: list[tuple[str, File]] = []
        if not is_mirror(self.folder):
            note_foreign(self.folder, ())

    def refresh(self) -> None:
        """Bring the mirror up to date; what an ended process left in it is put back with the next command."""
        self._synchronise(put=False)

    def mark_used(self) -> None:
        """Note that something may be written, which the next command puts back where this one cannot."""
        (self._slot / USED).touch(0o600)

    def put_back_if_due(self) -> None:
        """Put back what was written, unless that was done just now."""
        if time.monotonic() - self._put_back_at >= EACH_S:
            self._synchronise(put=True)
            self._put_back_at = time.monotonic()

    def put_back(self) -> None:
        """Put back what was written: all of it appears in one moment. Raises StoreError where it cannot stand beside
        what somebody else wrote meanwhile; it is kept then, in another folder.
        """
        self._synchronise(put=True)
        (self._slot / USED).unlink(missing_ok=True)

    def close(self) -> None:
        """Let another process have it."""
        if self._slot.is_dir():
            write_whole(self._slot / HASHED, json.dumps(self._hashed).encode())
        os.close(self._lock)

    def _synchronise(self, *, put: bool) -> None:
        for attempt in range(_MOST_TRIES):
            theirs = read_snapshot(self.address)
            try:
                self._fetch(theirs.files)
            except NoObjectError:
                if read_snapshot(self.address).written == theirs.written:
                    raise
                continue  # a chain has outgrown what this snapshot names of it
            with self._still():
                mine = self._scan()
                merge = merged(self._base, mine, theirs.files)
                if merge.refused:
                    raise self._set_aside(merge.refused)
                before = self._base
                self._take(merge, theirs.files)
                whole = self._whole(mine, merge, theirs.files)
                if put:
                    self._stage(whole, theirs.files)
            if self._settle(merge, before, mine, theirs.files):
                continue
            if not put or whole == theirs.files:
                return
            if self._commit(whole, theirs):
                return
            time.sleep(random.uniform(0, min(5.0, 0.05 * 2**attempt)))  # noqa: S311 - so that writers take turns
        raise StoreError("others write to it all the time", where=self.address, remedy="run the command again")

    @contextmanager
    def _still(self) -> Iterator[None]:
        """No file of a finished row, and no entry of the log, comes inside the block."""
        with log_lock(self.folder) if (self.folder / LOG).is_dir() else nullcontext():
            yield

    def _scan(self) -> dict[str, File]:
        """What lies in the mirror."""
        files = {}
        for above, _, names in os.walk(self.folder):
            for name in names:
                path = Path(above, name)
                if is_part(path):
                    continue
                place = path.relative_to(self.folder).as_posix()
                status = path.stat()
                stamp = (status.st_size, status.st_mtime_ns, status.st_ino)
                entry = self._hashed.get(place)
                if entry is None or entry[0] != stamp:
                    entry = self._hashed[place] = (stamp, hash_file(path)[1])
                files[place] = (status.st_size, entry[1])
        return files

    # Theirs

    def _fetch(self, theirs: Files) -> None:
        """Copy what is new, under the names of its content."""
        coming = self._slot / _COMING
        make_folder(coming)
        wanted = {place: file for place, file in theirs.items() if self._base.get(place) != file}
        missing = {
            file[1]: (place, file)
            for place, file in wanted.items()
            if not (coming / file[1]).exists() and not self._is_there(place, file)
        }
        with ThreadPoolExecutor(_AT_ONCE) as pool:
            list(pool.map(lambda one: self._copy(coming / one[1][1], *one), missing.values()))

    def _is_there(self, place: str, file: File) -> bool:
        path = self.folder / place
        return path.is_file() and hash_file(path) == file

    def _copy(self, into: Path, place: str, file: File) -> None:
        there = object_at(self.address, place, file)
        half = into.with_name(f"{into.name}.{os.getpid()}.half")
        half.unlink(missing_ok=True)
        copy_object(there.root, StoredObject(str(there), file[0], None, ""), half, Event())
        if hash_file(half) != file:
            half.unlink()
            raise StoreError("it is not what the snapshot says", where=there, remedy="it was altered: do not trust it")
        half.chmod(_OWNERS)
        half.replace(into)

    def _take(self, merge: PlaceMerge, theirs: Files) -> None:
        """Put theirs in its place; of what both changed mine is kept aside for `_settle`."""
        going = self._slot / _GOING
        shutil.rmtree(going, ignore_errors=True)
        for place in merge.both:
            _link(self.folder / place, going / "mine" / place)
        new = {place: theirs.get(place) for place in (*merge.taken, *merge.both)}
        foreign = {Path(place).name for place in new if place.startswith(f"{LOG}/")} - {
            Path(place).name for place in merge.both
        }
        if foreign:
            note_foreign(self.folder, foreign_chains(self.folder) | foreign)
        for place, file in new.items():
            path = self.folder / place
            if file is None:
                path.unlink(missing_ok=True)
            elif not self._is_there(place, file):
                make_folder(path.parent)
                _link(self._slot / _COMING / file[1], path)
        self._base = dict(theirs)
        write_whole(self._slot / BASE, json.dumps(self._base).encode())

    def _whole(self, mine: Files, merge: PlaceMerge, theirs: Files) -> dict[str, File]:
        """What the mirror holds once theirs is in its place."""
        whole = dict(mine)
        for place in (*merge.taken, *merge.both):
            file = theirs.get(place)
            if file is None:
                whole.pop(place, None)
            else:
                whole[place] = file
        return whole

    def _settle(self, merge: PlaceMerge, base: Files, mine: Files, theirs: Files) -> bool:
        """Let what both wrote stand beside one another; True where that wrote something."""
        own, others = (
            [place for place in files if place.startswith("recordings/") and place not in base]
            for files in (mine, theirs)
        )
        unrelated = [place for place in own if place not in theirs] if set(others) - set(own) else []
        if not merge.both and not unrelated:
            return False
        store = Store(self.folder)
        with logged(self.folder) as run:
            for place in merge.both:
                if place.startswith("recordings/"):
                    aside = self._slot / _GOING / "mine" / place
                    [row] = read_rows("recordings", aside)
                    store.write_recording(_joined(stored_recording(row), store.recording(Path(place).stem)))
                else:
                    run.output(place, theirs[place][1], theirs[place][0])
            anew = [store.recording(Path(place).stem) for place in unrelated]
            anew = [one for one in anew if one.conflicts is not None]
            for record in anew:
                store.write_recording(replace(record, conflicts=None))
            if anew:
                relate(store)
        return bool(merge.both or anew)

    # Mine

    def _stage(self, whole: Files, theirs: Files) -> None:
        """Keep what is to be put back as it is now: chains of the log grow on."""
        for place, file in whole.items():
            if theirs.get(place) != file:
                _link(self.folder / place, self._slot / _GOING / place, copied=place.startswith(f"{LOG}/"))

    def _commit(self, whole: Files, theirs: Snapshot) -> bool:
        """Put the files back, then the snapshot that names them; False where somebody else was faster."""
        new = {place: file for place, file in whole.items() if theirs.files.get(place) != file}
        with ThreadPoolExecutor(_AT_ONCE) as pool:
            list(pool.map(self._put, new.items()))
        if not replace_snapshot(self.address, theirs, whole):
            return False
        self._base = whole
        write_whole(self._slot / BASE, json.dumps(self._base).encode())
        for left in (_GOING, _COMING):
            shutil.rmtree(self._slot / left, ignore_errors=True)
        self._remove_outgrown(theirs.files, whole)
        return True

    def _remove_outgrown(self, before: Files, now: Files) -> None:
        """Remove what chains of this mirror were two snapshots ago: whoever reads the last one finds all of it."""
        for chain in self._outgrown:
            with suppress(AuditorError):  # it takes room, and nothing else
                remove_object(object_at(self.address, *chain))
        self._outgrown = [
            (place, file) for place, file in before.items() if place.startswith(f"{LOG}/") and now.get(place) != file
        ]

    def _put(self, entry: tuple[str, File]) -> None:
        file = self._slot / _GOING / entry[0]
        put_object(object_at(self.address, *entry), file)
        if entry[0].startswith("reports/"):  # pages name each other, and are looked at there
            put_object(under(self.address, entry[0]), file)

    def _set_aside(self, place: str) -> StoreError:
        """Begin a new mirror; what was written in this one stays where a person finds it."""
        aside = self._slot.with_name(f"{self._slot.name}-aside-{time.time_ns()}")
        self._slot.rename(aside)
        return StoreError(
            f"somebody else changed {place} meanwhile, and both cannot stand: nothing of this command was put back",
            where=self.address,
            remedy=f"run it again; what it wrote is kept in {aside / 'store'}",
        )


_current: dict[Path, Mirror] = {}
"""The mirrors of this process, by their folders."""


@contextmanager
def mirrored(address: Address) -> Iterator[Path]:
    """The mirror of a store inside the block; at its end what was written is put back, also where an error ends it."""
    _put_back_left(address)
    mirror = Mirror(address)
    try:
        mirror.refresh()
        mirror.mark_used()
        _current[mirror.folder] = mirror
        try:
            yield mirror.folder
        except BaseException:
            with suppress(AuditorError):  # the error itself is what is to be told
                mirror.put_back()
            raise
        mirror.put_back()
    finally:
        _current.pop(mirror.folder, None)
        mirror.close()


def brought_here(text: str) -> Path:
    """The mirror of the store at an address as it is now, to be read. Raises SettingError and what object stores do."""
    address = address_of(text)
    if address is None:
        raise SettingError("it is no address of a store", where=text, remedy="write s3://bucket/folder")
    with mirrored(address) as folder:
        return folder


def _put_back_left(address: Address) -> None:
    """Put back what ended processes left in mirrors of this machine."""
    with suppress(FileNotFoundError):
        while True:
            mirror = Mirror(address, left=True)
            try:
                mirror.put_back()
            finally:
                mirror.close()


def put_back_if_due(folder: Path) -> None:
    """Put back what was written to a mirror, unless that was done just now; nothing of any other folder."""
    if folder in _current:
        _current[folder].put_back_if_due()


def synchronised(folder: Path) -> None:
    """Let a mirror of this process have what others put back, and put back what it has; nothing of other folders."""
    if folder in _current:
        _current[folder].put_back()
        _current[folder].mark_used()


def place_of(folder: Path) -> Path | Address:
    """The address of the store that a folder of this process is a mirror of; of any other folder its own path."""
    return _current[folder].address if folder in _current else folder.absolute()


@contextmanager
def as_folder(place: Path | Address) -> Iterator[Path]:
    """The store at a path or an address as a folder inside the block."""
    with mirrored(place) if isinstance(place, Address) else nullcontext(place) as folder:
        yield folder


def _joined(mine: RecordingRecord, theirs: RecordingRecord) -> RecordingRecord:
    """What two writers know of one recording; it is compared with the others anew."""
    places = {(one.name, one.path) for one in theirs.sightings}
    new = tuple(one for one in mine.sightings if (one.name, one.path) not in places)
    return replace(theirs, sightings=(*theirs.sightings, *new), superseded_by=None, conflicts=None)


def _link(path: Path, to: Path, *, copied: bool = False) -> None:
    """The same file under another name too, or a copy of it."""
    make_folder(to.parent)
    beside = to.with_name(f".{to.name}.link")
    beside.unlink(missing_ok=True)
    if copied:
        shutil.copyfile(path, beside)
    else:
        os.link(path, beside)
    beside.replace(to)
