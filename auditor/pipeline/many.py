"""Many recordings: found, and measured side by side. What went wrong with one is a value of its own."""

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import chain
from pathlib import Path

from auditor.errors import AuditorError, LimitError, RecordingError, RigError, SettingError
from auditor.measurement.disparity.matchers import MatcherOptions, find_matcher
from auditor.model.settings import Engine, MeasureSettings, settings_of
from auditor.pipeline.measured import KnownFiles, MeasureResult, MeasureTask
from auditor.pipeline.remote.addresses import Address
from auditor.pipeline.remote.finding import find_all, shard_of
from auditor.pipeline.remote.measuring import measure_here, measure_on_cluster
from auditor.pipeline.remote.spool import Spool, spool_of
from auditor.pipeline.workers import MEMORY_MB, Limits, LimitsOf, Outcome, limits_of
from auditor.recordings import Location, Origin, check_rig_file, located
from auditor.store.log.chains import is_mirror
from auditor.store.store import Store

MOST_KNOWN = 50
"""So many recordings of one batch are each shown, though they may be known; of more only those that are new."""


def limits_by_size(time_limit_s: float | None = None, memory_limit_mb: float = MEMORY_MB) -> LimitsOf:
    """The budgets of each recording: without a time limit they depend on its size. What is made here has no path."""

    def limits(where: Path | Location | None) -> Limits:
        size_bytes = located(where).size_bytes if where is not None else 0
        return limits_of(size_bytes, seconds=time_limit_s, memory_mb=memory_limit_mb)

    return limits


def network_of(settings: MeasureSettings) -> MatcherOptions:
    """What the matcher of some settings is told, if it is a network."""
    told = {one.name for one in fields(MatcherOptions)} & settings_of(MeasureSettings).keys()
    return MatcherOptions(**{name: getattr(settings, name) for name in told})


@dataclass(frozen=True)
class Batch:
    """Recordings to be measured into a store, None where there are none, and an error for each path that holds none.

    `limits` are those of each recording. `notes` are files of text beside recordings, which are none; `remarks` are
    sentences on all of them.
    """

    tasks: tuple[MeasureTask, ...]
    errors: tuple[RecordingError, ...]
    settings: MeasureSettings
    limits: LimitsOf
    store: Store | None = None
    notes: tuple[Path, ...] = ()
    spool: Spool = field(default_factory=Spool)
    remarks: tuple[str, ...] = ()

    @property
    def remote(self) -> tuple[MeasureTask, ...]:
        """What lies on object stores."""
        return tuple(task for task in self.tasks if task.location.remote is not None)

    @property
    def shows_known(self) -> bool:
        """Whether recordings that are known are named, pictured and shown as new ones are; of many they are counted."""
        return len(self.tasks) <= MOST_KNOWN


def find_batch(
    given: Sequence[Path | Address], store: Path, settings: MeasureSettings, limits: LimitsOf | None = None
) -> Batch:
    """Find the recordings at some paths and addresses, in the order given, paths first; make the store where there are
    any. Of a shard only its own are found.

    `limits` take the place of those of the settings. Raises SettingError for an unknown matcher or an origin that
    cannot be read, RigError for a rig file that cannot be read, and StoreError: these are errors of the whole command,
    not of each recording.
    """
    network = network_of(settings)
    find_matcher(settings.matcher, network)
    if settings.rig:
        check_rig_file(settings.rig)
    if settings.shard is not None:
        shard_of(settings.shard)
    if settings.address is not None and settings.engine is not Engine.RAY:
        raise SettingError("only a cluster has an address", where="--address", remedy="add --engine ray")
    limits = limits or limits_by_size(settings.time_limit, settings.memory_limit)
    search = find_all(given)
    recordings = _of_shard(search.recordings, settings.shard)
    if not recordings:
        return Batch((), search.errors, settings, limits, notes=search.notes)
    kept = Store.open(store, create=True)
    if settings.measure_again and is_mirror(kept.folder):
        raise SettingError(
            "what is measured stays: others may have judged by it",
            where="--measure-again",
            remedy="measure into another store",
        )
    network, jobs = share_threads(network, min(settings.jobs, len(recordings)))
    tasks = tuple(
        MeasureTask(
            location,
            store,
            settings.matcher,
            network,
            settings.rig,
            Origin(settings.vehicle, drive=settings.drive, weather=settings.weather),
            settings.path_pattern,
            again=settings.measure_again,
            pictures=settings.pictures,
            cells=settings.cells,
        )
        for location in recordings
    )
    for task in tasks:
        task.declared()  # what it raises is an error of the whole command
    remarks = tuple(_of_pattern(tasks, settings.path_pattern))
    settings = replace(settings, jobs=jobs)
    return Batch(tasks, search.errors, settings, limits, kept, search.notes, spool_of(settings), remarks)


def _of_pattern(tasks: Sequence[MeasureTask], pattern: str | None) -> Iterator[str]:
    """That a pattern says nothing of any recording, where it does not."""
    if pattern and all(Origin.of_path(task.location.given, pattern) == Origin() for task in tasks):
        paths = f"the path {tasks[0].location.given}" if len(tasks) == 1 else f"any of the {len(tasks)} paths"
        yield f"path pattern {pattern!r}: it does not fit {paths}, and says no vehicle or date"


def _of_shard(recordings: Sequence[Location], text: str | None) -> Sequence[Location]:
    """Those of some recordings that belong to a shard, by their places; all of them without one."""
    shard = shard_of(text) if text is not None else None
    return recordings if shard is None else [one for one in recordings if shard.has(one.place)]


def share_threads(network: MatcherOptions, jobs: int) -> tuple[MatcherOptions, int]:
    """How many processes match side by side: the CPU's threads are shared among them, a GPU is not."""
    if network.device != "cpu":
        return network, 1
    return replace(network, threads=max(1, len(os.sched_getaffinity(0)) // jobs)), jobs


def known_files(batch: Batch) -> KnownFiles:
    """Which files of a batch its store knows, and need not be read."""
    again = batch.settings.measure_again or batch.settings.verify_content
    return KnownFiles(batch.tasks, batch.store, read_again=again)


def measure_all(
    batch: Batch, on_progress: Callable[[object, str, int], None]
) -> Iterator[Outcome[MeasureTask, MeasureResult]]:
    """Measure the recordings of a batch and yield their outcomes as they finish; every error names its recording.

    What was measured before comes first, unread where its files are as they were then. `on_progress` is called with the
    recording, what is being done, and the number of frames done.
    """
    settings, unknown = batch.settings, []
    for task, result in chain.from_iterable(map(known_files(batch).found, batch.tasks)):
        if result is None:
            unknown.append(task)
        else:
            yield Outcome(task, result)
    if unknown and settings.engine is Engine.RAY:
        yield from measure_on_cluster(unknown, settings, batch.limits)
    else:
        yield from measure_here(unknown, settings.jobs, batch.limits, batch.spool, on_progress)


def was_examined(error: AuditorError) -> bool:
    """True where a recording could be read but not audited, or took too much: the error says what is missing."""
    return isinstance(error, RigError | LimitError)
