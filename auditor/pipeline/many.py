"""Many recordings: found, measured side by side, judged. What went wrong with one is a value of its own."""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from itertools import chain
from pathlib import Path

from auditor.errors import AuditorError, LimitError, RecordingError, RigError, SettingError
from auditor.measurement.disparity.matchers import MatcherOptions, find_matcher
from auditor.model.calibration import Calibration
from auditor.model.rig import Rig
from auditor.model.rig_kind import ComparedTo
from auditor.model.settings import Criteria, Engine, MeasureSettings, settings_of
from auditor.model.verdict import JudgedBy, Method
from auditor.pipeline.judge import (
    fitting_calibration,
    judge_measurement,
    measured_rigs,
    prior_for,
    refuse_earlier_counting,
    rigs_in_turn,
)
from auditor.pipeline.measured import FEW, MOST_KNOWN, KnownFiles, Measured, MeasureTask, is_as_now
from auditor.pipeline.reading import frames_not_audited, looks_again, reading_of, views_not_compared
from auditor.pipeline.remarks import UsualRigs, as_a_part, conflicts_of, counted_elsewhere, marked, unresolved
from auditor.pipeline.remote.addresses import Address
from auditor.pipeline.remote.finding import find_all, shard_of
from auditor.pipeline.remote.measuring import measure_here, measure_on_cluster
from auditor.pipeline.remote.spool import Spool, spool_of
from auditor.pipeline.workers import MEMORY_MB, Limits, Outcome, limits_of
from auditor.recordings import Location, Origin, check_rig_file, located
from auditor.store import RecordingRecord, Store, StoredJudgement, StoredMeasurement
from auditor.store.log import logged
from auditor.store.log.chains import is_mirror
from auditor.store.versions.history import histories, in_force_of
from auditor.store.versions.records import lost_line, lost_versions, provisional_of

_NO_THRESHOLDS_GAP = "no thresholds for its rig kind and matcher"
_PROVISIONAL = (
    "its calibration is provisional: nobody named its recordings clean, or they are too few (calibration promote "
    "confirms it)"
)
_NO_THRESHOLDS = (
    "measured, but not judged: the store has no thresholds for its rig kind and matcher; "
    "make some from clean recordings with auditor calibrate"
)

LimitsOf = Callable[[Path | Location | None], Limits]
"""The budgets of a recording at a path; of what is made here where there is None."""

# Measuring


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

    `limits` are those of each recording. `notes` are files of text beside recordings, which are none.
    """

    tasks: tuple[MeasureTask, ...]
    errors: tuple[RecordingError, ...]
    settings: MeasureSettings
    limits: LimitsOf
    store: Store | None = None
    notes: tuple[Path, ...] = ()
    spool: Spool = field(default_factory=Spool)

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
    found = find_all(given)
    recordings = _of_shard(found.recordings, settings.shard)
    if not recordings:
        return Batch((), found.errors, settings, limits, notes=found.notes)
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
    return Batch(tasks, found.errors, replace(settings, jobs=jobs), limits, kept, found.notes, spool_of(settings))


def _of_shard(recordings: Sequence[Location], text: str | None) -> Sequence[Location]:
    """Those of some recordings that belong to a shard, by their places; all of them without one."""
    shard = shard_of(text) if text is not None else None
    return recordings if shard is None else [one for one in recordings if shard.has(one.place)]


def share_threads(network: MatcherOptions, jobs: int) -> tuple[MatcherOptions, int]:
    """How many processes match side by side: the CPU's threads are shared among them, a GPU is not."""
    if network.device != "cpu":
        return network, 1
    return replace(network, threads=max(1, len(os.sched_getaffinity(0)) // jobs)), jobs


def measure_all(
    batch: Batch, on_progress: Callable[[object, str, int], None]
) -> Iterator[Outcome[MeasureTask, Measured]]:
    """Measure the recordings of a batch and yield their outcomes as they finish; every error names its recording.

    What was measured before comes first, unread where its files are as they were then. `on_progress` is called with the
    recording, what is being done, and the number of frames done.
    """
    settings, unknown = batch.settings, []
    known = KnownFiles(batch.tasks, batch.store, read_again=settings.measure_again or settings.verify_content)
    for task, found in chain.from_iterable(map(known.found, batch.tasks)):
        if found is None:
            unknown.append(task)
        else:
            yield Outcome(task, found)
    if unknown and settings.engine is Engine.RAY:
        yield from measure_on_cluster(unknown, settings, batch.limits)
    else:
        yield from measure_here(unknown, settings.jobs, batch.limits, batch.spool, on_progress)


def was_examined(error: AuditorError) -> bool:
    """True where a recording could be read but not audited, or took too much: the error says what is missing."""
    return isinstance(error, RigError | LimitError)


# Judging


@dataclass(frozen=True)
class JudgeSettings:
    """How measurements are judged. Without a `calibration` each is judged by the one in force that fits it, else by
    that of other recordings of its batch, or by the prior. With `only_stale`, what would be judged as it is judged
    already keeps its verdicts. `by_batch` are the ids of calibrations of other recordings, which the store keeps, by
    measurement (`pipeline/calibrations/batch.py`).
    """

    criteria: Criteria
    calibration: Calibration | None = None
    only_stale: bool = False
    by_batch: Mapping[str, str] = field(default_factory=dict, hash=False)


@dataclass(frozen=True)
class Judged:
    """What became of one measurement: a judgement, an error, or neither where the store has no thresholds for it.

    `fresh` is False where the judgement is an earlier one, which was kept. `recording` is the name of its recording.
    `complete` is False where something was not audited: `gaps` say what. `warnings` are sentences for people, those of
    the gaps among them. `by` is what it was judged by; None where it was not.
    """

    recording: str
    measurement_id: str
    judgement: StoredJudgement | None = None
    error: AuditorError | None = None
    warnings: tuple[str, ...] = ()
    complete: bool = False
    gaps: tuple[str, ...] = ()
    fresh: bool = True
    by: JudgedBy | None = None

    @property
    def found(self) -> bool:
        """True where frames belong to an incident or an alert."""
        return self.judgement is not None and self.judgement.found > 0


class Judge:
    """Judges measurements of one store; its calibrations and current judgements are read once."""

    def __init__(self, store: Store, settings: JudgeSettings, *, many: bool = False) -> None:
        self._store = store
        self._settings = settings
        known = [] if settings.calibration else histories(store)
        self._known = known
        self._calibrations, self._provisional = in_force_of(store, known), provisional_of(store, known)
        self._current = store.current_judgements()
        self._batch_calibrations = {one: store.calibration(one) for one in sorted(set(settings.by_batch.values()))}
        self._usual = UsualRigs(store)
        self._recordings: dict[str, RecordingRecord] = {}
        if many:  # at once: that takes far less than one by one
            store.measurements()
            self._recordings = {one.recording_id: one for one in store.recordings()}

    def judge(self, measurement: str) -> Judged:
        """Judge one measurement and keep its verdicts. Raises StoreError where the store does not have it.

        LiDARs alone that a person declares to be no sensors leave nothing unaudited, whatever is found of them.
        """
        stored = self._store.measurement(measurement)
        rig = self._store.rig(stored.rig_id)
        judged = self._judge(stored, rig)
        declared = not rig.cameras and {*map(rig.topic, rig.sensors)} <= {*self._settings.criteria.no_sensors}
        return replace(judged, complete=True, gaps=()) if declared else judged

    def _judge(self, stored: StoredMeasurement, rig: Rig) -> Judged:
        store, criteria = self._store, self._settings.criteria
        recording = self._recordings.get(stored.recording_id) or store.recording(stored.recording_id)
        measurement, name, rigs = stored.measurement_id, recording.name, measured_rigs(store, recording)
        reading = reading_of(stored, criteria.min_coverage, criteria.no_sensors)
        lacking = self._usual.missing(recording, frozenset(map(rig.topic, rig.sensors)))
        told, again = (*reading.remarks, *filter(None, [lacking])), looks_again(rig, rigs)
        try:
            refuse_earlier_counting(store, measurement)
            fitting = self._fitting(measurement)
            calibration = fitting or self._unfitted(measurement)
            if calibration is None and again:
                return Judged(name, measurement, complete=True)
            if calibration is None:
                return Judged(name, measurement, warnings=(_NO_THRESHOLDS, *told), gaps=(_NO_THRESHOLDS_GAP,))
            beside = rigs_in_turn(store, recording, measurement) if criteria.method is Method.ROBUST else ()
            earlier = self._kept(measurement, calibration, beside)
            judgement = earlier or self._judged(measurement, calibration, beside)
        except AuditorError as error:
            return Judged(name, measurement, error=error, warnings=told)
        gaps = (
            *([_NO_THRESHOLDS_GAP] if fitting is None and self._calibrations else []),
            *(self._lost if fitting is None else ()),
            *as_a_part(judgement, calibration),
            *frames_not_audited(stored, judgement, criteria.min_coverage, rig, rigs),
            *views_not_compared(rig, criteria.min_view, criteria.no_sensors, rigs),
            *conflicts_of(store, recording),
        )
        gaps = () if again else gaps
        unfitted = JudgedBy.BATCH if measurement in self._settings.by_batch else JudgedBy.PRIOR
        by = JudgedBy.LEARNT if fitting is not None else unfitted
        warnings = (
            *unresolved(judgement, calibration, criteria, by),
            *([_PROVISIONAL] if calibration.calibration_id in self._provisional else []),
            *marked(judgement, calibration),
            *gaps,
            *told,
            *counted_elsewhere(store, recording),
        )
        unread = () if reading.complete else reading.remarks or ("it was not read whole",)
        missing = (*gaps, *unread)
        return Judged(
            name,
            measurement,
            judgement,
            warnings=warnings,
            complete=not missing,
            gaps=missing,
            fresh=judgement is not earlier,
            by=by,
        )

    @cached_property
    def _lost(self) -> tuple[str, ...]:
        """What was in force and is gone; looked up only where nothing in force fits."""
        return tuple(map(lost_line, lost_versions(self._store, self._known)))

    def _fitting(self, measurement: str) -> Calibration | None:
        """The calibration that a measurement is judged by; None where there is none.

        By triples LiDARs alone are never judged. A calibration that was given for cameras is none for LiDARs alone, and
        none for a camera's past.
        """
        given, kind = self._settings.calibration, self._rig(measurement).kind
        by_triples = self._settings.criteria.method is Method.PAPER
        if by_triples and kind.compared_to in (ComparedTo.SCANS, ComparedTo.LIDARS):
            return None
        if given is not None and kind.compared_to is not ComparedTo.CAMERAS and not given.rig_kind.matches(kind):
            given = None
        return given or fitting_calibration(self._store, measurement, self._calibrations)

    def _rig(self, measurement: str) -> Rig:
        return self._store.rig(self._store.measurement(measurement).rig_id)

    def _unfitted(self, measurement: str) -> Calibration | None:
        """What a measurement that no calibration fits is judged by: other recordings of its batch, or the prior."""
        calibration_id = self._settings.by_batch.get(measurement)
        if calibration_id is not None:
            return self._batch_calibrations[calibration_id]
        return prior_for(self._store, measurement, self._settings.criteria)

    def _judged(self, measurement: str, calibration: Calibration, beside: Sequence[str]) -> StoredJudgement:
        """Judge a measurement, and let the evidence of those beside it go on into it."""
        store, criteria = self._store, self._settings.criteria
        others = {one: self._fitting(one) or self._unfitted(one) for one in beside}
        return judge_measurement(store, measurement, calibration, criteria, self._current, others)

    def _kept(self, measurement: str, calibration: Calibration, beside: Sequence[str]) -> StoredJudgement | None:
        """The current judgement of a measurement, where it is not to be judged again."""
        current, criteria = self._current.get(measurement), self._settings.criteria
        if current is None or criteria.strict or not self._settings.only_stale:
            return None
        return current if is_as_now(current, self._store, calibration, criteria, beside) else None


def judge_all(store: Store, measurements: Iterable[str], settings: JudgeSettings) -> Iterator[Judged]:
    """Judge measurements of a store one by one."""
    known = list(measurements)
    return _judge_all(Judge(store, settings, many=len(known) > FEW), store, known)


def _judge_all(judge: Judge, store: Store, measurements: Iterable[str]) -> Iterator[Judged]:
    with logged(store.folder):
        yield from map(judge.judge, measurements)


def recording_name(store: Store, measurement: str) -> str:
    """What the user calls the recording of a measurement."""
    return store.recording(store.measurement(measurement).recording_id).name
