"""Calibrations from stored measurements, and verdicts on stored measurements: no recording is read."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from decimal import Decimal
from functools import lru_cache, partial

from auditor import __version__
from auditor.errors import ThresholdsError
from auditor.identification.cross_validation import clean_hours, robust_thresholds
from auditor.identification.drive_level import for_drive
from auditor.identification.faults import fault_scores
from auditor.identification.incidents.series import FrameSeries, Portion
from auditor.identification.paper import NOT_MEASURED, sensors_where
from auditor.identification.paper import judge_frames as judge_by_paper
from auditor.identification.parameters import (
    SCORE_LIMITS,
    FittedOn,
    fitted_on,
    has_prior,
    judging_digest,
    judging_settings,
)
from auditor.identification.prior import OFFSET
from auditor.identification.robust import judge_portions
from auditor.identification.systems import System
from auditor.identification.thresholds import check_calibration, thresholds_at
from auditor.identification.transfer import (
    calibration_for,
    closeness,
    for_like_cameras,
    for_sparser_lidar,
    halvings_of_points,
    marks_of,
)
from auditor.model.calibration import (
    PRIOR,
    Calibration,
    Marks,
    RobustThresholds,
    Thresholds,
    prior_calibration,
)
from auditor.model.checks import rig_sensor_checks
from auditor.model.frames import SensorState
from auditor.model.measurement import COUNTING_VERSIONS
from auditor.model.rig import Rig
from auditor.model.rig_kind import Similarity
from auditor.model.settings import Criteria
from auditor.model.verdict import Method, Verdict, VerdictKind
from auditor.pipeline.blank_pictures import with_pictures
from auditor.pipeline.clean_frames import frame_statistics
from auditor.store.records import (
    FrameStatistics,
    JudgementRecord,
    JudgingRules,
    RecordingRecord,
    StoredJudgement,
    StoredMeasurement,
    judgement_id,
)
from auditor.store.store import Store

Rows = list[tuple[int, int, Verdict]]

SMALLEST_STRICT_R = Decimal("0.0001")
"""`strict` refuses a smaller r by the robust method: no clean frames that anybody has reach so far."""


def system_of(rig: Rig, fitted: FittedOn = FittedOn.SGBM) -> System:
    """What the frames of a rig are judged by; `fitted` says on which matcher's disparities the prior was."""
    return System(rig_sensor_checks(rig), rig.triples, rig.sensors, rig.fallback, fitted)


def counted_earlier(store: Store, measurement: str) -> bool:
    """Whether a measurement was counted in an earlier way, so that today's thresholds say nothing of it."""
    stored = store.measurement(measurement)
    return stored.procedure.counting_version < COUNTING_VERSIONS[store.rig(stored.rig_id).kind.compared_to]


def refuse_earlier_counting(store: Store, measurement: str) -> None:
    """Raises ThresholdsError where a measurement was counted in an earlier way."""
    if counted_earlier(store, measurement):
        raise ThresholdsError(
            "measured by an earlier way of counting",
            where=f"measurement {measurement}",
            remedy="measure again with auditor scan --measure-again",
        )


def refuse_withheld(store: Store, measurement: str) -> None:
    """Raises ThresholdsError where no verdict may be given on a measurement: nothing can be learnt from it either."""
    reason = store.measurement(measurement).withheld
    if reason:
        raise ThresholdsError(
            f"its verdicts are withheld: {reason}",
            where=f"measurement {measurement}",
            remedy="leave it out, or scan it again once it is put right",
        )


def fitting_calibration(store: Store, measurement: str, calibrations: Sequence[Calibration]) -> Calibration | None:
    """The calibration, of some, that a measurement is judged by: made of measurements of the same procedure.

    One of its rig kind goes first, then that of a rig with the fewest additional sensors, then those of similar kinds;
    of several, which are of rig kinds apart, that of the smallest id.
    """
    stored = store.measurement(measurement)
    rig = store.rig(stored.rig_id)
    alike = [calibration for calibration in calibrations if calibration.procedure == stored.procedure]
    ranked = [(closeness(calibration, rig), calibration) for calibration in alike]
    closest = min((rank for rank, _ in ranked if rank is not None), default=None)
    fitting = [calibration for rank, calibration in ranked if rank is not None and rank == closest]
    return min(fitting, key=lambda calibration: calibration.calibration_id, default=None)


def prior_for(store: Store, measurement: str, criteria: Criteria) -> Calibration | None:
    """The prior, by which the robust method judges what no calibration fits; None where it does not hold."""
    stored = store.measurement(measurement)
    if criteria.method is not Method.ROBUST or not has_prior(stored.procedure):
        return None
    return prior_calibration(store.rig(stored.rig_id).kind, stored.procedure)


def judge_measurement(
    store: Store,
    measurement: str,
    calibration: Calibration,
    criteria: Criteria,
    current: Mapping[str, StoredJudgement] | None = None,
    beside: Mapping[str, Calibration | None] | None = None,
) -> StoredJudgement:
    """Judge every frame of a measurement and keep the verdicts, which are its current ones from then on.

    A rig that is a part of the calibration's is judged by what the calibration has of its sensors.
    `current` is `store.current_judgements()`, read once where many measurements are judged. `beside` are the
    measurements of the same recording by its other rigs (`rigs_in_turn`), each with its calibration: by the robust
    method their evidence goes on into this one's, though only this one's verdicts are kept. Raises
    ThresholdsError where the thresholds do not fit or it was counted otherwise than today, and StoreError where r has
    more decimals than the store keeps.
    """
    robust, beside = criteria.method is Method.ROBUST, beside or {}
    fitted = _fit(store, measurement, calibration, criteria)
    rig, part = fitted.rig, fitted.calibration.part
    thresholds: Thresholds | RobustThresholds
    judged: Callable[[], Rows]
    if robust:
        portion = _portion(store, fitted, criteria)
        thresholds, judged = portion.thresholds, partial(_judge_robust, store, portion, beside, criteria)
    else:
        theta = thresholds_at(fitted.calibration, criteria.statistic, criteria.r, transferred=fitted.transferred)
        thresholds, judged = theta, partial(_judge_paper, store, measurement, rig, theta)
    reason = fitted.stored.withheld
    rows = _withheld(rig, fitted.frames, reason) if reason else judged()
    if criteria.strict:
        _refuse_unresolvable(fitted.calibration, criteria, thresholds)
    before = (store.current_judgements() if current is None else current).get(measurement)
    judgement = JudgementRecord(
        measurement,
        criteria.method,
        thresholds,
        todays_rules(fitted_on(fitted.stored.procedure)),
        _after(before),
        criteria.recount,
        absent_sensors=part.absent if part else (),
        calibrated_as=part.sensors if part else rig.sensors,
        marks=fitted.marks,
        judged_with=tuple(beside) if robust else (),
    )
    if calibration.calibration_id != PRIOR:
        store.keep_calibration(calibration)
    return store.write_judgement(judgement, rows)


def todays_rules(fitted: FittedOn = FittedOn.SGBM) -> JudgingRules:
    """The rules that this auditor judges by, with the prior of a matcher."""
    scores = (SCORE_LIMITS.lowest, SCORE_LIMITS.highest)
    return JudgingRules(judging_digest(fitted), judging_settings(fitted), __version__, OFFSET, scores)


def _after(before: StoredJudgement | None) -> datetime:
    """Now, and later than the judgement before also where the clock was ahead when that was made."""
    now = datetime.now(UTC)
    return now if before is None else max(now, before.judged_at + timedelta(microseconds=1))


def is_as_now(
    judgement: StoredJudgement, store: Store, calibration: Calibration, criteria: Criteria, beside: Sequence[str] = ()
) -> bool:
    """Whether judging its measurement by a calibration, `beside` others of its recording, would give this again.

    Raises ThresholdsError where the calibration does not fit.
    """
    stored = store.measurement(judgement.measurement_id)
    _, similarity = _own(calibration, stored, store.rig(stored.rig_id), criteria)
    now = judgement_id(
        judgement.measurement_id,
        calibration.calibration_id,
        criteria.method,
        criteria.incidents_per_hour if criteria.method is Method.ROBUST else criteria.statistic,
        criteria.r,
        judging_digest(fitted_on(stored.procedure)),
        transferred=similarity is not Similarity.SAME,
        recounted=criteria.recount,
        judged_with=tuple(beside),
    )
    return now == judgement.judgement_id


@lru_cache(maxsize=4)
def _robust(
    calibration: Calibration, system: System, r: Decimal, incidents_per_hour: float | None, *, transferred: bool
) -> RobustThresholds:
    """The same for all measurements of one rig, and slow where each clean recording is judged by the others."""
    return robust_thresholds(calibration, system, r, incidents_per_hour, transferred=transferred)


@dataclass(frozen=True, eq=False)
class _FittedMeasurement:
    """A measurement with its rig and statistics, what a calibration has of its sensors, and what marks that one."""

    stored: StoredMeasurement
    rig: Rig
    frames: FrameStatistics
    calibration: Calibration
    halvings: float
    marks: Marks

    @property
    def transferred(self) -> bool:
        """Whether the calibration is of another rig kind."""
        return self.marks.similarity is not Similarity.SAME


def _fit(store: Store, measurement: str, calibration: Calibration, criteria: Criteria) -> _FittedMeasurement:
    """Raises ThresholdsError where the calibration does not fit, or the measurement was counted in an earlier way."""
    refuse_earlier_counting(store, measurement)
    stored = store.measurement(measurement)
    rig = store.rig(stored.rig_id)
    own, similarity = _own(calibration, stored, rig, criteria)
    frames = frame_statistics(store, measurement, recount=criteria.recount)
    halvings = halvings_of_points(own.clean, rig, frames.returns)
    marks = marks_of(own, similarity, stored.recording_id, halvings, stored.versions)
    return _FittedMeasurement(stored, rig, frames, own, halvings, marks)


def _own(
    calibration: Calibration, stored: StoredMeasurement, rig: Rig, criteria: Criteria
) -> tuple[Calibration, Similarity]:
    """What a calibration has of a rig's sensors, and how alike its rig kind is."""
    own = calibration_for(calibration, rig) or calibration
    return own, check_calibration(own, rig_kind=rig.kind, procedure=stored.procedure, transfer=criteria.transfer)


def _portion(store: Store, fitted: _FittedMeasurement, criteria: Criteria) -> Portion:
    """What the robust method judges of a measurement."""
    rig, frames = fitted.rig, fitted.frames
    system = system_of(rig, fitted_on(fitted.stored.procedure))
    rate, transferred = criteria.incidents_per_hour, fitted.transferred
    thresholds = _robust(fitted.calibration, system, criteria.r, rate, transferred=transferred)
    if fitted.marks.other_lidar:
        thresholds = for_sparser_lidar(thresholds, fitted.halvings)
    features = store.load_fault_features(fitted.stored.measurement_id)
    cameras = [camera.number for camera in rig.cameras]
    thresholds = for_like_cameras(thresholds, cameras, features.by_camera)
    thresholds = for_drive(thresholds, rig_sensor_checks(rig), frames.statistics, frames.stamps_ns)
    series = FrameSeries.of_recording(
        frames.stamps_ns,
        frames.statistics,
        frames.states == SensorState.PRESENT,
        frames.fingerprints,
        fault_scores(features, frames.stamps_ns, rig.sensors),
        features.by_camera,
        features.agreeing,
        by_time=system.by_time,
    )
    return Portion(frames.frames, series, system, thresholds)


def _portions_beside(store: Store, beside: Mapping[str, Calibration | None], criteria: Criteria) -> Iterator[Portion]:
    """The portions of other rigs; what has no calibration, or none that fits, is none."""
    for measurement, calibration in beside.items():
        if calibration is not None:
            with suppress(ThresholdsError):
                yield _portion(store, _fit(store, measurement, calibration, criteria), criteria)


def rigs_in_turn(store: Store, recording: RecordingRecord, measurement: str) -> tuple[str, ...]:
    """The other measurements of a measurement's recording whose rigs follow one another, and its own, in time.

    They were measured in the same way, by rigs of the same sensors under the same numbers. One whose verdicts are
    withheld is none: what cannot be judged is no evidence for what can.
    """
    stored = store.measurement(measurement)
    topics = _topics(store.rig(stored.rig_id))
    others = {one: store.measurement(one) for one in sorted(known_measurements(store, recording) - {measurement})}
    return tuple(
        one
        for one, other in others.items()
        if not other.withheld and other.procedure == stored.procedure and _topics(store.rig(other.rig_id)) == topics
    )


def known_measurements(store: Store, recording: RecordingRecord) -> set[str]:
    """The measurements of a recording, by any rig, that the store has."""
    seen = (one for sighting in recording.sightings for one in sighting.measurements)
    return {one for one in seen if store.has_measurement(one)}


def measured_rigs(store: Store, recording: RecordingRecord) -> list[Rig]:
    """The rigs that a recording was measured with."""
    return [store.rig(store.measurement(one).rig_id) for one in sorted(known_measurements(store, recording))]


def _topics(rig: Rig) -> dict[int, str]:
    return {sensor: rig.topic(sensor) for sensor in rig.sensors}


def _judge_robust(store: Store, portion: Portion, beside: Mapping[str, Calibration | None], criteria: Criteria) -> Rows:
    """The verdicts on the frames of a portion; the evidence of those beside it goes on into them."""
    verdicts = judge_portions([portion, *_portions_beside(store, beside, criteria)])[0]
    shown = with_pictures(verdicts, portion)
    return list(zip(portion.numbers.tolist(), portion.series.stamps_ns.tolist(), shown, strict=True))


def _judge_paper(store: Store, measurement: str, rig: Rig, thresholds: Thresholds) -> Rows:
    errors = store.load_errors(measurement, thresholds.statistic)
    missing = sensors_where(rig.sensors, errors.states != SensorState.PRESENT)
    verdicts = judge_by_paper(errors.E, thresholds, rig.triples, rig.sensors, missing, rig.fallback)
    return list(zip(errors.frames.tolist(), errors.stamps_ns.tolist(), verdicts, strict=True))


def _withheld(rig: Rig, frames: FrameStatistics, reason: str) -> Rows:
    """No verdict on any frame, with the reason."""
    verdict = Verdict(
        VerdictKind.NOT_AUDITABLE, NOT_MEASURED * len(rig.triples), out_of_system=rig.sensors, reason=reason
    )
    return [
        (frame, stamp_ns, verdict)
        for frame, stamp_ns in zip(frames.frames.tolist(), frames.stamps_ns.tolist(), strict=True)
    ]


def _refuse_unresolvable(
    calibration: Calibration, criteria: Criteria, thresholds: Thresholds | RobustThresholds
) -> None:
    where = f"calibration {calibration.calibration_id}"
    if isinstance(thresholds, RobustThresholds):
        refuse_unproven(thresholds)
    elif not thresholds.resolvable:
        fewest = min(thresholds.samples.values())
        raise ThresholdsError(
            f"r = {criteria.r} is not resolvable with {fewest} clean samples: it would be judged as r = 0",
            where=where,
            remedy=f"take r = 0 or at least {1 / fewest:.2g}, or calibrate on more clean frames",
        )
    if not resolves_incidents(calibration, criteria):
        hours = clean_hours(calibration)
        enough = f"take at least {1 / hours:.2g}, or calibrate" if hours else "calibrate"
        raise ThresholdsError(
            f"{criteria.incidents_per_hour:g} incidents an hour are not resolvable with {hours:.2g} hours of clean "
            "frames: their limit would be extrapolated",
            where=where,
            remedy=f"{enough} on more clean frames",
        )


def refuse_unproven(thresholds: RobustThresholds) -> None:
    """Raises ThresholdsError for what `strict` refuses: thresholds that are the prior alone, and an r below 0.0001."""
    if not thresholds.drives:
        raise ThresholdsError(
            "its thresholds are the prior alone: no clean drive of this rig kind was seen",
            where=f"calibration {thresholds.calibration_id}",
            remedy="calibrate on clean recordings of this rig kind",
        )
    if thresholds.r < SMALLEST_STRICT_R:
        raise ThresholdsError(
            f"r = {thresholds.r} is smaller than what clean frames show",
            where=f"calibration {thresholds.calibration_id}",
            remedy=f"take r = {SMALLEST_STRICT_R} or more",
        )


def resolves_incidents(calibration: Calibration, criteria: Criteria) -> bool:
    """False where the clean frames are too few for the allowed incidents an hour, whose limit is extrapolated then."""
    allowed = criteria.incidents_per_hour
    return allowed is None or allowed * clean_hours(calibration) >= 1
