"""Tasks in processes of their own: several at a time, each within its limits, each with an outcome of its own.

A task reports its progress through a pipe. The parent reads it, checks every running process against its limits of
memory and of silence, and kills what exceeds them; the system's timer ends a process at its limit of time, to the
moment. An error, or the death of a process, is the outcome of its task alone.
"""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.connection import wait as wait_for
from multiprocessing.context import ForkServerContext
from pathlib import Path
from time import monotonic
from traceback import extract_tb
from typing import Any, Generic, TypeVar

from pebble import ProcessExpired, ProcessPool

from auditor.errors import AuditorError, LimitError
from auditor.store.log import Run, adopt, current_runs

MEMORY_MB = 4096
"""Memory that one task may take by default."""

SILENT_S = 600.0
"""Time that a task without a time limit may take between two signs of progress."""

SECONDS_A_MB = 0.1
"""Reading at 10 MB/s: what must be read before the first frame comes may be as large as the recording."""

Item = TypeVar("Item")
Result = TypeVar("Result")

Progress = Callable[[str, int], None]
"""Called with what is being done and how many frames are done; with none done yet, it is a remark for people."""

_POLL_S = 0.1
_ENDING = (signal.SIGINT, signal.SIGTERM)
_PRELOADED = ["auditor.pipeline.warm"]
_LONGEST_WHAT = 200
"""A message of progress must fit into a pipe at once: then processes that share it need no lock, and one that is killed
can leave none behind."""

_progress_pipe: "Connection[Any, Any]"  # set once in each worker process: the way to its parent


@dataclass(frozen=True)
class Limits:
    """Budgets of one task: `memory_mb` of its process, `seconds` in all, `silent_s` without any progress.

    None stands for no limit.
    """

    memory_mb: float | None = None
    seconds: float | None = None
    silent_s: float | None = None

    def exceeded(self, *, memory_mb: float, silent_s: float) -> str:
        """Which budget a running task is over, as a sentence; empty where it is within all of them."""
        if self.memory_mb is not None and memory_mb > self.memory_mb:
            return f"it took more than {self.memory_mb:.0f} MB of memory and was ended"
        if self.silent_s is not None and silent_s > self.silent_s:
            return f"it made no progress for {self.silent_s:.0f} s and was ended"
        return ""


def limits_of(size_bytes: int, *, seconds: float | None = None, memory_mb: float = MEMORY_MB) -> Limits:
    """The budgets of one recording of a size; without `seconds`, time is not limited while it makes progress."""
    silent_s = SILENT_S + SECONDS_A_MB * size_bytes / 1e6
    return Limits(memory_mb, seconds, None if seconds is not None else silent_s)


def memory_mb(pid: int) -> float:
    """The memory of a process; 0 where it is gone, or the system does not say."""
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return 0.0
    _, found, rest = status.partition("VmRSS:")
    return int(rest.split()[0]) / 1024 if found else 0.0


@dataclass(frozen=True)
class Outcome(Generic[Item, Result]):
    """What became of one item: a result, or the error that ended it."""

    item: Item
    result: Result | None = None
    error: AuditorError | None = None


def run_all(
    task: Callable[[Item, Progress], Result],
    items: Sequence[Item],
    jobs: int,
    on_progress: Callable[[Item, str, int], None],
    limits: Callable[[Item], Limits] | None = None,
) -> Iterator[Outcome[Item, Result]]:
    """Run `task` on every item, `jobs` at a time, and yield outcomes as they come.

    With `limits` each item has a process that is killed where it takes more. Without them one job alone happens in
    this process. Any error belongs to its item; so does the death of a process. KeyboardInterrupt stops all workers and
    is raised.
    """
    if limits is None and (jobs == 1 or len(items) == 1):
        for item in items:
            yield _run_here(task, item, on_progress)
    elif items:
        yield from _Run(task, items, min(jobs, len(items)), on_progress, limits or (lambda _: Limits())).outcomes()


@dataclass(frozen=True)
class _Call(Generic[Result]):
    """A function with its arguments, the first of which names it for people; both must be such as can be pickled."""

    function: Callable[..., Result]
    arguments: tuple[object, ...]

    def __str__(self) -> str:
        return str(self.arguments[0])


def _call(call: _Call[Result], _: Progress) -> Result:
    return call.function(*call.arguments)


def run_within(limits: Limits, function: Callable[..., Result], *arguments: object) -> Result:
    """The result of a function of a module, in a process of its own that is killed where it takes more.

    The first argument is the recording or file that errors name. Raises what the function raises of ours, LimitError
    where it takes more, and AuditorError where its process dies.
    """
    [outcome] = run_all(_call, [_Call(function, arguments)], 1, lambda *_: None, lambda _: limits)
    if outcome.error is not None:
        raise outcome.error
    return outcome.result  # type: ignore[return-value]  # None only where the function returns None


def _run_here(
    task: Callable[[Item, Progress], Result], item: Item, on_progress: Callable[[Item, str, int], None]
) -> Outcome[Item, Result]:
    try:
        return Outcome(item, result=_run(task, item, lambda what, done: on_progress(item, what, done)))
    except AuditorError as error:
        return Outcome(item, error=error)


@dataclass
class _Running:
    """A task that a worker process has begun."""

    pid: int
    last_sign_s: float
    ended: str = ""


class _Run(Generic[Item, Result]):
    """One call of run_all with worker processes."""

    def __init__(
        self,
        task: Callable[[Item, Progress], Result],
        items: Sequence[Item],
        jobs: int,
        on_progress: Callable[[Item, str, int], None],
        limits: Callable[[Item], Limits],
    ) -> None:
        self._task = task
        self._items = items
        self._jobs = jobs
        self._on_progress = on_progress
        self._limits = [limits(item) for item in items]
        self._running: dict[int, _Running] = {}

    def outcomes(self) -> Iterator[Outcome[Item, Result]]:
        context = _context()
        reader, writer = context.Pipe(duplex=False)
        with (
            reader,
            writer,
            # A process for each task: what one leaves in memory does not count for the next.
            ProcessPool(
                max_workers=self._jobs,
                max_tasks=1,
                context=context,
                initializer=_start_worker,
                initargs=[writer, current_runs()],
            ) as pool,
        ):
            futures: dict[Future[Any], int] = {}
            try:
                with _uninterrupted():  # a worker that is half started would never be stopped
                    for index in range(len(self._items)):
                        futures[pool.schedule(_run_there, args=self._arguments(index))] = index
                while futures:
                    done, _ = wait(futures, timeout=_POLL_S, return_when=FIRST_COMPLETED)
                    self._receive(reader)
                    for future in done:
                        yield self._outcome(future, futures.pop(future))
                    self._end_those_over_budget()
            finally:
                if futures:
                    with _uninterrupted():
                        _stop(pool)

    def _arguments(self, index: int) -> list[object]:
        return [self._task, self._items[index], index, self._limits[index].seconds]

    def _receive(self, reader: "Connection[Any, Any]") -> None:
        while reader.poll():
            index, pid, what, count = reader.recv()
            now = monotonic()
            if index not in self._running:
                self._running[index] = _Running(pid, now)
            else:
                self._running[index].last_sign_s = now
                self._on_progress(self._items[index], what, count)

    def _end_those_over_budget(self) -> None:
        for index, running in self._running.items():
            running.ended = running.ended or self._limits[index].exceeded(
                memory_mb=memory_mb(running.pid), silent_s=monotonic() - running.last_sign_s
            )
            if running.ended:
                with suppress(ProcessLookupError):
                    os.kill(running.pid, signal.SIGKILL)

    def _outcome(self, future: Future[Result], index: int) -> Outcome[Item, Result]:
        item, running = self._items[index], self._running.pop(index, None)
        try:
            return Outcome(item, result=future.result())
        except AuditorError as error:
            return Outcome(item, error=error)
        except ProcessExpired as death:
            ended = running.ended if running is not None else ""
            if death.exitcode == -signal.SIGALRM:
                ended = f"it took longer than {self._limits[index].seconds:g} s and was ended"
            if ended:
                remedy = "if it is to be trusted, give it more with --time-limit or --memory-limit"
                return Outcome(item, error=LimitError(ended, where=item, remedy=remedy))
            what = f"its process died (exit code {death.exitcode})"
            remedy = "it may have run out of memory: run it again with --jobs 1"
            return Outcome(item, error=AuditorError(what, where=item, remedy=remedy))


def _stop(pool: ProcessPool) -> None:
    """End the workers and then the pool.

    Pebble removes the locks of its channels first, and a worker that was just forked complains that it finds none.
    """
    pool.stop()  # type: ignore[no-untyped-call]  # pebble annotates all but this
    if pool._pool_manager_loop is not None:
        pool._pool_manager_loop.join()  # which would start others
        pool._pool_manager.worker_manager.force_stop_workers()  # type: ignore[no-untyped-call]
    pool.join()


def _context() -> ForkServerContext:
    """Processes are forked from one that has imported everything and used nothing.

    OpenCV's and Arrow's threads do not survive a fork once they run; a fresh interpreter for each would import for a
    second.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(_PRELOADED)
    # Ctrl-C is for this process, which stops the workers; they inherit that it is blocked.
    resource_tracker.ensure_running()  # started later, it would lift the block
    with _uninterrupted():
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            forkserver.ensure_running()
        finally:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    return context


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Ctrl-C and SIGTERM inside the block count at its end; only the main thread gets them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    before = {each: signal.signal(each, lambda number, _: came.append(number)) for each in _ENDING}
    try:
        yield
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)
    for number in came[:1]:
        signal.raise_signal(number)  # what a shell starts in the background ignores Ctrl-C


def _start_worker(progress: "Connection[Any, Any]", runs: Sequence[Run]) -> None:
    global _progress_pipe  # noqa: PLW0603 - a worker has no other place to keep it
    _progress_pipe = progress
    adopt(runs)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """A worker whose parent was killed has no use for its result."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait_for([parent.sentinel])
    os._exit(1)


def _run_there(task: Callable[[Item, Progress], Result], item: Item, index: int, seconds: float | None) -> Result:
    pid = os.getpid()
    if seconds is not None:
        signal.signal(signal.SIGALRM, signal.SIG_DFL)  # it ends the process, in the middle of a native call too
        signal.setitimer(signal.ITIMER_REAL, seconds)
    _progress_pipe.send((index, pid, "", 0))
    return _run(task, item, lambda what, done: _progress_pipe.send((index, pid, what[:_LONGEST_WHAT], done)))


def _run(task: Callable[[Item, Progress], Result], item: Item, progress: Progress) -> Result:
    """Run the task; an unforeseen error is its item's error, too, in one line that can be reported."""
    try:
        return task(item, progress)
    except AuditorError:
        raise
    except Exception as error:
        last = extract_tb(error.__traceback__)[-1]
        where = "/".join(Path(last.filename).parts[-2:])
        what = f"auditor failed on it: {type(error).__name__}: {error} ({where}:{last.lineno})"
        raise AuditorError(what, where=item, remedy="this is a defect of auditor: please report this line") from error
