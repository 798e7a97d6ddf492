"""Versions of calibrations over their life: kept when they are made, compared, put in force, rolled back, checked."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime, timedelta
from decimal import Decimal
from pathlib import Path

import numpy as np

from auditor import __version__
from auditor.errors import AuditorError, SettingError, ThresholdsError
from auditor.identification.cross_validation import LeftOut, clean_hours, thresholds_of
from auditor.identification.parameters import fitted_on, judging_digest
from auditor.identification.refreshing.gate import Step, steps
from auditor.identification.systems import System
from auditor.model.calibration import Calibration, CleanFrames, ConditionRate
from auditor.model.measurement import Statistic
from auditor.model.rig import Triple
from auditor.model.settings import Criteria
from auditor.model.verdict import JUDGING_VERSION, Method
from auditor.pipeline.calibrations.clean import CleanMeasurements
from auditor.pipeline.calibrations.making import MadeCalibration
from auditor.pipeline.clean_frames import clean_frames_of
from auditor.pipeline.judged import Judge, JudgeResult, JudgeSettings
from auditor.store.calibrations import make_calibration, writing_calibration
from auditor.store.log.runs import logged
from auditor.store.records import RecordingRecord, StoredJudgement, StoredMeasurement
from auditor.store.store import Store
from auditor.store.versions.history import (
    EntryIntoForce,
    History,
    histories,
    history_of,
    put_first_in_force,
    put_in_force,
)
from auditor.store.versions.records import (
    CalibrationVersion,
    UsedRecording,
    VersionOutcome,
    read_version,
    write_version,
)

GIVEN = "given as clean"
"""Why a recording is in a calibration that auditor calibrate made."""


@dataclass(frozen=True)
class CalibrationEntry:
    """A calibration that a store keeps, how it was made, and whether it is in force.

    `left_out` is each of its clean recordings judged by the others, `left_out_by_paper` the same by the paper's method.
    """

    version: CalibrationVersion
    left_out: tuple[LeftOut, ...]
    left_out_by_paper: tuple[LeftOut, ...]
    in_force: bool


@dataclass(frozen=True)
class Extent:
    """How much a calibration was made of: its frames, the hours that they cover, and what r they resolve."""

    frames: int
    hours: float
    resolves_r: float | None


def extent_of(calibration: Calibration) -> Extent:
    """The extent of a calibration whose recordings are at hand."""
    samples = Counter[tuple[Statistic, Triple]]()
    for clean_frames in calibration.clean:
        samples.update(clean_frames.measured)
    return Extent(sum(one.frames for one in calibration.clean), clean_hours(calibration), _resolves(samples))


def keep_calibrated(store: Store, made: MadeCalibration, *, made_by: str = "calibrate") -> CalibrationEntry:
    """Keep a calibration that a person made, and put it in force where none is for its rig kind. Raises StoreError."""
    calibration, judged = made.calibration, list[tuple[LeftOut, LeftOut]]()
    seen, used = _looked_at(made.clean), list[UsedRecording]()
    path = store.path("calibrations", calibration.calibration_id)
    with logged(store.folder) as entry, writing_calibration(calibration, path, entry.announce) as add:
        for (source, measurement), verdict in zip(made.clean.chosen, made.judged_by_others(), strict=True):
            add(verdict.clean)
            judged.append((verdict.robust, verdict.paper))
            given = taken(replace(seen[source.folder, measurement], reason=GIVEN), verdict.clean)
            findings, incidents = verdict.robust.findings, verdict.robust.incidents
            used.append(replace(given, findings_by_others=findings, incidents_by_others=incidents))
    used += [replace(seen[source.folder, known], reason=reason) for source, known, reason in made.clean.out]
    before = history_of(histories(store), calibration).in_force
    first = before in (None, calibration.calibration_id)
    robust, paper = zip(*judged, strict=True)
    hours = float(np.sum([one.hours for one in robust]))
    version = version_of(
        calibration,
        Extent(sum(one.frames for one in robust), hours, _resolves(made.samples)),
        used,
        made.asked.r,
        made_by=made_by,
        parent=None if first else before,
        outcome=VersionOutcome.PROMOTED if first else VersionOutcome.CANDIDATE,
        frames=made.asked.frames,
        recounted=made.asked.recount,
    )
    if read_version(store, calibration.calibration_id) is None:
        write_version(store, version)
    return CalibrationEntry(
        version, robust, paper if len(calibration.recordings) > 1 else (), put_first_in_force(store, calibration)
    )


def _looked_at(clean: CleanMeasurements) -> dict[tuple[Path, str], UsedRecording]:
    """What is said of each measurement, by its store's folder and its id."""
    used_recordings: dict[tuple[Path, str], UsedRecording] = {}
    every = [*clean.chosen, *((store, known) for store, known, _ in clean.out)]
    for store in {store.folder: store for store, _ in every}.values():
        stored = [store.measurement(known) for of, known in every if of.folder == store.folder]
        some = store.only(recordings={one.recording_id for one in stored})
        recordings = {one.recording_id: one for one in some.recordings()}  # at once: one by one takes far longer
        for measurement in stored:
            used_recordings[store.folder, measurement.measurement_id] = looked_at(
                measurement, recordings[measurement.recording_id]
            )
    return used_recordings


def looked_at(stored: StoredMeasurement, recording: RecordingRecord) -> UsedRecording:
    """What is said of a recording that may be learnt from, before it is decided."""
    return UsedRecording(
        recording_id=stored.recording_id,
        measurement_id=stored.measurement_id,
        name=recording.name,
        vehicle=recording.vehicle,
        day=day_of(recording),
        included=False,
        reason="",
        frames=stored.measured,
        weather=recording.weather,
    )


def taken(used: UsedRecording, clean: CleanFrames) -> UsedRecording:
    """The recording as one that a calibration was made of, by these frames."""
    return replace(used, included=True, frames=clean.frames, level=_level(clean))


def day_of(recording: RecordingRecord) -> date | None:
    """The day of a recording: as it was said, or by its stamps where they tell the time."""
    if recording.date is not None or recording.from_ns is None or recording.clock != "utc":
        return recording.date
    return datetime.fromtimestamp(recording.from_ns / 1e9, UTC).date()


def latest_day() -> date:
    """The last day that a recording can be of: tomorrow in UTC, since days begin earlier in the east."""
    return datetime.now(UTC).date() + timedelta(days=1)


def version_of(
    calibration: Calibration,
    extent: Extent,
    used: Sequence[UsedRecording],
    r: Decimal,
    *,
    made_by: str,
    parent: str | None,
    outcome: VersionOutcome,
    reasons: Sequence[str] = (),
    provisional: bool = False,
    frames: range | None = None,
    recounted: bool = False,
    conditions: Sequence[ConditionRate] = (),
) -> CalibrationVersion:
    """How a calibration is made now."""
    judged = [one for one in used if one.included and one.findings_by_others is not None]
    return CalibrationVersion(
        calibration_id=calibration.calibration_id,
        kind=str(calibration.rig_kind),
        matcher=calibration.procedure.matcher,
        counting_version=calibration.procedure.counting_version,
        made_at=datetime.now(UTC),
        made_by=made_by,
        parent=parent,
        provisional=provisional,
        outcome=outcome,
        reasons=tuple(reasons),
        frames=extent.frames,
        hours=extent.hours,
        resolves_r=extent.resolves_r,
        r=r,
        frames_by_others=sum(one.frames for one in judged),
        findings_by_others=sum(one.findings_by_others or 0 for one in judged),
        incidents_by_others=sum(one.incidents_by_others or 0 for one in judged),
        first_frame=frames.start if frames is not None else None,
        last_frame=frames.stop - 1 if frames is not None else None,
        recounted=recounted,
        auditor_version=__version__,
        judging_version=JUDGING_VERSION,
        rules=judging_digest(fitted_on(calibration.procedure)),
        recordings=tuple(used),
        conditions=tuple(conditions),
    )


def promote(store: Store, calibration: Calibration, reason: str = "") -> History:
    """Put a calibration in force because a person says so; returns the history of before. Raises StoreError."""
    before = history_of(histories(store), calibration)
    put_in_force(store, calibration, EntryIntoForce.PROMOTED, reason)
    return before


def history_called(store: Store, name: str | None) -> History:
    """The history that a calibration, named by the beginning of its id, was part of; the only one where there is none.

    Raises SettingError where there are several, or none.
    """
    with_moves = [one for one in histories(store) if one.moves]
    fitting = [one for one in with_moves if name is None or any(m.calibration_id.startswith(name) for m in one.moves)]
    if len(fitting) == 1:
        return fitting[0]
    problem = "the store has versions of several rig kinds" if fitting else "no such calibration was ever in force"
    ids = ", ".join((one.in_force or "")[:12] for one in fitting or with_moves)
    raise SettingError(
        problem, where=name or "calibration", remedy=f"name one that is in force: {ids or 'there is none'}"
    )


def roll_back(store: Store, history: History, reason: str = "") -> tuple[Calibration, list[JudgeResult]]:
    """Return to the version of before, and judge again, by the same criteria, what the withdrawn one had judged.

    Judgements that were reached by the version of before come back byte for byte: they follow from what was measured.
    Raises StoreError, and SettingError where there is no version of before.
    """
    if history.previous is None:
        raise SettingError(
            "there is no version of before",
            where=f"calibration {history.in_force}",
            remedy="promote another: auditor calibration list shows them",
        )
    withdrawn, restored = history.in_force, store.calibration(history.previous)
    put_in_force(store, restored, EntryIntoForce.ROLLED_BACK, reason, after=withdrawn)
    again = [one for one in store.current_judgements().values() if one.calibration_id == withdrawn]
    return restored, [_again(store, one) for one in again]


def _again(store: Store, judgement: StoredJudgement) -> JudgeResult:
    criteria = Criteria(
        judgement.r,
        Method(judgement.method),
        judgement.statistic or Statistic.GATED,
        judgement.incidents_per_hour,
        transfer=judgement.transferred,
        recount=judgement.recounted,
    )
    return Judge(store, JudgeSettings(criteria)).judge(judgement.measurement_id)


def problems_of(store: Store, calibration_id: str) -> Iterator[str]:
    """What is wrong with a calibration: its content, how it was made, or that the store gives another now."""
    try:
        calibration = store.calibration(calibration_id)
        version = read_version(store, calibration_id)
    except AuditorError as error:
        yield str(error)
        return
    if version is None:
        return
    if sorted({one.recording_id for one in version.included}) != list(calibration.recordings):
        yield "it was made of other recordings than are named"
        return
    there = [one.measurement_id for one in version.included if store.has_measurement(one.measurement_id)]
    if len(there) < len(version.included):
        return
    frames = range(version.first_frame, (version.last_frame or 0) + 1) if version.first_frame is not None else None
    try:
        clean = [clean_frames_of(store, known, frames, recount=version.recounted) for known in there]
    except AuditorError as error:
        yield f"it cannot be made again: {error}"
        return
    again = make_calibration(calibration.rig_kind, calibration.procedure, clean)
    if again.calibration_id != calibration_id:
        yield f"made again from the store it is another: {again.calibration_id}"


def remade(store: Store, calibration_id: str) -> bool:
    """Whether all that a calibration was made of is in the store, so that `problems_of` makes it again."""
    version = read_version(store, calibration_id)
    return version is not None and all(store.has_measurement(one.measurement_id) for one in version.included)


def steps_between(a: Calibration, b: Calibration, r: Decimal) -> list[Step]:
    """The steps of the checks that count, the largest rise first. Raises ThresholdsError where rig kinds differ."""
    if not a.rig_kind.matches(b.rig_kind):
        raise ThresholdsError(
            f"they are of two rig kinds: {a.rig_kind}, and {b.rig_kind}",
            where=f"calibrations {a.calibration_id[:12]} and {b.calibration_id[:12]}",
            remedy="compare two of one rig kind",
        )
    system = system_of_calibration(a)
    return steps(thresholds_of(a.clean, system, r), thresholds_of(b.clean, system, r), system)


def system_of_calibration(calibration: Calibration) -> System:
    """What the frames of a calibration's rig kind are judged by: its own sensor checks and triples."""
    kind = calibration.rig_kind
    sensors = tuple(range(0 if kind.lidar else 1, len(kind.sizes_px) + 1))
    checks = dict.fromkeys(check for one in calibration.clean for check in one.statistics)
    triples = dict.fromkeys(triple for one in calibration.clean for _, triple in one.errors)
    return System(tuple(checks), tuple(triples), sensors, fitted_on=fitted_on(calibration.procedure))


def _resolves(samples: Mapping[tuple[Statistic, Triple], int]) -> float | None:
    fewest = min(samples.values(), default=0)
    return 1 / fewest if fewest else None


def _level(clean: CleanFrames) -> float | None:
    levels = [values for (name, _), values in clean.brightness.items() if name == "level"]
    samples = np.concatenate(levels) if levels else np.zeros(0)
    samples = samples[~np.isnan(samples)]
    return float(np.median(samples)) if samples.size else None
