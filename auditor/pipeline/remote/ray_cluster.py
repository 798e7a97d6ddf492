"""The engine Ray: groups of items, each a task on some machine of a cluster. The library is an extra.

A task that dies with its machine is run again by Ray. What a task gives it gives at its end: a half of it is never
taken for the whole.
"""

import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import chdir, contextmanager
from dataclasses import dataclass
from math import ceil
from typing import Any, TypeVar

from auditor.errors import AuditorError, SettingError, needing
from auditor.pipeline.workers import Outcome

Item = TypeVar("Item")
Result = TypeVar("Result")

_RETRIES = 5
_UNDER_WAY = 1000
"""So many tasks are handed over at most before one of them ends."""

_GROUP_BYTES = 256 << 20
"""Small items are one task together, up to so many bytes: a task takes some tens of milliseconds of its own."""

_TASKS_A_CORE = 4
_MB = 10**6


@dataclass(frozen=True)
class Needs:
    """What one task takes of a machine: a core, memory, and a GPU or none."""

    memory_mb: float
    gpu: bool = False


@contextmanager
def connected(address: str | None) -> Iterator["Cluster"]:
    """The cluster at an address inside the block, or the one that Ray finds or starts. Raises SettingError."""
    with needing("it needs", "ray", "--engine ray"):
        import ray  # noqa: PLC0415 - an extra
    if ray.is_initialized():
        yield Cluster(ray)
        return
    try:
        with chdir("/"):  # Ray lets workers import from the working folder, where logs of strangers may lie
            ray.init(address=address, log_to_driver=False, logging_level=logging.ERROR)
    except (ConnectionError, ValueError, RuntimeError, OSError) as error:
        raise SettingError(
            f"there is no cluster of Ray ({type(error).__name__})",
            where=address or "--engine ray",
            remedy="start one with ray start --head, or name it: --address HOST:PORT",
        ) from error
    try:
        yield Cluster(ray)
    finally:
        ray.shutdown()


class Cluster:
    """Machines of which Ray knows."""

    def __init__(self, ray: Any) -> None:  # noqa: ANN401 - a module
        self._ray = ray

    def groups(self, items: Sequence[Item], size_of: Callable[[Item], int]) -> list[list[Item]]:
        """Items that are one task each, in order; small ones together, as long as every core has some tasks."""
        cores = int(self._ray.cluster_resources().get("CPU", 1))
        most = ceil(len(items) / (_TASKS_A_CORE * max(cores, 1)))
        groups: list[list[Item]] = []
        room = 0
        for item in items:
            size = size_of(item)
            if not groups or size > room or len(groups[-1]) >= most:
                groups.append([])
                room = _GROUP_BYTES
            groups[-1].append(item)
            room -= size
        return groups

    def run(
        self,
        work: Callable[[Sequence[Item]], list[Outcome[int, Result]]],
        groups: Sequence[Sequence[Item]],
        needs: Needs,
    ) -> Iterator[Outcome[Item, Result]]:
        """Let machines work on groups, and yield what became of each item, which `work` names by its place.

        Raises SettingError where no machine has what is needed.
        """
        ray, waiting = self._ray, list(reversed(groups))
        self._refuse_small(needs)
        task = ray.remote(_done)
        task = task.options(
            num_cpus=1, num_gpus=int(needs.gpu), memory=int(needs.memory_mb * _MB), max_retries=_RETRIES
        )
        shared = ray.put(work)
        running: dict[Any, Sequence[Item]] = {}
        try:
            while running or waiting:
                while waiting and len(running) < _UNDER_WAY:
                    group = waiting.pop()
                    running[task.remote(shared, group)] = group
                for done in ray.wait(list(running), num_returns=1)[0]:
                    yield from self._outcomes(done, running.pop(done))
        finally:
            for left in running:
                ray.cancel(left, force=True)

    def _outcomes(self, done: Any, group: Sequence[Item]) -> Iterator[Outcome[Item, Result]]:  # noqa: ANN401 - Ray's
        try:
            outcomes = self._ray.get(done)
        except self._ray.exceptions.RayError as error:
            for item in group:
                yield Outcome(item, error=_told(error, item))
            return
        for outcome in outcomes:
            yield Outcome(group[outcome.item], outcome.result, outcome.error)

    def _refuse_small(self, needs: Needs) -> None:
        """A task that fits nowhere would wait for ever."""
        machines = [one["Resources"] for one in self._ray.nodes() if one["Alive"]]
        largest = max((one.get("memory", 0) for one in machines), default=0) / _MB
        if largest < needs.memory_mb:
            raise SettingError(
                f"no machine of the cluster has {needs.memory_mb:.0f} MB for a recording, the largest {largest:.0f}",
                where="--engine ray",
                remedy=f"--memory-limit {largest:.0f}, or larger machines",
            )
        if needs.gpu and not any(one.get("GPU") for one in machines):
            raise SettingError("no machine of the cluster has a GPU", where="--engine ray", remedy="--device cpu")


def _done(work: Callable[[Sequence[Item]], Result], group: Sequence[Item]) -> Result:
    return work(group)


def _told(error: Exception, item: object) -> AuditorError:
    """Why a task has no outcomes, as an error of one of its items."""
    cause = getattr(error, "cause", None)
    if isinstance(cause, AuditorError):
        return cause
    lost = f"its machine was lost, or ended its process, {_RETRIES + 1} times ({type(error).__name__})"
    problem = lost if cause is None else f"auditor failed on it: {type(cause).__name__}: {cause}"
    return AuditorError(problem, where=item, remedy="run the same command again to go on")
