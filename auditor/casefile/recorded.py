"""What a case has of its recording: the clip, pictures, clouds, and the sidecar beside them; read in one process."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

from auditor.casefile.folder import write_file
from auditor.casefile.incident import CaseIncident
from auditor.casefile.ply import ply
from auditor.casefile.redaction import Redaction
from auditor.casefile.sidecar import SidecarFrame, write_sidecar
from auditor.errors import RecordingError, RigError
from auditor.measurement import use_one_thread
from auditor.measurement.drawing import blur_around, damaged_cloud, draw_frame, draw_overlays
from auditor.model.frames import Frame
from auditor.model.pictures import FramePicture
from auditor.pipeline.pictures.at_hand import frames_at_hand, recording_at_hand, stream_of
from auditor.recordings import FrameStream, Recording, survey
from auditor.recordings.writers.clip import write_clip
from auditor.reporting.incident.examples import Example
from auditor.store import Store

CLIP, SIDECAR = "clip.mcap", "findings.mcap"

_MOST_OVERLAYS = 100
"""Frames of an incident that the sidecar shows images of, those nearest to the strongest; at 10 Hz ten seconds."""


@dataclass(frozen=True)
class RecordedTask:
    """What is to be written into a folder of the incident of a row of the view `incidents`."""

    recording: str
    store: Path
    row: Mapping[str, Any]
    seconds: float
    folder: Path
    redaction: Redaction | None

    def __str__(self) -> str:
        return self.recording


def write_recorded(task: RecordedTask) -> tuple[str, ...]:
    """Write all that needs the recording; gives a sentence on each thing that could not be written.

    Raises RecordingError where the recording is not at hand, RigError and StoreError.
    """
    use_one_thread()
    incident = CaseIncident(Store.open(task.store), task.row, task.seconds)
    with recording_at_hand(incident.store, incident.recording.recording_id) as recording:
        stream = stream_of(incident.store, incident.measurement_id, recording)
        times = stream.recorded_at({row["frame"] for row in incident.frames})
        remarks = _write_clip(recording, times, task)
        frames = _Frames(incident, stream, times, task)
        write_sidecar(
            incident,
            task.folder / SIDECAR,
            frames.shown(),
            _frame_ids(incident, recording, task.redaction),
            words_of(incident, task.redaction),
        )
    return (*remarks, *_write_others(incident, task))


def write_kept(incident: CaseIncident, folder: Path, redaction: Redaction | None) -> int:
    """Write what the store itself has to show, where the recording is not at hand; gives the number of pictures.

    The sidecar has no images then, and its times are the stamps. Raises RecordingError and OSError.
    """
    pictures = sum(_write_kept(incident, one, folder, redaction) for one in incident.examples)
    frames = (_shown(incident, row, row["stamp_ns"]) for row in incident.frames)
    ids = {sensor: f"S_{sensor}" for sensor in incident.rig.sensors}
    write_sidecar(incident, folder / SIDECAR, frames, ids, words_of(incident, redaction))
    return pictures


def words_of(incident: CaseIncident, redaction: Redaction | None) -> str:
    """The evidence in words."""
    words = incident.row["evidence"] or "no evidence in words"
    return redaction.text(words) if redaction is not None else words


def _write_clip(recording: Recording, times: Mapping[int, tuple[int, int]], task: RecordedTask) -> tuple[str, ...]:
    if task.redaction is not None:
        return ("no clip: it would hold names, and images that are not blurred",)
    if not times:
        return ("no clip: none of its frames was found in the recording again",)
    first, last = min(low for low, _ in times.values()), max(high for _, high in times.values())
    try:
        write_clip(recording, task.folder / CLIP, first, last)
    except RecordingError as error:
        return (f"no clip: {error.what}",)
    return ()


class _Frames:
    """The frames of the seconds, as the sidecar shows them; on the way the examples' files are written."""

    def __init__(
        self, incident: CaseIncident, stream: FrameStream, times: Mapping[int, tuple[int, int]], task: RecordedTask
    ) -> None:
        self._incident = incident
        self._stream = stream
        self._times = times
        self._task = task
        self._examples = incident.own_examples

    def shown(self) -> Iterator[SidecarFrame]:
        drawn = self._drawn()
        here = next(drawn, None)
        for row in self._incident.frames:
            while here is not None and here.number < row["frame"]:
                here = next(drawn, None)
            at = self._times.get(row["frame"], (row["stamp_ns"], row["stamp_ns"]))[1]
            frame = here if here is not None and here.number == row["frame"] else None
            yield _shown(self._incident, row, at, frame, self._task.redaction)
        for _ in drawn:
            pass

    def _drawn(self) -> Iterator[Frame]:
        incident = self._incident
        for item in self._stream.chosen(self._examples | _nearest(incident)):
            if isinstance(item, Frame):
                if item.number in self._examples:
                    _write_example(item, incident, incident.measurement_id, self._task)
                yield item


def _nearest(incident: CaseIncident) -> set[int]:
    """The frames of the incident whose images are shown."""
    inside = [row["frame"] for row in incident.frames if row["in_incident"]]
    strongest = incident.strongest or 0
    return set(sorted(inside, key=lambda frame: abs(frame - strongest))[:_MOST_OVERLAYS])


def _write_others(incident: CaseIncident, task: RecordedTask) -> Iterator[str]:
    """Write the examples that are of other recordings of the drive; of one that is gone what the store keeps."""
    others = [one for one in incident.examples if one.measurement_id != incident.measurement_id]
    for measurement_id, examples in groupby(others, key=lambda one: one.measurement_id):
        listed = list(examples)
        try:
            for frame in frames_at_hand(incident.store, measurement_id, {one.frame for one in listed}):
                _write_example(frame, incident, measurement_id, task)
        except (RecordingError, RigError) as error:
            for one in listed:
                _write_kept(incident, one, task.folder, task.redaction)
            frames = " and ".join(" and ".join(one.what) for one in listed)
            yield f"the frame {frames} is of another recording and as the store keeps it: {error.what}"


def _write_example(frame: Frame, incident: CaseIncident, measurement_id: str, task: RecordedTask) -> None:
    regions = incident.regions(frame.number) if measurement_id == incident.measurement_id else []
    for picture in draw_frame(frame, incident.rig, regions):
        _write_picture(picture, incident, measurement_id, task.folder, task.redaction)
    if frame.cloud is not None:
        damaged = damaged_cloud(frame.cloud, incident.rig, regions)
        name = incident.place_of(measurement_id, f"{frame.number}.ply")
        write_file(task.folder / "clouds" / name, ply(frame.cloud.xyz_m, damaged))


def _write_kept(incident: CaseIncident, example: Example, folder: Path, redaction: Redaction | None) -> int:
    """Write the pictures that the store keeps of an example, and give their number."""
    pictures = incident.store.frame_pictures(example.measurement_id, example.frame)
    for picture in pictures:
        _write_picture(picture, incident, example.measurement_id, folder, redaction)
    return len(pictures)


def _write_picture(
    picture: FramePicture, incident: CaseIncident, measurement_id: str, folder: Path, redaction: Redaction | None
) -> None:
    path = folder / "pictures" / incident.place_of(measurement_id, picture.name)
    if path.exists():
        return
    if redaction is not None:
        regions = incident.regions(picture.frame) if measurement_id == incident.measurement_id else []
        picture = blur_around(picture, incident.rig, regions)
    write_file(path, picture.data)


def _shown(
    incident: CaseIncident,
    row: Mapping[str, Any],
    log_time_ns: int,
    frame: Frame | None = None,
    redaction: Redaction | None = None,
) -> SidecarFrame:
    regions = tuple(incident.regions(row["frame"])) if row["in_incident"] else ()
    overlays: Collection[FramePicture] = ()
    damaged = None
    if frame is not None and row["in_incident"]:
        overlays = draw_overlays(frame, incident.rig, regions)
        if redaction is not None:
            overlays = [blur_around(one, incident.rig, regions) for one in overlays]
        if frame.cloud is not None:
            damaged = frame.cloud.xyz_m[damaged_cloud(frame.cloud, incident.rig, regions)]
    named = " + ".join(f"S_{sensor}" for sensor in incident.attacked)
    gap = "" if row["gap"] is None else f", gap {row['gap']:.2f}"
    message = f"frame {row['frame']}: {row['kind']}{f' {named}' if named else ''}{gap}"
    return SidecarFrame(
        row["frame"], row["stamp_ns"], log_time_ns, message, row["in_incident"], regions, tuple(overlays), damaged
    )


def _frame_ids(incident: CaseIncident, recording: Recording, redaction: Redaction | None) -> dict[int, str]:
    """The frame ids of the sensors' messages, so that viewers put the sidecar where the clip is."""
    surveyed = survey(recording)
    known = {one.topic.name: one.frame_id for one in surveyed.images}
    known |= {one.topic.name: one.frame_id for one in surveyed.clouds}
    own = {sensor: f"S_{sensor}" for sensor in incident.rig.sensors}
    if redaction is not None:
        return own
    return {sensor: known.get(incident.rig.topic(sensor)) or name for sensor, name in own.items()}
