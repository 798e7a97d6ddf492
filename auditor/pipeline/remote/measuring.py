"""Measuring of recordings here or on a cluster, those of object stores while others of them are copied."""

import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import chdir, nullcontext
from dataclasses import replace
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import Generic, TypeVar

from auditor.errors import AuditorError
from auditor.model.settings import Engine, MeasureSettings
from auditor.pipeline.measure import measure_recording
from auditor.pipeline.measured import MeasureResult, MeasureTask
from auditor.pipeline.remote.addresses import Address
from auditor.pipeline.remote.mirror import as_folder, place_of, synchronised
from auditor.pipeline.remote.ray_cluster import Needs, connected
from auditor.pipeline.remote.spool import Spool, named_as_given, spool_of
from auditor.pipeline.workers import Limits, LimitsOf, Outcome, run_all, run_from
from auditor.recordings import Location
from auditor.store.log.entry import this_program
from auditor.store.log.runs import run

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
            copies: list[Item | Outcome[Item, object]]
            try:
                copies = [self._at(item, one) for one in self._spool.fetch(remote)]
            except AuditorError as error:
                copies = [Outcome(item, error=error)]
            except Exception as error:  # noqa: BLE001 - whatever it is: who waits for the item would wait for ever
                problem = f"auditor failed to copy it: {type(error).__name__}: {error}"
                remedy = "this is a defect of auditor: please report this line"
                copies = [Outcome(item, error=AuditorError(problem, where=item, remedy=remedy))]
            with self._changed:
                self._ready.extend(copies)
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


def measure_here(
    tasks: Sequence[MeasureTask],
    jobs: int,
    limits_of: LimitsOf,
    spool: Spool,
    on_progress: Callable[[object, str, int], None],
) -> Iterator[Outcome[MeasureTask, MeasureResult]]:
    """Measure some recordings, each in a process of its own; those of object stores while the next ones are copied.

    Every error names its recording.
    """

    def limits(task: MeasureTask) -> Limits:
        return limits_of(task.recording)

    if all(task.location.remote is None for task in tasks):
        outcomes = run_all(measure_recording, tasks, jobs, on_progress, limits)
    else:
        supply = Supply(tasks, spool, lambda task: task.location, MeasureTask.at, jobs)
        outcomes = run_from(supply, measure_recording, jobs, on_progress, limits)
    for outcome in outcomes:
        error = outcome.error.located(outcome.item) if outcome.error is not None else None
        yield replace(outcome, error=named_as_given(error, outcome.item.location) if error is not None else None)


def measure_on_cluster(
    tasks: Sequence[MeasureTask], settings: MeasureSettings, limits_of: LimitsOf
) -> Iterator[Outcome[MeasureTask, MeasureResult]]:
    """Measure some recordings on the machines of a cluster, which write into the one store themselves.

    Every error names its recording. Raises SettingError where there is no such cluster.
    """
    folder, each = tasks[0].store, replace(settings, engine=Engine.PROCESSES, address=None, jobs=1)
    work = partial(_measure_there, each, limits_of, place_of(folder), this_program(), str(Path.cwd()))
    needs = Needs(settings.memory_limit, gpu=tasks[0].network.device != "cpu")
    synchronised(folder)
    with connected(settings.address) as cluster:
        yield from cluster.run(work, cluster.groups(tasks, attrgetter("size_bytes")), needs)
    synchronised(folder)


def _measure_there(
    settings: MeasureSettings,
    limits_of: LimitsOf,
    place: Path | Address,
    command: Sequence[str],
    working: str,
    tasks: Sequence[MeasureTask],
) -> list[Outcome[int, MeasureResult]]:
    """What a machine does with a group: it measures one recording after the other, each within its budgets."""
    with chdir(working) if Path(working).is_dir() else nullcontext(), as_folder(place) as folder, run(folder, command):
        here = [replace(one, store=folder, network=replace(one.network, threads=1)) for one in tasks]
        spool = spool_of(settings)
        outcomes = measure_here(here, settings.jobs, limits_of, spool, lambda *_: None)
        results = [Outcome(here.index(one.item.given or one.item), one.result, one.error) for one in outcomes]
        spool.close()
        return results
