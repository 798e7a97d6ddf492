"""The chain for one recording, and the judging of what a store holds: above the rooms, it knows them all."""

import platform
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from decimal import Decimal
from importlib.metadata import version
from pathlib import Path
from time import perf_counter

import numpy as np

from auditor import __version__
from auditor.elements import rig_elements
from auditor.errors import RecordingError, ThresholdsError
from auditor.evidence import PictureBook, measure, use_one_thread
from auditor.evidence.matchers import Matcher, MatcherOptions, find_matcher
from auditor.frames import Frame, SensorState
from auditor.identification.local_ratio import local_ratios
from auditor.identification.thresholds import check_calibration, thresholds_at
from auditor.identification.verdicts import judge_frames
from auditor.recordings import (
    Origin,
    Recording,
    Survey,
    find_rigs,
    open_recording,
    survey,
    synchronise,
    told_rig,
)
from auditor.results import Calibration, Procedure, Statistic
from auditor.rig import Rig, RigKind, Triple
from auditor.store import (
    JudgementRecord,
    MeasurementRecord,
    Picture,
    RecordingRecord,
    Store,
    StoredJudgement,
    StoredMeasurement,
    make_calibration,
    measurement_id,
)

METHOD = "paper"
"""How verdicts are reached: disparity errors against thresholds, Algorithm 2."""

_VERSIONED = ("mcap", "numpy", "opencv-python-headless", "pyarrow", "rosbags")


_NO_NETWORK = MatcherOptions()
_UNKNOWN = Origin()


@dataclass(frozen=True)
class MeasureTask:
    """One recording to be measured into a store.

    `rig` is a rig.toml that stands in for what the recording says; what `origin` knows goes before it, too.
    """

    recording: Path
    store: Path
    matcher: str = "sgbm"
    network: MatcherOptions = _NO_NETWORK
    rig: Path | None = None
    origin: Origin = _UNKNOWN

    def __str__(self) -> str:
        return str(self.recording)


@dataclass(frozen=True)
class Measured:
    """A recording that is in the store: its measurements, one a rig, and whether any of it was measured just now."""

    recording: Path
    recording_id: str
    measurement_ids: tuple[str, ...]
    frames: int
    fresh: bool
    damage: tuple[str, ...]


def measure_recording(task: MeasureTask, progress: Callable[[str, int], None]) -> Measured:
    """Measure every frame of a recording with each of its rigs; what is finished already is not measured again.

    Raises RecordingError, RigError, SettingError and StoreError.
    """
    use_one_thread()
    matcher = find_matcher(task.matcher, task.network)
    store = Store.open(task.store, create=True)
    with open_recording(task.recording) as recording:
        surveyed = survey(recording)
        rigs = rigs_of(surveyed, task.rig)
        procedure = Procedure(matcher.name, matcher.settings)
        ids = tuple(measurement_id(recording.recording_id, rig.rig_id, procedure) for rig in rigs)
        todo = [rig for rig, known in zip(rigs, ids, strict=True) if not store.has_measurement(known)]
        for rig in todo:
            store.write_rig(rig)
            _measure(recording, surveyed, rig, matcher, procedure, store, progress)
        measurements = [store.measurement(known) for known in ids]
        damage = tuple(dict.fromkeys(piece for m in measurements for piece in m.damage))
        # A scan may have been killed after its last measurement and before it could keep the recording itself.
        known = store.recording(recording.recording_id) if store.has_recording(recording.recording_id) else None
        record = _recording_record(recording, task, known, measurements, damage)
        if todo or record != known:
            store.write_labels(recording.recording_id, recording.labels(), rigs[0])
            store.write_recording(record)
        return Measured(
            recording=task.recording,
            recording_id=recording.recording_id,
            measurement_ids=ids,
            frames=sum(m.frames for m in measurements),
            fresh=bool(todo),
            damage=damage,
        )


def rigs_of(surveyed: Survey, rig_file: Path | None = None) -> tuple[Rig, ...]:
    """The rigs that a recording is audited with: its own, or the one of a rig file. Raises RigError."""
    return find_rigs(surveyed) if rig_file is None else (told_rig(rig_file, surveyed),)


def _measure(
    recording: Recording,
    surveyed: Survey,
    rig: Rig,
    matcher: Matcher,
    procedure: Procedure,
    store: Store,
    progress: Callable[[str, int], None],
) -> None:
    started = perf_counter()
    known = measurement_id(recording.recording_id, rig.rig_id, procedure)
    elements = rig_elements(rig)
    pictures = PictureBook()
    stream = synchronise(recording, rig, surveyed, colour=matcher.colour)
    with store.frames_writer(known, rig) as writer:
        for done, frame in enumerate(stream, start=1):
            if isinstance(frame, Frame):
                measurement, evidence = measure(frame, rig, matcher)
                writer.add(measurement, local_ratios(elements, measurement.cells, measurement.shares))
                pictures.offer(measurement, evidence)
            else:
                writer.skip(frame)
            progress(recording.path.name, done)
        if writer.measured == 0:
            raise RecordingError(
                "no frame with three overlapping sensors could be put together",
                where=recording.path,
                remedy="see auditor inspect for its topics and sensors",
            )
        for number, picture in pictures.pages():
            store.write_picture(known, Picture(number, picture.reference, picture.views, picture.mask))
        writer.commit(
            MeasurementRecord(
                recording_id=recording.recording_id,
                rig_id=rig.rig_id,
                procedure=procedure,
                balance=stream.balance,
                versions=_versions(),
                measured_at=datetime.now(UTC),
                seconds=perf_counter() - started,
                damage=tuple(str(piece) for piece in stream.damage),
                offsets_ns=tuple(stream.timing.offset_ns[sensor] for sensor in rig.sensors),
                clock_jumps=stream.clock_jumps,
            )
        )


def _recording_record(
    recording: Recording,
    task: MeasureTask,
    known: RecordingRecord | None,
    measurements: Sequence[StoredMeasurement],
    damage: tuple[str, ...],
) -> RecordingRecord:
    origin = task.origin.over(Origin.of_metadata(recording.metadata()))
    if known is not None:
        origin = origin.over(Origin(known.vehicle, known.date, known.drive))
    return RecordingRecord(
        recording_id=recording.recording_id,
        name=recording.path.name,
        path=str(recording.path.resolve()),
        files=tuple(file.name for file in recording.files),
        size_bytes=sum(file.stat().st_size for file in recording.files),
        clock=recording.clock,
        from_ns=min((m.first_stamp_ns for m in measurements if m.first_stamp_ns is not None), default=None),
        to_ns=max((m.last_stamp_ns for m in measurements if m.last_stamp_ns is not None), default=None),
        vehicle=origin.vehicle,
        date=origin.date,
        drive=origin.drive,
        damage=damage,
    )


def _versions() -> dict[str, str]:
    return {"auditor": __version__, "python": platform.python_version()} | {name: version(name) for name in _VERSIONED}


def calibrate(measurements: Sequence[tuple[Store, str]], frames: range | None = None) -> Calibration:
    """Collect the disparity errors of clean measurements, of one rig kind and procedure.

    `frames` restricts it to these frame numbers of each measurement. Raises ThresholdsError where kinds or procedures
    differ or nothing was measured.
    """
    samples: dict[tuple[Statistic, Triple], list[float]] = {}
    kinds: list[RigKind] = []
    procedures: list[Procedure] = []
    recordings: set[str] = set()
    for store, known in measurements:
        measurement = store.measurement(known)
        rig = store.rig(measurement.rig_id)
        kinds.append(rig.kind)
        procedures.append(measurement.procedure)
        _refuse_mixture(kinds, procedures)
        recordings.add(measurement.recording_id)
        for statistic in Statistic:
            errors = store.load_errors(known, statistic)
            chosen = [frames is None or int(number) in frames for number in errors.frames]
            for triple, E in zip(rig.triples, errors.E[chosen].T, strict=True):
                samples.setdefault((statistic, triple), []).extend(E[~np.isnan(E)].tolist())
    if not any(samples.values()):
        raise ThresholdsError(
            "no disparity errors to calibrate on", remedy="give clean recordings that can be measured, and their frames"
        )
    return make_calibration(kinds[0], procedures[0], recordings, samples)


def _refuse_mixture(kinds: Sequence[RigKind], procedures: Sequence[Procedure]) -> None:
    """Compare the last with the first."""
    remedy = "calibrate each of them on its own"
    if not kinds[0].matches(kinds[-1]):
        raise ThresholdsError(f"two rig kinds in one calibration: {kinds[0]}, and {kinds[-1]}", remedy=remedy)
    if procedures[0] != procedures[-1]:
        matchers = f"{procedures[0].matcher}, and {procedures[-1].matcher}"
        raise ThresholdsError(f"two procedures in one calibration: {matchers}", remedy=remedy)


def latest_calibration(store: Store, measurement: str) -> Calibration | None:
    """The newest calibration in the store that holds for a measurement's rig kind and procedure."""
    stored = store.measurement(measurement)
    kind = store.rig(stored.rig_id).kind
    fitting = [c for c in store.calibrations() if c.procedure == stored.procedure and c.rig_kind.matches(kind)]
    return max(fitting, key=_made_at, default=None)


def _made_at(calibration: Calibration) -> tuple[datetime, str]:
    return calibration.calibrated_at or datetime.min.replace(tzinfo=UTC), calibration.calibration_id


def judge_measurement(
    store: Store,
    measurement: str,
    calibration: Calibration,
    r: Decimal,
    statistic: Statistic = Statistic.GATED,
    *,
    transfer: bool = False,
    strict: bool = False,
) -> StoredJudgement:
    """Judge every frame of a measurement and keep the verdicts.

    `strict` refuses an r that the samples cannot resolve. Raises ThresholdsError where the thresholds do not fit.
    """
    stored = store.measurement(measurement)
    rig = store.rig(stored.rig_id)
    transferred = check_calibration(calibration, rig_kind=rig.kind, procedure=stored.procedure, transfer=transfer)
    thresholds = thresholds_at(calibration, statistic, r, transferred=transferred)
    if strict and not thresholds.resolvable:
        fewest = min(thresholds.samples.values())
        raise ThresholdsError(
            f"r = {r} is not resolvable with {fewest} clean samples: it would be judged as r = 0",
            where=f"calibration {calibration.calibration_id}",
            remedy=f"take r = 0 or at least {1 / fewest:.2g}, or calibrate on more clean frames",
        )
    errors = store.load_errors(measurement, statistic)
    verdicts = judge_frames(errors.E, thresholds, rig.triples, rig.sensors, _missing(rig, errors.states.tolist()))
    record = JudgementRecord(measurement, METHOD, thresholds, judged_at=datetime.now(UTC))
    rows = zip(errors.frames.tolist(), errors.stamps_ns.tolist(), verdicts, strict=True)
    if calibration.calibration_id not in store.ids("calibrations"):
        store.write_calibration(calibration)
    store.write_judgement(record, rows)
    current = store.current_judgement(measurement)
    assert current is not None
    return current


def _missing(rig: Rig, states: Iterable[Sequence[str]]) -> list[frozenset[int]]:
    return [
        frozenset(s for s, state in zip(rig.sensors, row, strict=True) if state != SensorState.PRESENT)
        for row in states
    ]
