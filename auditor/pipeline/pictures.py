"""Frames of measured recordings that are read again: to picture incidents, and for people to look at."""

from collections import defaultdict
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from auditor.errors import AuditorError, RecordingError
from auditor.identification.scores import standing_out
from auditor.identification.statistics import sensor_statistics
from auditor.measurement import localise, measure, use_one_thread
from auditor.measurement.disparity.matchers import find_matcher
from auditor.measurement.drawing import draw_frame
from auditor.model.checks import rig_sensor_checks
from auditor.model.frames import Frame, SkippedFrame
from auditor.model.measurement import Region
from auditor.model.pictures import FramePicture, Pictures
from auditor.model.rig import Rig
from auditor.pipeline.geometry import in_force, rigs_through
from auditor.pipeline.remote.finding import remote_of
from auditor.pipeline.remote.measuring import Supply
from auditor.pipeline.remote.spool import Spool
from auditor.pipeline.workers import Limits, LimitsOf, Outcome, run_all, run_from
from auditor.recordings import FrameStream, Location, Recording, find_recordings, open_recording, survey, synchronise
from auditor.resources import is_address
from auditor.store.export import rows_of
from auditor.store.pictures import pictured_in_full
from auditor.store.queries import run_sql
from auditor.store.records import RecordingRecord
from auditor.store.store import Store

_ANEW = "put it back, or scan it where it lies now"


def location_of(record: RecordingRecord) -> Location:
    """Where a recording lies, at the last of its places that is still there; not copied yet where that is an address.

    Raises RecordingError.
    """
    if is_address(record.path):
        return remote_of(record)
    places = dict.fromkeys([record.path, *(one.path for one in reversed(record.sightings))])
    for place in map(Path, places):
        if place.exists():
            return Location(place)
        files = [Path(name) for name in record.files if not Path(name).is_absolute() and ".." not in Path(name).parts]
        beside = sorted({place.parent / file.parts[0] for file in files if file.parts})
        if beside and all((place.parent / file).is_file() for file in files):
            locations = find_recordings(beside).recordings
            if len(locations) == 1:
                return locations[0]
    raise RecordingError("the recording is not there any more", where=record.path, remedy=_ANEW)


@contextmanager
def recording_at_hand(store: Store, recording_id: str, at: Location | None = None) -> Iterator[Recording]:
    """The recording of an id, opened for reading: no byte of it is another than those that were measured.

    It lies where it is said to, else where it was measured. Raises RecordingError where it is gone, cannot be read, or
    is not what was measured.
    """
    record = store.recording(recording_id)
    if at is None and is_address(record.path):
        raise RecordingError("it lies on an object store, and was not copied", where=record.path)
    location = at or location_of(record)
    with open_recording(location) as recording:
        if recording.recording_id != recording_id:
            raise RecordingError(
                f"the recording is not what was measured: its sha256 is {recording.recording_id[:12]}, not "
                f"{recording_id[:12]}",
                where=location,
                remedy=_ANEW,
            )
        yield recording


def stream_of(store: Store, measurement_id: str, recording: Recording) -> FrameStream:
    """The frames of a recording as a measurement numbers them, in colour. Raises RigError."""
    rig = store.rig(store.measurement(measurement_id).rig_id)
    rig_in_force = in_force(recording, survey(recording), rig)
    return synchronise(recording, rig, rig_in_force.survey, colour=True, stretches=rig_in_force.stretches)


def frames_at_hand(
    store: Store, measurement_id: str, frames: Collection[int], at: Location | None = None
) -> Iterator[Frame]:
    """Some frames of a measurement, read from its recording again. Raises as `recording_at_hand` does, and RigError."""
    with recording_at_hand(store, store.measurement(measurement_id).recording_id, at) as recording:
        for item in stream_of(store, measurement_id, recording).chosen(frames):
            if isinstance(item, Frame):
                yield item


MOST_INCIDENTS = 100
"""Incidents of a measurement that are pictured, the strongest first: a night of faults must not fill the disk."""

_EXAMPLES = """
    SELECT example.measurement_id, example.incident_id, example.frame, own.attacked
    FROM incident_examples AS example
    JOIN incidents USING (incident_id)
    LEFT JOIN incident_frames AS own
        ON own.measurement_id = example.measurement_id AND own.frame = example.frame
    WHERE example.incident_id IN (
        SELECT incident_id FROM incident_examples WHERE example = 'strongest' AND measurement_id IN ({})
    )
    ORDER BY incidents.largest_gap DESC NULLS LAST, example.incident_id
"""

_OF_THEIR_DRIVES = """
    WITH known AS (SELECT measurement_id, recording_id, drive_id FROM measurements JOIN recordings USING (recording_id))
    SELECT known.measurement_id, known.recording_id, judgement_id
    FROM known
    LEFT JOIN judgements ON judgements.measurement_id = known.measurement_id AND judgements.current
    WHERE drive_id IN (SELECT drive_id FROM known WHERE measurement_id IN ({}))
"""

Frames = dict[int, tuple[int, ...] | None]
"""Frames that are to be pictured, with the attacked sensors; none where none is named, None where no incident is."""


@dataclass(frozen=True)
class PictureTask:
    """Frames of one measurement that are to be pictured."""

    recording: Location
    store: Path
    measurement_id: str
    frames: Frames

    def __str__(self) -> str:
        return str(self.recording)

    def at(self, location: Location) -> "PictureTask":
        """The same of a copy of its recording."""
        return replace(self, recording=location)


@dataclass(frozen=True)
class PicturingResult:
    """What became of a measurement's incidents: how many frames were pictured, and what people should know."""

    recording: str
    frames: int = 0
    remark: str = ""


def picture_incidents(
    store: Store,
    measurement_ids: Collection[str],
    pictures: Pictures,
    limits: LimitsOf,
    jobs: int = 1,
    spool: Spool | None = None,
) -> Iterator[PicturingResult]:
    """Picture the incidents of measurements that have no pictures yet; each recording in a process with its budget.

    A recording that is gone, or is another by now, gets a remark; the others go on. Those of object stores are copied
    into the spool, unless they are there still. Raises StoreError.
    """
    tasks: list[PictureTask] = []
    wanted = _wanted_frames(store, measurement_ids) if pictures != Pictures.NONE and measurement_ids else {}
    for measurement, of_incidents in wanted.items():
        record = store.recording(store.measurement(measurement).recording_id)
        if (left_out := len(of_incidents) - MOST_INCIDENTS) > 0:
            yield PicturingResult(record.name, remark=f"{left_out} of its incidents, the weakest, get no pictures")
        done = pictured_in_full(store.folder / "pictures", measurement)
        frames = {number: how for one in of_incidents[:MOST_INCIDENTS] for number, how in one.items()}
        if frames := {number: how for number, how in frames.items() if number not in done}:
            try:
                tasks.append(PictureTask(location_of(record), store.folder, measurement, frames))
            except AuditorError as error:
                yield PicturingResult(record.name, remark=_no_pictures(error))
    for outcome in _run(tasks, limits, jobs, spool or Spool()):
        remark = _no_pictures(outcome.error) if outcome.error is not None else ""
        yield PicturingResult(outcome.item.recording.name, outcome.result or 0, remark)


def _run(
    tasks: Sequence[PictureTask], limits: LimitsOf, jobs: int, spool: Spool
) -> Iterator[Outcome[PictureTask, int]]:
    def limits_of(task: PictureTask) -> Limits:
        return limits(task.recording)

    if all(task.recording.remote is None for task in tasks):
        return run_all(picture_frames, tasks, jobs, lambda *_: None, limits_of)
    supply = Supply(tasks, spool, lambda task: task.recording, PictureTask.at, min(jobs, len(tasks)))
    return run_from(supply, picture_frames, jobs, lambda *_: None, limits_of)


def picture_frames(task: PictureTask, _: Callable[[str, int], None]) -> int:
    """Keep the pictures of frames, and tell how many frames there were. Raises RecordingError, RigError, StoreError."""
    use_one_thread()
    store = Store.open(task.store)
    rig = store.rig(store.measurement(task.measurement_id).rig_id)
    done = 0
    for frame in frames_at_hand(store, task.measurement_id, task.frames, task.recording):
        attacked = task.frames[frame.number]
        damaged = () if attacked is None else attacked or rig.sensors
        regions = [one for one in store.load_regions(task.measurement_id, frame.number) if one.sensor in damaged]
        store.write_frame_pictures(task.measurement_id, draw_frame(frame, rig, regions))
        done += 1
    return done


def _wanted_frames(store: Store, measurement_ids: Collection[str]) -> dict[str, list[Frames]]:
    """By measurement the frames that show incidents, the strongest incident first; some are of other recordings."""
    listed = ", ".join(f"'{known}'" for known in measurement_ids)
    incidents: defaultdict[str, defaultdict[str, Frames]] = defaultdict(lambda: defaultdict(dict))
    asked = _of_their_drives(store, listed)
    for row in rows_of(run_sql(asked, _EXAMPLES.format(listed))):
        attacked = None if row["attacked"] is None else tuple(row["attacked"])
        incidents[row["measurement_id"]][row["incident_id"]][row["frame"]] = attacked
    return {known: list(of_incidents.values()) for known, of_incidents in incidents.items()}


def _of_their_drives(store: Store, listed: str) -> Store:
    """The part of a store that has the drives of some measurements: an incident, and what shows it, is of one drive."""
    rows = rows_of(run_sql(store, _OF_THEIR_DRIVES.format(listed)))
    return store.only(
        recordings={row["recording_id"] for row in rows},
        measurements={row["measurement_id"] for row in rows},
        judgements={row["judgement_id"] for row in rows if row["judgement_id"] is not None},
    )


def _no_pictures(error: AuditorError) -> str:
    return f"no pictures of its incidents: {error}"


@dataclass(frozen=True)
class ShownFrame:
    """A frame with its pictures, or the reason why it was skipped.

    `measurement_id` is that of the store, `verdict` its row of `verdicts`; None where the store has none. Without a
    measurement the `regions` were measured now, with sgbm.
    """

    rig: Rig
    frame: Frame | SkippedFrame
    clock: str
    regions: tuple[Region, ...] = ()
    pictures: tuple[FramePicture, ...] = ()
    measurement_id: str | None = None
    verdict: dict[str, Any] | None = None


def show_frame(where: Location, number: int, store: Path | None, rig_file: Path | None = None) -> ShownFrame:
    """The frame of a number. Raises RecordingError, also where there is none, RigError and StoreError."""
    use_one_thread()
    with open_recording(where) as recording:
        rig, frame = _frame(recording, number, rig_file)
        shown = ShownFrame(rig, frame, recording.clock)
        if isinstance(frame, SkippedFrame):
            return shown
        kept = Store.open(store) if store is not None else None
        measurement = _measurement(kept, recording.recording_id, rig.rig_id) if kept is not None else None
        if kept is None or measurement is None:
            regions = _measured_now(frame, rig)
        else:
            regions = tuple(kept.load_regions(measurement, number))
    verdict = _verdict(kept, measurement, number) if kept is not None and measurement is not None else None
    pictures = tuple(draw_frame(frame, rig, regions, "png"))
    return ShownFrame(rig, frame, shown.clock, regions, pictures, measurement, verdict)


def _frame(recording: Recording, number: int, rig_file: Path | None) -> tuple[Rig, Frame | SkippedFrame]:
    """The frame by the rig that is in force then."""
    for rig_in_force in rigs_through(recording, survey(recording), rig_file).rigs:
        for item in synchronise(
            recording, rig_in_force.rig, rig_in_force.survey, colour=True, stretches=rig_in_force.stretches
        ).chosen([number]):
            return rig_in_force.rig, item
    raise RecordingError(
        f"it has no frame {number}", where=recording.path, remedy="frames are numbered from 0, skipped ones included"
    )


def _measurement(store: Store, recording_id: str, rig_id: str) -> str | None:
    """The latest measurement of a recording with a rig."""
    of_both = [one for one in store.measurements() if (one.recording_id, one.rig_id) == (recording_id, rig_id)]
    return max(of_both, key=lambda one: one.measured_at).measurement_id if of_both else None


def _verdict(store: Store, measurement_id: str, frame: int) -> dict[str, Any] | None:
    rows = rows_of(run_sql(store, f"FROM verdicts WHERE measurement_id = '{measurement_id}' AND frame = {frame}"))
    return rows[0] if rows else None


def _measured_now(frame: Frame, rig: Rig) -> tuple[Region, ...]:
    checks = rig_sensor_checks(rig)
    counted, arrays = measure(frame, rig, find_matcher("sgbm"))
    return localise(arrays, standing_out(checks, sensor_statistics(checks, counted.cells, counted.shares)).sensors, rig)
