"""A measured recording that is still where it was read: opened again, and refused where it is another by now."""

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from auditor.errors import RecordingError
from auditor.model.frames import Frame
from auditor.pipeline.geometry import in_force
from auditor.pipeline.remote.finding import remote_of
from auditor.recordings import FrameStream, Location, Recording, find_recordings, open_recording, survey, synchronise
from auditor.resources import is_address
from auditor.store import RecordingRecord, Store

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
        files = [place.parent / Path(name).name for name in record.files]
        if files and all(file.is_file() for file in files):
            found = find_recordings(files).recordings
            if len(found) == 1:
                return found[0]
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
    known = in_force(recording, survey(recording), rig)
    return synchronise(recording, rig, known.survey, colour=True, stretches=known.stretches)


def frames_at_hand(
    store: Store, measurement_id: str, frames: Collection[int], at: Location | None = None
) -> Iterator[Frame]:
    """Some frames of a measurement, read from its recording again. Raises as `recording_at_hand` does, and RigError."""
    with recording_at_hand(store, store.measurement(measurement_id).recording_id, at) as recording:
        for item in stream_of(store, measurement_id, recording).chosen(frames):
            if isinstance(item, Frame):
                yield item
