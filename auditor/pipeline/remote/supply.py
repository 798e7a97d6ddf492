"""Work on recordings of object stores: the next ones are copied while others are read."""

import threading
from collections import deque
from collections.abc import Callable, Sequence
from typing import Generic, TypeVar

from auditor.errors import AuditorError
from auditor.pipeline.remote.spool import Spool
from auditor.pipeline.workers import Outcome
from auditor.recordings import Location

Item = TypeVar("Item")
_AHEAD = 2
"""Recordings that are copied and wait, a process."""


class Supply(Generic[Item]):
    """Some items, those of object stores copied ahead by threads of their own: a source of `workers.run_all`.

    `location_of` says where an item's recording lies, and `at` gives the item of a copy of it.
    """

    def __init__(
        self,
        items: Sequence[Item],
        spool: Spool,
        location_of: Callable[[Item], Location],
        at: Callable[[Item, Location], Item],
        jobs: int,
    ) -> None:
        self._location_of, self._at, self._spool, self._jobs = location_of, at, spool, jobs
        self._ready = deque[Item | Outcome[Item, object]]()
        self._waiting = deque[Item]()
        for item in items:
            (self._ready if location_of(item).remote is None else self._waiting).append(item)
        self._changed = threading.Condition()
        self._copying = 0
        self._local = len(self._ready)
        self._threads: list[threading.Thread] = []

    def take(self) -> Item | Outcome[Item, object] | None:
        """The next item that is there, or the outcome of one that could not be copied; None where none is yet."""
        with self._changed:
            if not self._threads:
                self._threads = [threading.Thread(target=self._copy, daemon=True) for _ in range(self._jobs)]
                for thread in self._threads:
                    thread.start()
            self._changed.notify_all()
            return self._ready.popleft() if self._ready else None

    def has_more(self) -> bool:
        """Whether there will be another item."""
        with self._changed:
            return bool(self._ready or self._waiting or self._copying)

    def done(self, item: Item) -> None:
        """An item has its outcome."""
        self._spool.release(self._location_of(item))

    def close(self) -> None:
        """Copy no more; what is being copied is given up."""
        with self._changed:
            if self._waiting or self._copying:
                self._spool.stopped.set()
            self._waiting.clear()
            self._changed.notify_all()

    def _copy(self) -> None:
        while (item := self._next()) is not None:
            remote = self._location_of(item).remote
            assert remote is not None, "what is on disk is not copied"
            found: list[Item | Outcome[Item, object]]
            try:
                found = [self._at(item, one) for one in self._spool.fetch(remote)]
            except AuditorError as error:
                found = [Outcome(item, error=error)]
            except Exception as error:  # noqa: BLE001 - whatever it is: who waits for the item would wait for ever
                what = f"auditor failed to copy it: {type(error).__name__}: {error}"
                remedy = "this is a defect of auditor: please report this line"
                found = [Outcome(item, error=AuditorError(what, where=item, remedy=remedy))]
            with self._changed:
                self._ready.extend(found)
                self._copying -= 1

    def _next(self) -> Item | None:
        """The next item to copy, once not too many wait; None at the end."""
        with self._changed:
            while self._waiting and len(self._ready) >= self._local + _AHEAD * self._jobs:
                self._changed.wait()
            if not self._waiting or self._spool.stopped.is_set():
                return None
            self._copying += 1
            return self._waiting.popleft()
