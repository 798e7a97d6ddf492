"""Recordings known to be clean, opened for the lab: those that carry labels of attacks are refused."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from auditor.errors import RecordingError
from auditor.pipeline.geometry import rigs_through
from auditor.recordings import Location, Recording, RigInForce, open_recording, survey


@contextmanager
def clean_recording(path: Path | Location, rig: Path | None, use: str) -> Iterator[tuple[Recording, list[RigInForce]]]:
    """A recording with its rigs, or with that of a rig file; `use` says what to do with another one, "train".

    Raises RecordingError where it cannot be read, was attacked or fits no rig, and RigError.
    """
    with open_recording(path) as recording:
        if recording.labels():
            raise RecordingError(
                "it carries labels of attacks, so it is not clean",
                where=path,
                remedy=f"{use} on recordings that are free of attacks",
            )
        in_force = rigs_through(recording, survey(recording), rig)
        if in_force.withheld:
            raise RecordingError(in_force.withheld, where=path, remedy=f"{use} on recordings that fit")
        yield recording, list(in_force.rigs)
