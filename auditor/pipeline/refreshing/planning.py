"""What a refresh would measure: the rig kinds of recordings, from their calibration messages alone."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from auditor.errors import AuditorError
from auditor.pipeline.measure import rigs_through
from auditor.recordings import Location, find_recordings, open_recording, survey
from auditor.store import Store
from auditor.store.versions.decisions import Planned


def plan(recordings: Sequence[Path], store: Store, rig_file: Path | None = None) -> Iterator[Planned]:
    """The recordings at some paths, each with its rig kinds, and whether the store has measured it."""
    found = find_recordings(recordings)
    for error in found.errors:
        yield Planned(str(error.where), (), measured=False, error=str(error))
    measured = {one.recording_id for one in store.measurements()}
    for location in found.recordings:
        yield _planned(location, measured, rig_file)


def _planned(location: Location, measured: set[str], rig_file: Path | None) -> Planned:
    try:
        with open_recording(location) as recording:
            rigs = rigs_through(recording, survey(recording), rig_file).rigs
            kinds = dict.fromkeys(str(one.rig.kind) for one in rigs)
            return Planned(str(location), tuple(kinds), measured=recording.recording_id in measured)
    except AuditorError as error:
        return Planned(str(location), (), measured=False, error=str(error))
