"""Tasks in processes of their own: several at a time, each within its limits, each with an outcome of its own.

A task reports its progress and its end through a pipe that nobody else writes. The parent reads it, checks every
running process against its limits of memory and of silence, and kills what exceeds them; the system's timer ends a
process at its limit of time, to the moment. An error, or the death of a process at any moment, is the outcome of its
task alone: no lock is shared that it could hold, and a pipe that closes without an end says that it died.
"""

import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.connection import wait as wait_for
from pathlib import Path
from time import monotonic
from traceback import extract_tb
from typing import Any, Generic, Protocol, TypeVar

from auditor.errors import AuditorError, LimitError
from auditor.model.settings import MeasureSettings
from auditor.pipeline.fork_server import Worker, fork
from auditor.recordings.location import Location
from auditor.store.log.runs import Run, adopt, current_runs

MEMORY_MB = MeasureSettings.memory_limit
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


LimitsOf = Callable[[Path | Location | None], Limits]
"""The budgets of a recording at a path; of what is made here where there is None."""


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
    _, label, rest = status.partition("VmRSS:")
    return int(rest.split()[0]) / 1024 if label else 0.0


@dataclass(frozen=True)
class Outcome(Generic[Item, Result]):
    """What became of one item: a result, or the error that ended it."""

    item: Item
    result: Result | None = None
    error: AuditorError | None = None


class ItemSource(Protocol[Item]):
    """Items that come to be there one after the other."""

    def take(self) -> "Item | Outcome[Item, Any] | None":
        """The next item that is there, or the outcome of one that cannot be; None where none is there yet."""

    def has_more(self) -> bool:
        """Whether there will be another one."""

    def done(self, item: Item) -> None:
        """Called when an item has its outcome."""

    def close(self) -> None:
        """Called when no more are taken."""


class _ItemList(Generic[Item]):
    """Items that are all there."""

    def __init__(self, items: Sequence[Item]) -> None:
        self._items = deque(items)

    def take(self) -> Item | None:
        return self._items.popleft() if self._items else None

    def has_more(self) -> bool:
        return bool(self._items)

    def done(self, item: Item) -> None:
        """Nothing is held for it."""

    def close(self) -> None:
        self._items.clear()


def run_from(
    source: ItemSource[Item],
    task: Callable[[Item, Progress], Result],
    jobs: int,
    on_progress: Callable[[Item, str, int], None],
    limits: Callable[[Item], Limits],
) -> Iterator[Outcome[Item, Result]]:
    """As `run_all` with limits, of items that come to be there one after the other."""
    return _Run(task, source, jobs, on_progress, limits).outcomes()


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
            yield _outcome(task, item, partial(on_progress, item))
    elif items:
        own = {id(item): limits(item) if limits else Limits() for item in items}
        yield from run_from(_ItemList(items), task, min(jobs, len(items)), on_progress, lambda item: own[id(item)])


def in_order(task: Callable[[Item, Progress], Result], items: Sequence[Item], jobs: int) -> Iterator[Result]:
    """As `run_all`, the results of items in their order. Raises what one of them raises."""
    results: dict[Item, Result] = {}
    left = deque(items)
    for outcome in run_all(task, items, jobs, lambda *_: None):
        if outcome.error is not None:
            raise outcome.error
        results[outcome.item] = outcome.result  # type: ignore[assignment]  # None only where the task gives it
        while left and left[0] in results:
            yield results.pop(left.popleft())


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


@dataclass
class _Running(Generic[Item]):
    """A task that a process works on."""

    item: Item
    limits: Limits
    worker: Worker
    last_sign_s: float
    ended: str = ""

    def end_if_over_budget(self) -> None:
        self.ended = self.ended or self.limits.exceeded(
            memory_mb=memory_mb(self.worker.pid), silent_s=monotonic() - self.last_sign_s
        )
        if self.ended:
            self.worker.kill()

    def death(self) -> AuditorError:
        """Why the process ended before its task did."""
        code = self.worker.exit_code()
        too_long = code == -signal.SIGALRM
        ended = f"it took longer than {self.limits.seconds:g} s and was ended" if too_long else self.ended
        if ended:
            remedy = "if it is to be trusted, give it more with --time-limit or --memory-limit"
            return LimitError(ended, where=self.item, remedy=remedy)
        problem = f"its process died (exit code {code})"
        remedy = "it may have run out of memory: run it again with --jobs 1"
        return AuditorError(problem, where=self.item, remedy=remedy)

    def stop(self) -> None:
        self.worker.kill()
        self.worker.exit_code()
        self.worker.pipe.close()


class _Run(Generic[Item, Result]):
    """One call of run_all with a process for each task: what one leaves in memory does not count for the next."""

    def __init__(
        self,
        task: Callable[[Item, Progress], Result],
        source: ItemSource[Item],
        jobs: int,
        on_progress: Callable[[Item, str, int], None],
        limits: Callable[[Item], Limits],
    ) -> None:
        self._task = task
        self._source, self._limits = source, limits
        self._failed: list[Outcome[Item, Result]] = []
        self._jobs = jobs
        self._on_progress = on_progress
        self._running: dict[Connection[Any, Any], _Running[Item]] = {}

    def outcomes(self) -> Iterator[Outcome[Item, Result]]:
        try:
            self._start()
            while self._running or self._failed or self._source.has_more():
                wait_for([*self._running], 0 if self._failed else _POLL_S)
                outcomes = [outcome for pipe in [*self._running] if (outcome := self._receive(pipe))]
                self._start()  # before whoever asks takes their time with the outcomes
                outcomes += self._failed
                self._failed = []
                yield from outcomes
                for running in self._running.values():
                    running.end_if_over_budget()
        finally:
            self._source.close()
            with _uninterrupted():
                for running in self._running.values():
                    running.stop()

    def _start(self) -> None:
        while len(self._running) < self._jobs and (item := self._source.take()) is not None:
            if isinstance(item, Outcome):
                self._failed.append(item)
                continue
            limits = self._limits(item)
            with _uninterrupted():  # a process that is half started would never be stopped
                worker = _forked(_work, current_runs(), self._task, item, limits.seconds)
                self._running[worker.pipe] = _Running(item, limits, worker, monotonic())

    def _receive(self, pipe: "Connection[Any, Any]") -> Outcome[Item, Result] | None:
        """Read what a process has sent; its outcome, where it has come to its end."""
        running = self._running[pipe]
        while pipe.poll():
            try:
                sent = pipe.recv()
            except (EOFError, OSError):  # in the middle of a message, too
                sent = Outcome(running.item, error=running.death())
            if isinstance(sent, Outcome):
                del self._running[pipe]
                running.stop()
                self._source.done(running.item)
                return replace(sent, item=running.item)
            running.last_sign_s = monotonic()
            self._on_progress(running.item, *sent)
        return None


def _forked(work: Callable[..., None], *arguments: object) -> Worker:
    try:
        return fork(work, *arguments)
    except OSError as error:
        problem = f"no process could be started ({error.strerror or error})"
        raise AuditorError(problem, remedy="free memory or processes of this user, and run it again") from error


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


def _work(
    pipe: "Connection[Any, Any]",
    runs: Sequence[Run],
    task: Callable[[Item, Progress], Result],
    item: Item,
    seconds: float | None,
) -> None:
    """What a process does: it sends its progress, and at last an outcome."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    adopt(runs)
    if seconds is not None:
        signal.signal(signal.SIGALRM, signal.SIG_DFL)  # it ends the process, in the middle of a native call too
        signal.setitimer(signal.ITIMER_REAL, seconds)
    outcome = _outcome(task, item, lambda what, done: pipe.send((what, done)))
    with suppress(ConnectionError):  # whoever asked was killed
        pipe.send(Outcome(None, outcome.result, outcome.error))  # the parent has the item


def _outcome(task: Callable[[Item, Progress], Result], item: Item, progress: Progress) -> Outcome[Item, Result]:
    """Run the task; an unforeseen error is its item's error, too, in one line that can be reported."""
    try:
        return Outcome(item, result=task(item, progress))
    except AuditorError as error:
        return Outcome(item, error=error)
    except Exception as error:  # noqa: BLE001 - it is the outcome of its item, and said in full
        last = extract_tb(error.__traceback__)[-1]
        where = "/".join(Path(last.filename).parts[-2:])
        problem = f"auditor failed on it: {type(error).__name__}: {error} ({where}:{last.lineno})"
        remedy = "this is a defect of auditor: please report this line"
        return Outcome(item, error=AuditorError(problem, where=item, remedy=remedy))
