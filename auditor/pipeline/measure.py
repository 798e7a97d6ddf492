"""One recording, from its messages to finished measurements in a store: one for each of its rigs."""

import platform
from collections.abc import Callable, Collection, Generator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, closing
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from itertools import islice
from pathlib import Path
from time import perf_counter

from auditor import __version__
from auditor.errors import RigError
from auditor.identification.scores import standing_out
from auditor.identification.statistics import sensor_statistics
from auditor.identification.transfer import OPENCV, OPENCV_CPU
from auditor.measurement import (
    CalibrationMonitor,
    FaultFeatures,
    FewerReturns,
    FrameArrays,
    PictureBook,
    RepeatedData,
    instruction_sets,
    localise,
    measure_stream,
    use_one_thread,
)
from auditor.measurement.disparity.matchers import Matcher, find_matcher, libraries, preflight
from auditor.model.checks import IMAGE_CHECKS, SensorCheck, rig_sensor_checks
from auditor.model.coverage import Against, coverage_line, with_shortfall
from auditor.model.frames import Frame, SkippedFrame
from auditor.model.measurement import Measurement
from auditor.model.rig import Rig
from auditor.model.text import storable
from auditor.pipeline.geometry import doubts_of, rigs_through, rigs_to_begin_with
from auditor.pipeline.measured import (
    CellsKept,
    MeasureResult,
    MeasureTask,
    damage_of,
    measured_of,
    procedure_by,
    procedures_by,
    sighted,
    stamp_of,
)
from auditor.recordings import (
    Changes,
    FarAheadError,
    FrameStream,
    FrameTimes,
    Location,
    Origin,
    PoseMessages,
    Recording,
    RigInForce,
    RigsInForce,
    Survey,
    format_of,
    in_turn,
    located,
    open_recording,
    read_poses,
    share_a_read,
    survey,
    synchronise,
)
from auditor.resources import plug_ins
from auditor.store.files import locked
from auditor.store.frames_writer import FramesWriter
from auditor.store.log.runs import logged
from auditor.store.maintenance.removal import remove_counted_earlier, remove_measurement
from auditor.store.records import MeasurementRecord, RecordingRecord, StoredMeasurement, content_id, measurement_id
from auditor.store.store import Store

_PREFLIGHT_FRAMES = 3
_VERSIONED = ("mcap", "numpy", OPENCV, "pyarrow", "rosbags")


def measure_recording(task: MeasureTask, progress: Callable[[str, int], None]) -> MeasureResult:
    """Measure every frame of a recording with each of its rigs; what is finished already only where the task says so.

    Raises RecordingError, RigError, SettingError and StoreError.
    """
    use_one_thread()
    matcher = find_matcher(task.matcher, task.network)
    store = Store.open(task.store, create=True)
    procedures = procedures_by(matcher)
    stamp = stamp_of(task.recording, procedures, task.rig)
    with open_recording(task.recording) as recording, logged(store.folder) as entry:
        surveyed = survey(recording)  # first: what it reads is hashed meanwhile
        where = replace(task.location, path=recording.path)
        entry.used("recording", recording.recording_id, storable(str(where)))
        if libraries(matcher):  # a network, whose settings have the hash of its file
            entry.used("network", content_id(matcher.settings), f"{matcher.name} {matcher.settings}")
        by_id, fresh = _Job(task, recording, store, matcher, progress).measure(surveyed)
        ids = tuple(known for known in by_id if store.has_measurement(known))
        measurements = [store.measurement(known) for known in ids]
        unchanged = stamp if stamp == stamp_of(task.recording, procedures, task.rig) else None
        with locked(store.folder):
            # A scan may have been killed after its last measurement and before it could keep the recording itself.
            kept = store.recording(recording.recording_id) if store.has_recording(recording.recording_id) else None
            record = _recording_record(recording, task, where, kept, measurements, unchanged)
            if fresh:
                record = replace(record, superseded_by=None, conflicts=None)  # it is compared with the others anew
            if record != kept:
                store.write_labels(recording.recording_id, recording.labels(), next(iter(by_id.values())).rig)
                store.write_recording(record)
        return measured_of(where.here, recording.recording_id, measurements, fresh=fresh)


@dataclass(frozen=True)
class _Job:
    """The measuring of one recording into a store."""

    task: MeasureTask
    recording: Recording
    store: Store
    matcher: Matcher
    progress: Callable[[str, int], None]
    began: datetime = field(default_factory=lambda: datetime.now(UTC))

    def measurement_id(self, rig: Rig) -> str:
        """The id of the measurement with a rig."""
        procedure = procedure_by(self.matcher, rig.kind.compared_to)
        return measurement_id(self.recording.recording_id, rig.rig_id, procedure)

    def measure(self, surveyed: Survey) -> tuple[dict[str, RigInForce], bool]:
        """Measure with each rig what the store lacks; the rigs by measurement, and whether any was measured now.

        Calibrations change in hardly any recording. So it is measured with the rigs of its beginning, and only where
        that read meets a change, or there is nothing to measure, is it read through for the rigs that follow.
        """
        beginning = rigs_to_begin_with(self.recording, surveyed) if self.task.rig is None else None
        if beginning is not None:
            rigs_in_force, changes = beginning
            rigs, todo = self._todo(rigs_in_force)
            if todo and self._measure_all(todo, rigs_in_force, changes):
                return rigs, True
        rigs_in_force = rigs_through(self.recording, surveyed, self.task.rig)
        rigs, todo = self._todo(rigs_in_force)
        self._measure_all(todo, rigs_in_force)
        return rigs, bool(todo)

    def _todo(self, rigs_in_force: RigsInForce) -> tuple[dict[str, RigInForce], dict[str, RigInForce]]:
        """The rigs by measurement, and those of them that are to be measured."""
        rigs = {self.measurement_id(one.rig): one for one in rigs_in_force.rigs}
        todo = {known: one for known, one in rigs.items() if self.task.again or not self.store.has_measurement(known)}
        return rigs, todo

    def _measure_all(
        self, todo: Mapping[str, RigInForce], rigs_in_force: RigsInForce, changes: Changes | None = None
    ) -> bool:
        """Measure with some rigs; False, and nothing is kept, where `changes` finds one in the first read."""
        try:
            for rigs in self._together(todo.values()):
                if not self._measure(rigs, rigs_in_force, changes):
                    return False
                changes = None
        except FarAheadError:
            if changes is not None:
                return False
            for rig in todo.values():
                self._measure([rig], rigs_in_force, None)
        return True

    def _together(self, rigs: Collection[RigInForce]) -> list[list[RigInForce]]:
        """The rigs in groups that are measured in one read: all, where each can read along with the others.

        A network takes the pairs of several frames at once, in a thread of its own: there each rig has a read.
        """
        together = all(one.reads_along for one in rigs) and not libraries(self.matcher)
        return [list(rigs)] if together else [[one] for one in rigs]

    def _measure(self, rigs: Sequence[RigInForce], rigs_in_force: RigsInForce, changes: Changes | None) -> bool:
        """Measure with some rigs in one read; False where `changes` finds that a calibration changes.

        Then nothing is kept. Raises FarAheadError, and nothing is kept, where they cannot share a read.
        """
        recording = self.recording
        streams = [synchronise(recording, one.rig, one.survey, colour=True, stretches=one.stretches) for one in rigs]
        passed = PoseMessages(recording) if all(one.survey.interleaved for one in rigs) else None
        if libraries(self.matcher):
            for rig, stream in zip(rigs, streams, strict=True):
                self._preflight(rig.rig, stream)
        if passed is not None:
            share_a_read(recording, streams, [passed] if changes is None else [changes, passed])
        done = [0] * len(rigs)
        with ExitStack() as stack:
            measurings = [
                _Measuring(self, one, stream, stack.enter_context(self._writer(one.rig)))
                for one, stream in zip(rigs, streams, strict=True)
            ]
            for place, frames in in_turn([stack.enter_context(closing(one.frames())) for one in measurings]):
                done[place] = frames
                self.progress(recording.path.name, sum(done))
                if changes is not None and changes.any:
                    return False
            if changes is not None and changes.any:
                return False
            for measuring in measurings:
                measuring.finish(rigs_in_force, passed)
        return True

    def _writer(self, rig: Rig) -> AbstractContextManager[FramesWriter]:
        self.store.write_rig(rig)
        return self.store.frames_writer(self.measurement_id(rig), rig)

    def _preflight(self, rig: Rig, frames: FrameStream) -> None:
        """Say what a network will cost, and what looks wrong on the first frames, before its long work begins."""
        count = sum(1 for _ in self.recording.messages({rig.topic(rig.n)}))
        first = list(islice((frame for frame in frames if isinstance(frame, Frame)), _PREFLIGHT_FRAMES))
        for remark in preflight(self.matcher, rig, first, count):
            self.progress(remark, 0)


class _Measuring:
    """The measuring of a recording with one rig: after its `frames`, `finish` makes visible what is kept."""

    def __init__(self, job: _Job, in_force: RigInForce, stream: FrameStream, writer: FramesWriter) -> None:
        self._job, self._in_force, self._stream, self._writer = job, in_force, stream, writer
        self._cells, self._thumbnails = CellsKept(job.task.cells), PictureBook(job.task.pictures)
        self._check, self._repeated, self._fault_features = CalibrationMonitor(), RepeatedData(), FaultFeatures()
        self._fewer = FewerReturns()
        self._sensor_checks = rig_sensor_checks(in_force.rig)
        self._done, self._spent_s = 0, 0.0

    def frames(self) -> Generator[int]:
        """Measure and write every frame; yields how many frames, skipped ones included, are done."""
        stream, since_s = self._stream, perf_counter()
        with closing(measure_stream(self._fewer.watch(stream), self._in_force.rig, self._job.matcher)) as measured:
            for self._done, item in enumerate(measured, start=1):
                if isinstance(item, SkippedFrame):
                    self._writer.skip(item)
                else:
                    self._keep(*item)
                self._spent_s += perf_counter() - since_s
                yield self._done
                since_s = perf_counter()
        # Behind the last frame others read the recording, too.
        self._coverage, self._balance = stream.coverage, stream.balance
        self._damage = (*map(str, stream.damage), *stream.undecoded)

    def _keep(self, counted: Measurement, evidence: FrameArrays) -> None:
        statistics = sensor_statistics(self._sensor_checks, counted.cells, counted.shares)
        unusual = standing_out(self._sensor_checks, statistics)
        regions = localise(evidence, unusual.sensors, self._in_force.rig)
        measurement = replace(counted, fault_features=self._fault_features.update(evidence), regions=regions)
        kept = self._cells.of(counted.stamp_ns, unusual=unusual.cells)
        unmasked = unmasked_statistics(self._sensor_checks, counted)
        self._writer.add(measurement, statistics, unmasked, with_cells=kept)
        self._repeated.add(counted.fingerprints)
        self._thumbnails.offer(counted, evidence, unusual=bool(unusual.sensors))
        self._check.offer(evidence, measurement.fault_features)

    def finish(self, rigs_in_force: RigsInForce, passed: PoseMessages | None) -> None:
        """Keep the measurement of a rig, one of those that were found; it becomes visible with the last write.

        An earlier measurement goes with its judgements before the first table of the new one is put in its place: a
        store has one, the other or none of the two, and never parts of both. What another process finished meanwhile
        stays, which may be reading it. Nothing is kept of a rig that came into force behind the last frame.
        """
        job, rig, stream, writer = self._job, self._in_force.rig, self._stream, self._writer
        recording, store, measurement = job.recording, job.store, job.measurement_id(rig)
        if self._done == 0 and self._in_force.stretches[0].from_ns is not None:
            return
        others = [one.rig for one in rigs_in_force.rigs if one.stretches == self._in_force.stretches]
        beside = {topic for one in others for topic in map(one.topic, one.sensors)}
        beside -= {*map(rig.topic, rig.sensors)}  # what another rig audits is not left out
        coverage = tuple(one for one in self._coverage if one.topic not in beside)
        coverage = with_shortfall(coverage, Against.SAME_DATA, self._repeated.counts)
        coverage = with_shortfall(coverage, Against.FEWER_RETURNS, self._fewer.counts)
        if writer.measured == 0:
            why = filter(None, (coverage_line(coverage), *self._damage))
            raise RigError(
                "no frame with three overlapping sensors could be put together",
                where=recording.path,
                remedy="; ".join((*why, "see auditor inspect for its topics and sensors")),
            )
        withheld = rigs_in_force.withheld or self._withheld_together(rigs_in_force)
        doubts = doubts_of(recording, self._in_force, self._check, withheld, stream)
        record = MeasurementRecord(
            recording_id=recording.recording_id,
            rig_id=rig.rig_id,
            procedure=procedure_by(job.matcher, rig.kind.compared_to),
            balance=self._balance,
            versions=_versions(job.matcher),
            measured_at=datetime.now(UTC),
            seconds=self._spent_s,
            damage=self._damage,
            calibration_warnings=(*doubts.calibration_warnings, *rigs_in_force.remarks),
            withheld=doubts.withheld or None,
            remarks=(
                *job.task.location.remarks,
                *doubts.remarks,
                *self._in_force.survey.transform_problems,
                *(f"{rig.name(sensor)}: {fewer}" for sensor, fewer in self._fewer.first.items()),
            ),
            offsets_ns=tuple(stream.timing.offset_ns[sensor] for sensor in rig.sensors),
            clock_jumps=stream.clock_jumps,
            coverage=coverage,
        )
        poses = read_poses(recording, FrameTimes(*writer.frames), passed)  # the recording's damage may be theirs
        recording.check_unchanged()
        for pose in poses:
            writer.add_pose(pose)
        with locked(store.folder):
            if store.has_measurement(measurement):
                store.forget(measurement)
                if not job.task.again or store.measurement(measurement).measured_at > job.began:
                    return
                remove_measurement(store, measurement)
            files = [file for picture in self._thumbnails.pages() for file in store.write_picture(measurement, picture)]
            writer.commit(replace(record, pose_topics=poses.topics), files)
        if job.task.again:
            remove_counted_earlier(store, measurement)

    def _withheld_together(self, rigs_in_force: RigsInForce) -> str:
        """Why no verdict may be given on a rig that has all of this one's sensors and more; empty where it may.

        A camera and a LiDAR tell less of their stamps and places than two cameras and the LiDAR do.
        """
        store, larger = self._job.store, map(self._job.measurement_id, rigs_in_force.larger_than(self._in_force))
        return next(
            (why for one in larger if store.has_measurement(one) and (why := store.measurement(one).withheld)), ""
        )


def unmasked_statistics(
    sensor_checks: Sequence[SensorCheck], measurement: Measurement
) -> tuple[float | None, ...] | None:
    """The statistics of those sensor checks that are others without the LiDAR, None of the rest; None where all are.

    The LiDAR's range masks belong to pairs: a check of several voters is another where one of them is.
    """
    if not measurement.unmasked_cells:
        return None
    changed = {(one.sensor, one.other) for one in measurement.unmasked_cells}
    others = [
        one
        for one in sensor_checks
        if one.check in IMAGE_CHECKS and any((one.sensor, other) in changed for other in one.others)
    ]
    statistics = sensor_statistics(others, {**measurement.cells, **measurement.unmasked_cells}, {})
    of_check = dict(zip(others, statistics, strict=True))
    return tuple(of_check.get(one) for one in sensor_checks)


def _recording_record(
    recording: Recording,
    task: MeasureTask,
    where: Location,
    record: RecordingRecord | None,
    measurements: Sequence[StoredMeasurement],
    stamp: str | None,
) -> RecordingRecord:
    origin = task.declared().over(Origin.of_metadata(recording.metadata()))
    if record is not None:
        origin = origin.over(Origin(record.vehicle, record.date, record.drive, record.weather))
    ids = [one.measurement_id for one in measurements]
    before = record.sightings if record is not None else ()
    sightings = sighted(before, storable(where.name), storable(where.place), stamp, ids)
    return RecordingRecord(
        recording_id=recording.recording_id,
        name=sightings[0].name,
        path=storable(where.place),
        files=tuple(storable(_named(file, where)) for file in recording.files),
        size_bytes=sum(file.stat().st_size for file in recording.files),
        format=format_of(located(task.recording).first) or format_of(recording.files[0]),
        clock=recording.clock,
        from_ns=min((m.first_stamp_ns for m in measurements if m.first_stamp_ns is not None), default=None),
        to_ns=max((m.last_stamp_ns for m in measurements if m.last_stamp_ns is not None), default=None),
        vehicle=origin.vehicle and storable(origin.vehicle),
        date=origin.date,
        drive=origin.drive and storable(origin.drive),
        weather=origin.weather and storable(origin.weather),
        damage=damage_of(measurements),
        sightings=sightings,
        superseded_by=record.superseded_by if record else None,
        conflicts=record.conflicts if record else None,
    )


def _named(file: Path, where: Location) -> str:
    """A file's name; of folders that are one recording its path from the folder above them."""
    return file.relative_to(where.path.parent).as_posix() if where.streams else file.name


@cache
def library_versions() -> Mapping[str, str]:
    """The versions of the libraries that change what is measured, as they are installed."""
    return {name: version(name) for name in _VERSIONED}


def _versions(matcher: Matcher) -> dict[str, str]:
    ours = {"auditor": __version__, "python": platform.python_version(), **library_versions()}
    return plug_ins() | ours | {OPENCV_CPU: instruction_sets()} | dict(libraries(matcher))
