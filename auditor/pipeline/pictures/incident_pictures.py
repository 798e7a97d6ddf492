"""Pictures chosen by the verdict: a second pass over those frames of recordings that show incidents."""

from collections import defaultdict
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from auditor.errors import AuditorError
from auditor.measurement import use_one_thread
from auditor.measurement.drawing import draw_frame
from auditor.model.pictures import Pictures
from auditor.pipeline.many import LimitsOf
from auditor.pipeline.pictures.at_hand import frames_at_hand, location_of
from auditor.pipeline.remote.spool import Spool
from auditor.pipeline.remote.supply import Supply
from auditor.pipeline.workers import Limits, Outcome, run_all, run_from
from auditor.recordings import Location
from auditor.store import Store, rows_of, run_sql
from auditor.store.pictures import pictured_in_full

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
class Pictured:
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
) -> Iterator[Pictured]:
    """Picture the incidents of measurements that have no pictures yet; each recording in a process with its budget.

    A recording that is gone, or is another by now, gets a remark; the others go on. Those of object stores are copied
    into the spool, unless they are there still. Raises StoreError.
    """
    tasks: list[PictureTask] = []
    wanted = _wanted_frames(store, measurement_ids) if pictures != Pictures.NONE and measurement_ids else {}
    for known, of_incidents in wanted.items():
        record = store.recording(store.measurement(known).recording_id)
        if (left_out := len(of_incidents) - MOST_INCIDENTS) > 0:
            yield Pictured(record.name, remark=f"{left_out} of its incidents, the weakest, get no pictures")
        done = pictured_in_full(store.folder / "pictures", known)
        frames = {number: how for one in of_incidents[:MOST_INCIDENTS] for number, how in one.items()}
        if frames := {number: how for number, how in frames.items() if number not in done}:
            try:
                tasks.append(PictureTask(location_of(record), store.folder, known, frames))
            except AuditorError as error:
                yield Pictured(record.name, remark=_no_pictures(error))
    for outcome in _run(tasks, limits, jobs, spool or Spool()):
        remark = _no_pictures(outcome.error) if outcome.error is not None else ""
        yield Pictured(outcome.item.recording.name, outcome.result or 0, remark)


def _run(
    tasks: Sequence[PictureTask], limits: LimitsOf, jobs: int, spool: Spool
) -> Iterator[Outcome[PictureTask, int]]:
    def limits_of(task: PictureTask) -> Limits:
        return limits(task.recording)

    if all(task.recording.remote is None for task in tasks):
        return run_all(picture_frames, tasks, jobs, _silent, limits_of)
    supply = Supply(tasks, spool, lambda task: task.recording, PictureTask.at, min(jobs, len(tasks)))
    return run_from(supply, picture_frames, jobs, _silent, limits_of)


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
    found: defaultdict[str, defaultdict[str, Frames]] = defaultdict(lambda: defaultdict(dict))
    asked = _of_their_drives(store, listed)
    for row in rows_of(run_sql(asked, _EXAMPLES.format(listed))):
        attacked = None if row["attacked"] is None else tuple(row["attacked"])
        found[row["measurement_id"]][row["incident_id"]][row["frame"]] = attacked
    return {known: list(of_incidents.values()) for known, of_incidents in found.items()}


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


def _silent(_: object, __: str, ___: int) -> None:
    """How far it is, is not told."""
