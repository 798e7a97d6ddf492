"""Calibrations from stored measurements, and verdicts on stored measurements: no recording is read."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from decimal import Decimal
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from auditor import __version__
from auditor.errors import SettingError, ThresholdsError
from auditor.identification.algorithm2 import NOT_MEASURED, sensors_where
from auditor.identification.causes.faults import SCORED, ObservedFeatures, fault_scores, frozen
from auditor.identification.cross_validation import clean_hours, robust_thresholds
from auditor.identification.marks import MACHINE, for_sparser_lidar, halvings_of_points, marks_of
from auditor.identification.paper import judge_frames as judge_by_paper
from auditor.identification.parameters import SCORE_LIMITS, judging_digest, judging_settings
from auditor.identification.prior import OFFSET
from auditor.identification.robust import FrameSeries, judge_frames
from auditor.identification.scores import for_drive
from auditor.identification.statistics import sensor_statistics
from auditor.identification.sub_rigs import calibration_for, closeness
from auditor.identification.systems import System
from auditor.identification.thresholds import check_calibration, thresholds_at
from auditor.model.calibration import (
    PRIOR,
    Calibration,
    CleanFrames,
    RobustThresholds,
    Thresholds,
    prior_calibration,
)
from auditor.model.checks import SHARE_CHECKS, SensorCheck, rig_sensor_checks
from auditor.model.frames import SensorState
from auditor.model.measurement import COUNTING_VERSION, Statistic
from auditor.model.rig import LIDAR, Rig
from auditor.model.rig_kind import Similarity
from auditor.model.verdict import Method, Verdict, VerdictKind
from auditor.store import (
    FrameStatistics,
    JudgementRecord,
    JudgingRules,
    Store,
    StoredJudgement,
    StoredMeasurement,
)

Rows = list[tuple[int, int, Verdict]]

PRIOR_MATCHER = "sgbm"
"""The matcher whose disparities the prior was fitted on: others give other statistics."""

SMALLEST_STRICT_R = Decimal("0.0001")
"""`strict` refuses a smaller r by the robust method: no clean frames that anybody has reach so far."""


@dataclass(frozen=True)
class Criteria:
    """How verdicts are to be reached.

    `statistic` is for the paper's method, `incidents_per_hour` for the robust one. `transfer` accepts thresholds of
    another rig kind, `strict` refuses rates that the clean frames cannot resolve, and thresholds that are the prior
    alone. `recount` computes the robust method's statistics again from the stored cells. Raises SettingError for what
    the paper's method does not have.
    """

    r: Decimal
    method: Method = Method.ROBUST
    statistic: Statistic = Statistic.GATED
    incidents_per_hour: float | None = None
    transfer: bool = False
    strict: bool = False
    recount: bool = False

    def __post_init__(self) -> None:
        if self.method is Method.ROBUST:
            return
        remedy = "leave it away, or judge with --method robust"
        if self.incidents_per_hour is not None:
            what = "the paper's method has no limit that incidents per hour could set"
            raise SettingError(what, where="--incidents-per-hour", remedy=remedy)
        if self.recount:
            what = "the paper's method has no statistics that come from cells"
            raise SettingError(what, where="--recount", remedy=remedy)


def system_of(rig: Rig) -> System:
    """What the frames of a rig are judged by."""
    return System(rig_sensor_checks(rig), rig.triples, rig.sensors, rig.fallback)


def clean_frames_of(
    store: Store, measurement: str, frames: range | None = None, *, recount: bool = False
) -> CleanFrames:
    """What a calibration keeps of a measurement.

    `frames` restricts it to these frame numbers, `recount` computes the statistics again from the stored cells.
    """
    stored = store.measurement(measurement)
    return _clean_frames(store, stored, store.rig(stored.rig_id), frames, recount=recount)


def _clean_frames(
    store: Store, measurement: StoredMeasurement, rig: Rig, frames: range | None, *, recount: bool
) -> CleanFrames:
    known = measurement.measurement_id
    frames_of = _frame_statistics(store, known, recount=recount)
    features = _observed_features(store, known)
    present = frames_of.states == SensorState.PRESENT
    chosen = np.array([frames is None or int(number) in frames for number in frames_of.frames], dtype=np.bool_)
    return CleanFrames(
        measurement.recording_id,
        frames_of.stamps_ns[chosen],
        {
            (statistic, triple): column
            for statistic in Statistic
            for triple, column in zip(
                rig.measured_triples, store.load_errors(known, statistic).E[chosen].T, strict=True
            )
        },
        dict(zip(rig_sensor_checks(rig), frames_of.statistics[chosen].T, strict=True)),
        {cause: column[chosen] for cause, column in fault_scores(features, frames_of.stamps_ns, rig.sensors).items()},
        missing=_of_sensors(rig, ~present[chosen]),
        frozen=_of_sensors(rig, frozen(frames_of.fingerprints, present)[chosen]),
        unmasked=_unmasked(rig, frames_of, chosen),
        features={
            (name, pair): column
            for name in SCORED
            for pair, column in zip(features.pairs, features.columns[name][chosen].T, strict=True)
        },
        brightness={key: column[chosen] for key, column in features.by_camera.items()},
        returns=frames_of.returns[chosen] if LIDAR in rig.sensors else np.zeros(0),
        versions={name: measurement.versions[name] for name in MACHINE if name in measurement.versions},
    )


def _unmasked(rig: Rig, frames: FrameStatistics, chosen: NDArray[np.bool_]) -> dict[SensorCheck, NDArray[np.float64]]:
    """The statistics without the LiDAR of those sensor checks for which they are others in some frame."""
    columns = zip(rig_sensor_checks(rig), frames.statistics[chosen].T, frames.unmasked[chosen].T, strict=True)
    return {one: alone for one, usual, alone in columns if not np.array_equal(usual, alone, equal_nan=True)}


def _of_sensors(rig: Rig, flags: NDArray[np.bool_]) -> dict[int, NDArray[np.bool_]]:
    """(F, S) flags by sensor, without the sensors that have none."""
    return {sensor: column for sensor, column in zip(rig.sensors, flags.T, strict=True) if column.any()}


def _observed_features(store: Store, measurement: str) -> ObservedFeatures:
    """The stored fault features of a measurement."""
    seen = store.load_fault_features(measurement)
    return ObservedFeatures(seen.pairs, seen.columns, seen.cameras, seen.brightness)


def _frame_statistics(store: Store, measurement: str, *, recount: bool) -> FrameStatistics:
    stored = store.load_statistics(measurement)
    if not recount:
        return stored
    counted = statistics_from_cells(store, measurement)
    same = stored.unmasked == stored.statistics
    return replace(stored, statistics=counted, unmasked=np.where(same, counted, stored.unmasked))


def statistics_from_cells(store: Store, measurement: str) -> NDArray[np.float64]:
    """(F, M) statistics computed again from the stored cells, as a scan computes them from the images.

    For measurements made before windows or votes were changed. Statistics without cells stay as they were measured.
    """
    sensor_checks = rig_sensor_checks(store.rig(store.measurement(measurement).rig_id))
    counted = [column for column, one in enumerate(sensor_checks) if one.check not in SHARE_CHECKS]
    of_cells = [sensor_checks[column] for column in counted]
    stored = store.load_statistics(measurement)
    statistics, row_of = stored.statistics.copy(), {frame: row for row, frame in enumerate(stored.frames.tolist())}
    for frame, cells in store.load_cells(measurement):
        statistics[row_of[frame], counted] = np.array(sensor_statistics(of_cells, cells, {}), dtype=np.float64)
    return statistics


def counted_earlier(store: Store, measurement: str) -> bool:
    """Whether a measurement was counted in an earlier way, so that today's thresholds say nothing of it."""
    return store.measurement(measurement).procedure.counting_version < COUNTING_VERSION


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
    if criteria.method is not Method.ROBUST or stored.procedure.matcher != PRIOR_MATCHER:
        return None
    return prior_calibration(store.rig(stored.rig_id).kind, stored.procedure)


def judge_measurement(
    store: Store,
    measurement: str,
    calibration: Calibration,
    criteria: Criteria,
    current: Mapping[str, StoredJudgement] | None = None,
) -> StoredJudgement:
    """Judge every frame of a measurement and keep the verdicts, which are its current ones from then on.

    A rig that is a part of the calibration's is judged by what the calibration has of its sensors.
    `current` is `store.current_judgements()`, read once where many measurements are judged. Raises
    ThresholdsError where the thresholds do not fit or it was counted otherwise than today, and StoreError where r has
    more decimals than the store keeps.
    """
    refuse_earlier_counting(store, measurement)
    stored = store.measurement(measurement)
    rig = store.rig(stored.rig_id)
    whole, calibration = calibration, calibration_for(calibration, rig) or calibration
    similarity = check_calibration(
        calibration, rig_kind=rig.kind, procedure=stored.procedure, transfer=criteria.transfer
    )
    frames = _frame_statistics(store, measurement, recount=criteria.recount)
    halvings = halvings_of_points(calibration.clean, rig, frames.returns)
    marks = marks_of(calibration, similarity, stored.recording_id, halvings, stored.versions)
    transferred = similarity is not Similarity.SAME
    thresholds: Thresholds | RobustThresholds
    if criteria.method is Method.ROBUST:
        rate = criteria.incidents_per_hour
        robust = _robust(calibration, system_of(rig), criteria.r, rate, transferred=transferred)
        if marks.other_lidar:
            robust = for_sparser_lidar(robust, halvings)
        thresholds = robust = for_drive(robust, rig_sensor_checks(rig), frames.statistics, frames.stamps_ns)
        rows = _judge_robust(store, measurement, rig, robust, frames) if not stored.withheld else []
    else:
        thresholds = thresholds_at(calibration, criteria.statistic, criteria.r, transferred=transferred)
        rows = _judge_paper(store, measurement, rig, thresholds) if not stored.withheld else []
    if stored.withheld:
        rows = _withheld(rig, frames, stored.withheld)
    if criteria.strict:
        _refuse_unresolvable(calibration, criteria, thresholds)
    before = (store.current_judgements() if current is None else current).get(measurement)
    judgement = JudgementRecord(
        measurement,
        criteria.method,
        thresholds,
        todays_rules(),
        _after(before),
        criteria.recount,
        absent_sensors=calibration.part.absent if calibration.part else (),
        calibrated_as=calibration.part.sensors if calibration.part else rig.sensors,
        marks=marks,
    )
    if whole.calibration_id != PRIOR:
        store.keep_calibration(whole)
    return store.write_judgement(judgement, rows)


def todays_rules() -> JudgingRules:
    """The rules that this auditor judges by."""
    scores = (SCORE_LIMITS.lowest, SCORE_LIMITS.highest)
    return JudgingRules(judging_digest(), judging_settings(), __version__, OFFSET, scores)


def _after(before: StoredJudgement | None) -> datetime:
    """Now, and later than the judgement before also where the clock was ahead when that was made."""
    now = datetime.now(UTC)
    return now if before is None else max(now, before.judged_at + timedelta(microseconds=1))


@lru_cache(maxsize=4)
def _robust(
    calibration: Calibration, system: System, r: Decimal, incidents_per_hour: float | None, *, transferred: bool
) -> RobustThresholds:
    """The same for all measurements of one rig, and slow where each clean recording is judged by the others."""
    return robust_thresholds(calibration, system, r, incidents_per_hour, transferred=transferred)


def _judge_robust(
    store: Store, measurement: str, rig: Rig, thresholds: RobustThresholds, frames: FrameStatistics
) -> Rows:
    present, features = frames.states == SensorState.PRESENT, _observed_features(store, measurement)
    scores = fault_scores(features, frames.stamps_ns, rig.sensors)
    series = FrameSeries.of_recording(
        frames.stamps_ns, frames.statistics, present, frames.fingerprints, scores, features.by_camera
    )
    verdicts = judge_frames(series, system_of(rig), thresholds)
    return list(zip(frames.frames.tolist(), frames.stamps_ns.tolist(), verdicts, strict=True))


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
