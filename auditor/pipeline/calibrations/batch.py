"""Recordings of a batch that no calibration fits, judged by each other and by others of the store.

All are judged by the prior first. Those that show nothing are provisionally clean drives: calibrations are made of
them, and each recording is judged again by one that holds no frame of it. What shows something then teaches no more,
and all are judged once more without it. Others of the store teach where their verdicts show nothing, and keep these:
what a large batch found is not lost when one of its recordings is scanned again alone.
"""

import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

from auditor.errors import ThresholdsError
from auditor.model.calibration import PRIOR, Calibration
from auditor.model.settings import Criteria
from auditor.model.verdict import JudgedBy, Method
from auditor.pipeline.calibrations.clean import CleanMeasurements, attacked_by_labels, held_by
from auditor.pipeline.calibrations.making import by_kind, is_of_kind, make
from auditor.pipeline.judge import (
    counted_earlier,
    fitting_calibration,
    is_as_now,
    measured_rigs,
    prior_for,
    rigs_in_turn,
)
from auditor.pipeline.judged import JudgeResult, JudgeSettings, judge_all
from auditor.pipeline.measured import FEW
from auditor.pipeline.reading import frames_not_audited
from auditor.pipeline.remarks import conflicts_of
from auditor.pipeline.workers import Progress, in_order
from auditor.store.export import rows_of
from auditor.store.log.runs import logged
from auditor.store.queries import run_sql
from auditor.store.records import StoredJudgement
from auditor.store.store import Store
from auditor.store.versions.history import calibrations_in_force

FEWEST_RECORDINGS = 4
"""Drives of one rig kind and procedure that are judged by each other; of fewer each is judged by the prior."""

FEWEST_CLEAN = 3
"""Of these so many must show nothing, so that each of them is judged by two others at least."""

MOST_OF_STORE = 20
"""Measurements of a rig kind up to which the store's latest others are added to those of a batch."""

MOST_PASSES = 3
"""Times that the recordings are judged by each other; each is without those that earlier ones found."""

MOST_GROUPS = 5
"""Groups of provisionally clean recordings; each is judged by a calibration of the other groups."""

_EARLIER = "earlier recordings of its rig kind were judged by the prior alone: auditor judge judges all by each other"


def judge_batch(
    store: Store, measurements: Sequence[str], settings: JudgeSettings, jobs: int | None = 1
) -> Iterator[JudgeResult]:
    """Judge measurements of a store, in the order given; those that no calibration fits judge each other if enough.

    A named calibration, the paper's method and `strict` leave each measurement judged on its own. `jobs` are processes
    at a time, None as many as there are cores; the passes follow one another. Raises StoreError where the store does
    not have a measurement.
    """
    alone = settings.calibration is not None or settings.criteria.method is not Method.ROBUST
    if alone or settings.criteria.strict:
        return judge_side_by_side(store, measurements, settings, jobs)
    kinds = kinds_without_calibration(store, measurements, settings.criteria)
    if not kinds:
        return judge_side_by_side(store, measurements, settings, jobs)
    return _judge_by_each_other(store, measurements, settings, kinds, jobs)


def kinds_without_calibration(store: Store, measurements: Sequence[str], criteria: Criteria) -> list[tuple[str, ...]]:
    """Return the measurements that no calibration fits, by rig kind and procedure: those with enough recordings.

    The latest others of the store come behind those of a kind that has fewer than MOST_OF_STORE. What is withheld, was
    counted earlier, or is not for the prior is none of them.
    """
    if len(measurements) > FEW:
        store.measurements()  # at once: one by one takes far longer
    in_force = calibrations_in_force(store)

    def fits_none(measurement: str) -> bool:
        return (
            not store.measurement(measurement).withheld
            and not counted_earlier(store, measurement)
            and prior_for(store, measurement, criteria) is not None
            and fitting_calibration(store, measurement, in_force) is None
        )

    given = tuple((store, measurement) for measurement in dict.fromkeys(measurements) if fits_none(measurement))
    if not given:
        return []
    kinds = [[measurement for _, measurement in kind.chosen] for kind in by_kind(CleanMeasurements(given, ()))]
    others = _judged_others(store, measurements) if any(len(kind) < MOST_OF_STORE for kind in kinds) else []
    for kind in kinds:
        alike = (one for one in others if is_of_kind(store, one, kind[0]) and fits_none(one))
        kind.extend(islice(alike, max(0, MOST_OF_STORE - len(kind))))
    kinds = [kind for kind in kinds if len(kind) >= FEWEST_RECORDINGS]
    if not kinds:
        return []
    drives = drives_of(store, [measurement for kind in kinds for measurement in kind])
    return [tuple(kind) for kind in kinds if len({drives[measurement] for measurement in kind}) >= FEWEST_RECORDINGS]


def _judged_others(store: Store, measurements: Sequence[str]) -> list[str]:
    """Return what a store has judged by the robust method beside some measurements, what was recorded last first."""
    judged = {known for known, verdict in store.current_judgements().items() if verdict.method == Method.ROBUST}
    judged -= set(measurements)
    others = [one for one in store.measurements() if one.measurement_id in judged]
    others.sort(key=lambda one: (one.last_stamp_ns or 0, one.measurement_id), reverse=True)
    return [one.measurement_id for one in others]


def drives_of(store: Store, measurements: Collection[str]) -> dict[str, str]:
    """Return by measurement the drive that it is of: recordings that follow one another are one, and know one road.

    A recording whose frames a later one holds is of the drive of that.
    """
    rows = rows_of(run_sql(store, "SELECT recording_id, drive_id FROM recordings"))
    drives = {row["recording_id"]: row["drive_id"] for row in rows}
    counted, recordings = store.counted_by(), {one: store.measurement(one).recording_id for one in measurements}
    return {one: drives[counted.get(recording, recording)] for one, recording in recordings.items()}


def calibrations_of_others(
    store: Store, measurements: Sequence[str], teachers: Sequence[str], criteria: Criteria, jobs: int = 1
) -> dict[str, Calibration]:
    """The calibrations by which recordings of one rig kind and procedure judge each other, by measurement.

    `teachers` are those of the measurements, and others, whose recordings are provisionally clean. A calibration is of
    the other groups of them, or of all where its measurement is in none. There is none where fewer than FEWEST_CLEAN
    recordings are clean, and where what the others measured gives no calibration that fits.
    """
    drives = drives_of(store, {*measurements, *teachers})
    clean_drives = list(dict.fromkeys(drives[teacher] for teacher in teachers))
    if len(clean_drives) < FEWEST_CLEAN:
        return {}
    count = min(MOST_GROUPS, len(clean_drives))
    groups = {drive: place * count // len(clean_drives) for place, drive in enumerate(clean_drives)}
    calibrations: dict[int | None, Calibration] = {}
    for group in dict.fromkeys(groups.get(drives[measurement]) for measurement in measurements):
        others = tuple((store, teacher) for teacher in teachers if groups[drives[teacher]] != group)
        try:
            made = make(CleanMeasurements(others, ()), criteria.r, recount=criteria.recount, jobs=jobs)
        except ThresholdsError:  # nothing was measured, or the teachers' kinds differ more than from the first one's
            continue
        calibrations[group] = made.calibration
    by_measurement = ((known, calibrations.get(groups.get(drives[known]))) for known in measurements)
    return {
        measurement: calibration
        for measurement, calibration in by_measurement
        if calibration is not None and fitting_calibration(store, measurement, [calibration]) is not None
    }


def _judge_by_each_other(
    store: Store,
    measurements: Sequence[str],
    settings: JudgeSettings,
    kinds: Sequence[Sequence[str]],
    jobs: int | None,
) -> Iterator[JudgeResult]:
    """Judge all by what is learnt or the prior, then those of some kinds by each other until none more is found."""
    with logged(store.folder):
        distinct = list(dict.fromkeys(measurements))
        others = {known for kind in kinds for known in kind} - set(distinct)
        by_others = {known: verdict for known, verdict in store.current_judgements().items() if known in others}
        by_prior = _kept_by_prior(store, distinct, kinds, settings) if settings.only_stale else {}
        first = [measurement for measurement in distinct if measurement not in by_prior]
        judged = {result.measurement_id: result for result in judge_side_by_side(store, first, settings, jobs)}
        with_findings: set[str] = set()
        by_batch: dict[str, str] = {}
        for number in range(MOST_PASSES):
            verdicts = {each: result.judgement for each, result in judged.items() if result.judgement is not None}
            verdicts = {**by_others, **by_prior, **verdicts}
            with_findings |= {
                store.measurement(each).recording_id for each, verdict in verdicts.items() if verdict.found
            }
            now = _batch_calibrations(store, distinct, kinds, verdicts, with_findings, settings.criteria, jobs or 1)
            if number and now in ({}, by_batch):
                break
            by_batch = now
            again = [measurement for measurement in distinct if measurement in by_prior or measurement in by_batch]
            another = replace(settings, by_batch=by_batch)
            judged.update((result.measurement_id, result) for result in judge_side_by_side(store, again, another, jobs))
        told = (_EARLIER,) if by_batch and any(verdict.drives == 0 for verdict in by_others.values()) else ()
        for measurement in measurements:
            result = judged[measurement]
            yield replace(result, warnings=(*result.warnings, *told)) if result.by is JudgedBy.BATCH else result


def _kept_by_prior(
    store: Store, measurements: Collection[str], kinds: Sequence[Sequence[str]], settings: JudgeSettings
) -> dict[str, StoredJudgement]:
    """Return the judgements by the prior that the store has, and that judging again would give, by measurement."""
    asked = {measurement for kind in kinds for measurement in kind} & set(measurements)
    stored: dict[str, StoredJudgement] = {}
    for judgement in store.judgements():
        measurement = judgement.measurement_id
        if measurement not in asked or judgement.calibration_id != PRIOR:
            continue
        recording = store.recording(store.measurement(measurement).recording_id)
        prior = prior_for(store, measurement, settings.criteria)
        beside = rigs_in_turn(store, recording, measurement)
        if prior is not None and is_as_now(judgement, store, prior, settings.criteria, beside):
            stored[measurement] = judgement
    return stored


def _batch_calibrations(
    store: Store,
    measurements: Collection[str],
    kinds: Sequence[Sequence[str]],
    verdicts: Mapping[str, StoredJudgement],
    with_findings: Collection[str],
    criteria: Criteria,
    jobs: int,
) -> dict[str, str]:
    """Keep the calibrations that some measurements of each kind are judged by; return their ids by measurement.

    Recordings `with_findings` teach nothing.
    """
    by_batch: dict[str, str] = {}
    for kind in kinds:
        judged = [measurement for measurement in kind if measurement in verdicts]
        recordings = {store.measurement(measurement).recording_id for measurement in judged}
        asked = [measurement for measurement in judged if measurement in measurements]
        teachers = [
            measurement
            for measurement in judged
            if store.measurement(measurement).recording_id not in with_findings
            and _may_teach(store, verdicts[measurement], recordings, criteria)
        ]
        for measurement, calibration in calibrations_of_others(store, asked, teachers, criteria, jobs).items():
            store.keep_calibration(calibration)
            by_batch[measurement] = calibration.calibration_id
    return by_batch


def _may_teach(store: Store, verdict: StoredJudgement, recordings: Collection[str], criteria: Criteria) -> bool:
    """Whether a measurement has frames, all audited, that no label and no other recording speak against.

    Such another one is of the `recordings` and holds every frame of its recording, or has other data at its stamps.
    """
    measurement = store.measurement(verdict.measurement_id)
    recording = store.recording(measurement.recording_id)
    rig, beside = store.rig(measurement.rig_id), measured_rigs(store, recording)
    return measurement.measured > 0 and not (
        any(frames_not_audited(store, measurement, verdict, criteria.min_coverage, rig, beside))
        or attacked_by_labels(store, measurement.measurement_id)
        or held_by(store, recording, among=recordings)
        or conflicts_of(store, recording)
    )


WORTH_A_PROCESS = 50
"""Measurements that a process is begun for; it has to read the store's judgements and calibrations first."""


@dataclass(frozen=True, eq=False)
class _Part:
    """The measurements of a store that one process judges, by a calibration that the store keeps, if one is named."""

    folder: Path
    measurements: tuple[str, ...]
    settings: JudgeSettings
    calibration_id: str | None

    def __str__(self) -> str:
        return str(self.folder)


def judge_side_by_side(
    store: Store, measurements: Sequence[str], settings: JudgeSettings, jobs: int | None = None
) -> Iterator[JudgeResult]:
    """As `judge_all`, in so many processes at a time; None stands for as many as there are cores.

    Few measurements are judged in this process. Raises, too, what a process could not even begin with.
    """
    jobs = min(jobs or len(os.sched_getaffinity(0)), len(measurements) // WORTH_A_PROCESS)
    if jobs <= 1:
        return judge_all(store, measurements, settings)
    return _judged(store, measurements, settings, jobs)


def _judged(store: Store, measurements: Sequence[str], settings: JudgeSettings, jobs: int) -> Iterator[JudgeResult]:
    with logged(store.folder):
        named = None
        if settings.calibration is not None:
            named = settings.calibration.calibration_id
            store.keep_calibration(settings.calibration)
        without = replace(settings, calibration=None)
        parts = [_Part(store.folder, tuple(measurements[first::jobs]), without, named) for first in range(jobs)]
        results = {one.measurement_id: one for part in in_order(_judge_part, parts, jobs) for one in part}
        yield from (results[one] for one in measurements)


def _judge_part(part: _Part, _: Progress) -> list[JudgeResult]:
    store = Store.open(part.folder)
    named = store.calibration(part.calibration_id) if part.calibration_id is not None else None
    return list(judge_all(store, part.measurements, replace(part.settings, calibration=named)))
