"""The spool: copies of objects on disk, each for as long as it is read, within a budget."""

import fcntl
import os
import shutil
import tempfile
import threading
import weakref
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

from auditor.errors import AuditorError, RecordingError
from auditor.model.settings import MeasureSettings
from auditor.pipeline.remote.object_store import copy_object
from auditor.recordings import Location, find_recordings
from auditor.recordings.location import Remote

_PREFIX = "auditor-spool-"
_SHARE_OF_FREE = 0.5
_MB = 1e6
_WAIT_S = 0.5


class Spool:
    """Copies of recordings in a folder that is made when the first one is, and goes with the process.

    What a killed process left behind goes when the next one makes its own. Copies that are done with stay while there
    is room: pictures of incidents are made of them.
    """

    def __init__(self, above: Path | None = None, most_bytes: float | None = None) -> None:
        self.above = above or Path(tempfile.gettempdir())
        self.most_bytes = most_bytes
        self.stopped = threading.Event()
        self._changed = threading.Condition()
        self._folder: Path | None = None
        self._count = 0
        self._copies: dict[str, tuple[Path, tuple[Location, ...]]] = {}  # by what they are copies of, the oldest first
        self._sizes: dict[str, int] = {}
        self._in_use: dict[str, int] = {}
        self._of_parts: dict[str, str] = {}

    @property
    def room_bytes(self) -> float:
        """What all copies may take together: what was said, else half of what is free."""
        if self.most_bytes is None:
            self.above.mkdir(parents=True, exist_ok=True)
            self.most_bytes = _SHARE_OF_FREE * shutil.disk_usage(self.above).free
        return self.most_bytes

    def fetch(self, remote: Remote) -> tuple[Location, ...]:
        """The copies of a recording, each of which stays until it is `released`: of parts that do not follow one
        another there are several. Waits for room. Raises RecordingError.
        """
        identity = remote.identity
        if (located := self._reserve(identity, remote)) is not None:
            return located
        folder = None
        try:
            folder = self._new_folder()
            for stored_object in remote.objects:
                into = folder / _inside(stored_object.address.removeprefix(remote.above))
                into.parent.mkdir(parents=True, exist_ok=True)
                copy_object(_root(remote), stored_object, into, self.stopped)
            located = _located(folder, remote)
        except OSError as error:
            self._give_up(identity, folder)
            problem = f"no copy of it can be made in {self.above} ({error.strerror or error})"
            raise RecordingError(problem, where=remote.address, remedy="name another folder with --spool") from error
        except BaseException:
            self._give_up(identity, folder)
            raise
        with self._changed:
            self._copies[identity] = folder, located
            self._in_use[identity] = len(located)
            self._of_parts.update({one.remote.identity: identity for one in located if one.remote is not None})
            self._changed.notify_all()
        return located

    @contextmanager
    def copied(self, location: Location) -> Iterator[tuple[Location, ...]]:
        """A recording on disk inside the block, of an object store its copies. Raises RecordingError."""
        located = (location,) if location.remote is None else self.fetch(location.remote)
        try:
            yield located
        finally:
            for copy in located:
                self.release(copy)

    def release(self, location: Location) -> None:
        """Be done with a copy: it goes where there is no room for another."""
        if location.remote is None:
            return
        with self._changed:
            identity = self._of_parts.get(location.remote.identity, "")
            if identity in self._in_use:
                self._in_use[identity] -= 1
            self._changed.notify_all()

    def close(self) -> None:
        """Remove all copies; what is being copied is given up."""
        self.stopped.set()
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)

    def _reserve(self, identity: str, remote: Remote) -> tuple[Location, ...] | None:
        """The copies that there are, also where they were copied with others; without any wait until there is room for
        one, and keep it.

        Raises RecordingError where there will be none.
        """
        size = remote.size_bytes
        if size > self.room_bytes:
            raise RecordingError(
                f"its copy takes {size / _MB:.0f} MB, and copies in {self.above} may take {self.room_bytes / _MB:.0f}",
                where=remote.address,
                remedy="make room, name another folder with --spool, or allow more with --spool-limit",
            )
        with self._changed:
            while True:
                if self.stopped.is_set():
                    raise RecordingError("its copying was interrupted", where=remote.address)
                whole = self._of_parts.get(identity, identity)
                if whole in self._copies:
                    every = self._copies[whole][1]
                    located = tuple(one for one in every if one.remote is not None and one.remote.identity == identity)
                    self._in_use[whole] += len(located or every)
                    return located or every
                if identity not in self._sizes and sum(self._sizes.values()) + size <= self.room_bytes:
                    self._sizes[identity] = size
                    return None
                if identity in self._sizes or not self._evict():
                    self._changed.wait(_WAIT_S)

    def _evict(self) -> bool:
        """Remove the oldest copy that nobody reads; False where there is none."""
        for identity, (folder, _) in self._copies.items():
            if self._in_use[identity] <= 0:
                shutil.rmtree(folder, ignore_errors=True)
                self._forget(identity)
                return True
        return False

    def _give_up(self, identity: str, folder: Path | None) -> None:
        """Leave nothing of a copy that could not be made."""
        if folder is not None:
            shutil.rmtree(folder, ignore_errors=True)
        self._forget(identity)

    def _forget(self, identity: str) -> None:
        with self._changed:
            self._copies.pop(identity, None)
            self._sizes.pop(identity, None)
            self._in_use.pop(identity, None)
            self._of_parts = {part: whole for part, whole in self._of_parts.items() if whole != identity}
            self._changed.notify_all()

    def _new_folder(self) -> Path:
        with self._changed:
            if self._folder is None:
                self._folder, lock = _made(self.above)
                weakref.finalize(self, _remove, self._folder, lock, self.stopped)
            self._count += 1
            folder = self._folder / str(self._count)
            folder.mkdir()
            return folder


def spool_of(settings: MeasureSettings) -> Spool:
    """The spool that some settings ask for."""
    return Spool(settings.spool, None if settings.spool_limit is None else settings.spool_limit * _MB)


def copies_of(locations: Iterable[Location]) -> Iterator[Location | AuditorError]:
    """Each recording on disk, or why it could not be copied; a copy stays until the next one is asked for."""
    spool = Spool()
    for location in locations:
        try:
            with spool.copied(location) as copies:
                yield from copies
        except AuditorError as error:
            yield error
    spool.close()


def named_as_given(error: AuditorError, location: Location) -> AuditorError:
    """An error of a copy, as one of the recording that it is a copy of."""
    if location.remote is None:
        return error
    here, there = f"{location.path.parent}/", location.remote.above
    return type(error)(
        error.what.replace(here, there),
        where=error.where.replace(here, there),
        remedy=error.remedy.replace(here, there),
    )


def _located(folder: Path, remote: Remote) -> tuple[Location, ...]:
    """The recordings that the copies of some objects are. Raises RecordingError where they are none."""
    whole = folder / _inside(remote.address.removeprefix(remote.above))
    if whole.exists():
        return (Location(whole, remote=remote),)
    search = find_recordings(sorted(file for file in folder.iterdir() if not file.name.endswith(("-wal", "-shm"))))
    if not search.recordings:
        raise RecordingError(search.errors[0].what, where=remote.address)
    return tuple(replace(one, remote=_part_of(one, remote)) for one in search.recordings)


def _part_of(location: Location, remote: Remote) -> Remote:
    """What of a recording on an object store one of its copies is."""
    names = {file.name for stream in location.streams for file in stream} or {location.name}
    objects = tuple(one for one in remote.objects if one.address.removeprefix(remote.above) in names)
    return Remote(remote.above + location.name, objects)


def _root(remote: Remote) -> str:
    scheme, _, rest = remote.address.partition("://")
    return f"{scheme}://{rest.partition('/')[0]}"


def _inside(name: str) -> str:
    """A relative name, as a key may not be one. Raises RecordingError."""
    if name.startswith("/") or ".." in name.split("/"):
        raise RecordingError("its key is no name of a file", where=name)
    return name


def _made(above: Path) -> tuple[Path, int]:
    """A new folder for its owner alone, and what this process locks it by.

    Those whose processes are gone are removed.
    """
    above.mkdir(parents=True, exist_ok=True)
    for left in above.glob(f"{_PREFIX}*"):
        with suppress(OSError), _lock(left):
            shutil.rmtree(left, ignore_errors=True)
    folder = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=above))
    lock = os.open(folder, os.O_RDONLY)
    fcntl.flock(lock, fcntl.LOCK_SH)
    return folder, lock


def _remove(folder: Path, lock: int, stopped: threading.Event) -> None:
    stopped.set()
    shutil.rmtree(folder, ignore_errors=True)
    os.close(lock)


@contextmanager
def _lock(folder: Path) -> Iterator[None]:
    descriptor = os.open(folder, os.O_RDONLY | os.O_NOFOLLOW)
    try:
        if os.fstat(descriptor).st_uid == os.geteuid():
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            yield
        else:
            raise PermissionError
    finally:
        os.close(descriptor)
