"""Recordings that are measured, by processes of this machine or by tasks of a cluster."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import chdir, nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path

from auditor.model.settings import Engine, MeasureSettings
from auditor.pipeline.measure import measure_recording
from auditor.pipeline.measured import Measured, MeasureTask
from auditor.pipeline.remote.addresses import Address
from auditor.pipeline.remote.mirror import as_folder, place_of, synchronised
from auditor.pipeline.remote.ray_cluster import Needs, connected
from auditor.pipeline.remote.spool import Spool, named_as_given, spool_of
from auditor.pipeline.remote.supply import Supply
from auditor.pipeline.workers import Limits, Outcome, run_all, run_from
from auditor.recordings import Location
from auditor.store.log import run, this_program

_LimitsOf = Callable[[Path | Location | None], Limits]


def measure_here(
    tasks: Sequence[MeasureTask],
    jobs: int,
    limits_of: _LimitsOf,
    spool: Spool,
    on_progress: Callable[[object, str, int], None],
) -> Iterator[Outcome[MeasureTask, Measured]]:
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
    tasks: Sequence[MeasureTask], settings: MeasureSettings, limits_of: _LimitsOf
) -> Iterator[Outcome[MeasureTask, Measured]]:
    """Measure some recordings on the machines of a cluster, which write into the one store themselves.

    Every error names its recording. Raises SettingError where there is no such cluster.
    """
    folder, each = tasks[0].store, replace(settings, engine=Engine.PROCESSES, address=None, jobs=1)
    work = partial(_measure_there, each, limits_of, place_of(folder), this_program(), str(Path.cwd()))
    needs = Needs(settings.memory_limit, gpu=tasks[0].network.device != "cpu")
    synchronised(folder)
    with connected(settings.address) as cluster:
        yield from cluster.run(work, cluster.groups(tasks, _size_of), needs)
    synchronised(folder)


def _measure_there(
    settings: MeasureSettings,
    limits_of: _LimitsOf,
    place: Path | Address,
    command: Sequence[str],
    working: str,
    tasks: Sequence[MeasureTask],
) -> list[Outcome[int, Measured]]:
    """What a machine does with a group: it measures one recording after the other, each within its budgets."""
    with chdir(working) if Path(working).is_dir() else nullcontext(), as_folder(place) as folder, run(folder, command):
        here = [replace(one, store=folder, network=replace(one.network, threads=1)) for one in tasks]
        spool = spool_of(settings)
        outcomes = measure_here(here, settings.jobs, limits_of, spool, lambda *_: None)
        found = [Outcome(here.index(one.item.given or one.item), one.result, one.error) for one in outcomes]
        spool.close()
        return found


def _size_of(task: MeasureTask) -> int:
    try:
        return task.location.size_bytes
    except OSError:  # its own error, later on
        return 0
