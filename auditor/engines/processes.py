"""One task for each of many recordings, on the cores of one machine.

Every recording stands alone: one that cannot be read, or whose process dies, gives an error and the others go on.
"""

import multiprocessing
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from multiprocessing.queues import SimpleQueue
from typing import Any, Generic, TypeVar

from pebble import ProcessExpired, ProcessPool

from auditor.errors import AuditorError

Item = TypeVar("Item")
Result = TypeVar("Result")

Progress = Callable[[str, int], None]
"""Called with what is being done and how many frames are done."""

_POLL_S = 0.1

_progress_queue: (
    "SimpleQueue[tuple[int, str, int]]"  # set once in each worker process, where a task finds the way to its parent
)


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
) -> Iterator[Outcome[Item, Result]]:
    """Run `task` on every item, `jobs` at a time, and yield outcomes as they come.

    With one job everything happens in this process. An AuditorError belongs to its item; so does the death of a
    process. KeyboardInterrupt stops all workers and is raised.
    """
    if jobs == 1 or len(items) == 1:
        for item in items:
            yield _run_here(task, item, on_progress)
    else:
        yield from _run_in_processes(task, items, min(jobs, len(items)), on_progress)


def _run_here(
    task: Callable[[Item, Progress], Result], item: Item, on_progress: Callable[[Item, str, int], None]
) -> Outcome[Item, Result]:
    try:
        return Outcome(item, result=task(item, lambda what, done: on_progress(item, what, done)))
    except AuditorError as error:
        return Outcome(item, error=error)


def _run_in_processes(
    task: Callable[[Item, Progress], Result],
    items: Sequence[Item],
    jobs: int,
    on_progress: Callable[[Item, str, int], None],
) -> Iterator[Outcome[Item, Result]]:
    # Spawned, not forked: OpenCV's and Arrow's threads do not survive a fork.
    context = multiprocessing.get_context("spawn")
    # A simple queue is written before the task ends, so that no progress comes after the result.
    progress = context.SimpleQueue()
    with ProcessPool(max_workers=jobs, context=context, initializer=_start_worker, initargs=[progress]) as pool:
        futures: dict[Future[Any], Item] = {
            pool.schedule(_run_there, args=[task, item, index]): item for index, item in enumerate(items)
        }
        try:
            while futures:
                done, _ = wait(futures, timeout=_POLL_S, return_when=FIRST_COMPLETED)
                for index, what, count in _drain(progress):
                    on_progress(items[index], what, count)
                for future in done:
                    yield _outcome(future, futures.pop(future))
        finally:
            if futures:
                pool.stop()  # type: ignore[no-untyped-call]  # pebble annotates all but this
                pool.join()


def _outcome(future: Future[Result], item: Item) -> Outcome[Item, Result]:
    try:
        return Outcome(item, result=future.result())
    except AuditorError as error:
        return Outcome(item, error=error)
    except ProcessExpired as death:
        return Outcome(
            item,
            error=AuditorError(
                f"its process died (exit code {death.exitcode})",
                where=item,
                remedy="it may have run out of memory: run it again with --jobs 1",
            ),
        )


def _drain(progress: "SimpleQueue[tuple[int, str, int]]") -> Iterator[tuple[int, str, int]]:
    while not progress.empty():
        yield progress.get()


def _start_worker(progress: "SimpleQueue[tuple[int, str, int]]") -> None:
    global _progress_queue  # noqa: PLW0603 - a worker has no other place to keep it
    _progress_queue = progress
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which stops the workers


def _run_there(task: Callable[[Item, Progress], Result], item: Item, index: int) -> Result:
    return task(item, lambda what, done: _progress_queue.put((index, what, done)))
