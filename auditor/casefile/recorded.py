"""What a case has of its recording: the clip, pictures, clouds, and the sidecar beside them; read in one process."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from operator import attrgetter
from typing import Any

import numpy as np

from auditor.casefile.case import Case
from auditor.casefile.sidecar import SidecarFrame, write_sidecar
from auditor.errors import RecordingError, RigError
from auditor.measurement import use_one_thread
from auditor.measurement.drawing import blur_around, damaged_cloud, draw_frame, draw_overlays
from auditor.model.arrays import Mask, Points
from auditor.model.frames import Frame
from auditor.model.measurement import Region
from auditor.model.pictures import FramePicture
from auditor.model.rig import LIDAR
from auditor.pipeline.pictures import frames_at_hand, recording_at_hand, stream_of
from auditor.recordings import FrameStream, Location, Recording, survey
from auditor.recordings.writers.convert import write_clip
from auditor.reporting.incident.examples import Example

CLIP = "clip.mcap"

_MOST_OVERLAYS = 100
"""Frames of an incident that the sidecar shows images of, those nearest to the strongest; at 10 Hz ten seconds."""

_RED, _GREY = (255, 40, 40), (150, 150, 150)
_VERTEX = np.dtype([("xyz", "<f4", 3), ("colour", "u1", 3), ("damaged", "u1")])
"""A point of a cloud that is written as PLY, which every viewer of clouds opens."""

LogTimes = Mapping[int, tuple[int, int]]
"""By frame: the first and the last log time of its messages."""


def write_recorded(where: Location, case: Case) -> tuple[str, ...]:
    """Write all that needs the recording; gives a sentence on each thing that could not be written.

    Raises RecordingError where the recording is not at hand, RigError and StoreError.
    """
    use_one_thread()
    incident = case.incident
    with recording_at_hand(incident.store, incident.recording.recording_id, where) as recording:
        stream = stream_of(incident.store, incident.measurement_id, recording)
        times = stream.recorded_at({row["frame"] for row in case.frames})
        remarks = _write_clip(recording, times, case)
        write_sidecar(case, _sidecar_frames(case, stream, times), _frame_ids(case, recording))
    return (*remarks, *_write_others(case))


def write_kept(case: Case) -> int:
    """Write what the store itself has to show, where the recording is not at hand; gives the number of pictures.

    The sidecar has no images then, and its times are the stamps. Raises RecordingError and OSError.
    """
    pictures = sum(_write_kept(case, example) for example in case.incident.examples)
    frames = (_sidecar_frame(case, row, row["stamp_ns"]) for row in case.frames)
    write_sidecar(case, frames, {sensor: f"S_{sensor}" for sensor in case.incident.rig.sensors})
    return pictures


def _write_clip(recording: Recording, times: LogTimes, case: Case) -> tuple[str, ...]:
    if case.redaction.on:
        return ("no clip: it would hold names, and images that are not blurred",)
    if not times:
        return ("no clip: none of its frames was found in the recording again",)
    first, last = min(low for low, _ in times.values()), max(high for _, high in times.values())
    try:
        write_clip(recording, case.folder / CLIP, first, last)
    except RecordingError as error:
        return (f"no clip: {error.what}",)
    return ()


def _sidecar_frames(case: Case, stream: FrameStream, times: LogTimes) -> Iterator[SidecarFrame]:
    """The frames of the seconds, as the sidecar shows them; on the way the examples' files are written."""
    drawn = _drawn(case, stream)
    frame = next(drawn, None)
    for row in case.frames:
        while frame is not None and frame.number < row["frame"]:
            frame = next(drawn, None)
        _, log_time_ns = times.get(row["frame"], (0, row["stamp_ns"]))
        here = frame is not None and frame.number == row["frame"]
        yield _sidecar_frame(case, row, log_time_ns, frame if here else None)
    for _ in drawn:
        pass


def _drawn(case: Case, stream: FrameStream) -> Iterator[Frame]:
    incident = case.incident
    examples = {one.frame for one in incident.examples if one.measurement_id == incident.measurement_id}
    for item in stream.chosen(examples | _nearest(case)):
        if isinstance(item, Frame):
            if item.number in examples:
                _write_example(case, item, incident.measurement_id)
            yield item


def _nearest(case: Case) -> set[int]:
    """The frames of the incident whose images are shown."""
    inside = [row["frame"] for row in case.frames if row["in_incident"]]
    strongest = case.incident.strongest or 0
    return set(sorted(inside, key=lambda frame: abs(frame - strongest))[:_MOST_OVERLAYS])


def _write_others(case: Case) -> Iterator[str]:
    """Write the examples that are of other recordings of the drive; of one that is gone what the store keeps."""
    incident = case.incident
    others = [one for one in incident.examples if one.measurement_id != incident.measurement_id]
    for measurement_id, group in groupby(others, key=attrgetter("measurement_id")):
        examples = list(group)
        try:
            for frame in frames_at_hand(incident.store, measurement_id, {one.frame for one in examples}):
                _write_example(case, frame, measurement_id)
        except (RecordingError, RigError) as error:
            for example in examples:
                _write_kept(case, example)
            frames = " and ".join(" and ".join(one.what) for one in examples)
            yield f"the frame {frames} is of another recording and as the store keeps it: {error.what}"


def _write_example(case: Case, frame: Frame, measurement_id: str) -> None:
    regions = case.regions(frame.number, measurement_id)
    for picture in draw_frame(frame, case.incident.rig, regions):
        _write_picture(case, picture, measurement_id)
    for sensor, cloud in frame.clouds.items():
        damaged = damaged_cloud(cloud, case.incident.rig, regions, sensor)
        of = "" if sensor == LIDAR else f"_S{sensor}"
        name = case.place_of(measurement_id, f"{frame.number}{of}.ply")
        case.write(f"clouds/{name}", _ply(cloud.xyz_m, damaged))


def _ply(points: Points, damaged: Mask) -> bytes:
    """A binary PLY file of (N, 3) points in metres; (N,) `damaged` ones are red and have `damaged` 1."""
    vertices = np.zeros(len(points), dtype=_VERTEX)
    vertices["xyz"] = points
    vertices["colour"] = np.where(damaged[:, None], _RED, _GREY)
    vertices["damaged"] = damaged
    header = (
        "ply",
        "format binary_little_endian 1.0",
        "comment metres in the frame of the LiDAR: see damaged",
        f"element vertex {len(points)}",
        *(f"property float {axis}" for axis in "xyz"),
        *(f"property uchar {channel}" for channel in ("red", "green", "blue", "damaged")),
        "end_header\n",
    )
    return "\n".join(header).encode() + vertices.tobytes()


def _write_kept(case: Case, example: Example) -> int:
    """Write the pictures that the store keeps of an example, and give their number."""
    pictures = case.incident.store.frame_pictures(example.measurement_id, example.frame)
    for picture in pictures:
        _write_picture(case, picture, example.measurement_id)
    return len(pictures)


def _write_picture(case: Case, picture: FramePicture, measurement_id: str) -> None:
    name = f"pictures/{case.place_of(measurement_id, picture.name)}"
    if not (case.folder / name).exists():
        case.write(name, _blurred(case, picture, case.regions(picture.frame, measurement_id)).data)


def _blurred(case: Case, picture: FramePicture, regions: Sequence[Region]) -> FramePicture:
    """A picture as the case may show it."""
    return blur_around(picture, case.incident.rig, regions) if case.redaction.on else picture


def _sidecar_frame(case: Case, row: Mapping[str, Any], log_time_ns: int, frame: Frame | None = None) -> SidecarFrame:
    incident = case.incident
    regions = tuple(case.regions(row["frame"]))
    overlays: list[FramePicture] = []
    damaged = {}
    if frame is not None and row["in_incident"]:
        overlays = [_blurred(case, one, regions) for one in draw_overlays(frame, incident.rig, regions)]
        for sensor, cloud in frame.clouds.items():
            damaged[sensor] = cloud.xyz_m[damaged_cloud(cloud, incident.rig, regions, sensor)]
    named = " + ".join(f"S_{sensor}" for sensor in incident.attacked)
    gap = "" if row["gap"] is None else f", gap {row['gap']:.2f}"
    message = f"frame {row['frame']}: {row['kind']}{f' {named}' if named else ''}{gap}"
    return SidecarFrame(row["stamp_ns"], log_time_ns, message, row["in_incident"], regions, tuple(overlays), damaged)


def _frame_ids(case: Case, recording: Recording) -> dict[int, str]:
    """The frame ids of the sensors' messages, so that viewers put the sidecar where the clip is."""
    surveyed, rig = survey(recording), case.incident.rig
    by_topic = {one.topic.name: one.frame_id for one in surveyed.images}
    by_topic |= {one.topic.name: one.frame_id for one in surveyed.clouds}
    recorded = {sensor: by_topic.get(rig.topic(sensor)) for sensor in rig.sensors if not case.redaction.on}
    return {sensor: recorded.get(sensor) or f"S_{sensor}" for sensor in rig.sensors}
