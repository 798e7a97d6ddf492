"""Measurements of a store are judged: by which calibration, what became of each, and what of it was not audited."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

from auditor.errors import AuditorError
from auditor.model.calibration import Calibration
from auditor.model.rig import Rig
from auditor.model.rig_kind import ComparedTo
from auditor.model.settings import Criteria
from auditor.model.verdict import JudgedBy, Method
from auditor.pipeline.judge import (
    fitting_calibration,
    is_as_now,
    judge_measurement,
    measured_rigs,
    prior_for,
    refuse_earlier_counting,
    rigs_in_turn,
)
from auditor.pipeline.measured import FEW
from auditor.pipeline.reading import frames_not_audited, looks_again, reading_of, views_not_compared
from auditor.pipeline.remarks import UsualRigs, as_a_part, conflicts_of, counted_elsewhere, marked, unresolved
from auditor.store.log.runs import logged
from auditor.store.records import RecordingRecord, StoredJudgement, StoredMeasurement
from auditor.store.store import Store
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
class JudgeResult:
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
        all_histories = [] if settings.calibration else histories(store)
        self._known = all_histories
        self._calibrations, self._provisional = in_force_of(store, all_histories), provisional_of(store, all_histories)
        self._current = store.current_judgements()
        self._batch_calibrations = {one: store.calibration(one) for one in sorted(set(settings.by_batch.values()))}
        self._usual = UsualRigs(store)
        self._recordings: dict[str, RecordingRecord] = {}
        if many:  # at once: that takes far less than one by one
            store.measurements()
            self._recordings = {one.recording_id: one for one in store.recordings()}

    def judge(self, measurement: str) -> JudgeResult:
        """Judge one measurement and keep its verdicts. Raises StoreError where the store does not have it.

        LiDARs alone that a person declares to be no sensors leave nothing unaudited, whatever is found of them.
        """
        stored = self._store.measurement(measurement)
        rig = self._store.rig(stored.rig_id)
        judged = self._judge(stored, rig)
        declared = not rig.cameras and {*map(rig.topic, rig.sensors)} <= {*self._settings.criteria.no_sensors}
        return replace(judged, complete=True, gaps=()) if declared else judged

    def _judge(self, stored: StoredMeasurement, rig: Rig) -> JudgeResult:
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
                return JudgeResult(name, measurement, complete=True)
            if calibration is None:
                return JudgeResult(name, measurement, warnings=(_NO_THRESHOLDS, *told), gaps=(_NO_THRESHOLDS_GAP,))
            beside = rigs_in_turn(store, recording, measurement) if criteria.method is Method.ROBUST else ()
            earlier = self._kept(measurement, calibration, beside)
            judgement = earlier or self._judged(measurement, calibration, beside)
        except AuditorError as error:
            return JudgeResult(name, measurement, error=error, warnings=told)
        gaps = (
            *([_NO_THRESHOLDS_GAP] if fitting is None and self._calibrations else []),
            *(self._lost if fitting is None else ()),
            *as_a_part(judgement, calibration),
            *frames_not_audited(store, stored, judgement, criteria.min_coverage, rig, rigs),
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
        return JudgeResult(
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


def judge_all(store: Store, measurements: Iterable[str], settings: JudgeSettings) -> Iterator[JudgeResult]:
    """Judge measurements of a store one by one."""
    measurement_ids = list(measurements)
    return _judge_all(Judge(store, settings, many=len(measurement_ids) > FEW), store, measurement_ids)


def _judge_all(judge: Judge, store: Store, measurements: Iterable[str]) -> Iterator[JudgeResult]:
    with logged(store.folder):
        yield from map(judge.judge, measurements)


def recording_name(store: Store, measurement: str) -> str:
    """What the user calls the recording of a measurement."""
    return store.recording(store.measurement(measurement).recording_id).name
