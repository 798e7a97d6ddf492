"""The sources of clean frames: recordings, and synthetic streets made for the evaluation."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from auditor import __version__
from auditor.errors import RecordingError
from auditor.lab.simulation.drives import make_drive
from auditor.lab.simulation.streets import STYLES
from auditor.measurement.disparity.rectification import rectification
from auditor.model.frames import Frame, Skipped
from auditor.model.rig import Rig
from auditor.model.text import storable
from auditor.pipeline.measure import rigs_through
from auditor.recordings import Location, Recording, open_recording, survey, synchronise
from auditor.store.records import content_id


@dataclass(frozen=True, eq=False)
class CleanDrive:
    """Clean frames of one rig, in order; `frames` can be read once."""

    recording_id: str
    name: str
    synthetic: bool
    rig: Rig
    frames: Iterator[Frame | Skipped]


@dataclass(frozen=True)
class Recorded:
    """A recording known to be clean, with each of its rigs, or that of a rig file.

    Images that are not rectified are rectified first, and attacks are made on the rectified images. Where pairs have
    views of their own, attacks are made on the images as recorded.
    """

    path: Path | Location
    rig: Path | None = None

    def __str__(self) -> str:
        return str(self.path)

    @contextmanager
    def open(self, *, colour: bool) -> Iterator[tuple[CleanDrive, ...]]:
        """Its frames by each rig. Raises RecordingError where it cannot be read or was attacked, and RigError."""
        with open_recording(self.path) as recording:
            if recording.labels():
                raise RecordingError(
                    "it carries labels of attacks, so it is not clean",
                    where=self.path,
                    remedy="evaluate on recordings that are free of attacks",
                )
            surveyed = survey(recording)
            yield tuple(
                _clean_drive(
                    recording,
                    one.rig,
                    iter(synchronise(recording, one.rig, one.survey, colour=colour, stretches=one.stretches)),
                )
                for one in rigs_through(recording, surveyed, self.rig).rigs
            )


def _clean_drive(recording: Recording, rig: Rig, frames: Iterator[Frame | Skipped]) -> CleanDrive:
    seen = rectification(rig)
    if not seen.pairs:
        rig, frames = seen.rig, seen.frames(frames)
    return CleanDrive(recording.recording_id, storable(recording.path.name), synthetic=False, rig=rig, frames=frames)


@dataclass(frozen=True)
class Street:
    """A synthetic drive of `frames` frames; `seed` determines all of it, and each has a vehicle of its own."""

    seed: int
    frames: int
    cameras: int = 3
    path: ClassVar[None] = None

    def __str__(self) -> str:
        return f"street {self.seed}"

    @contextmanager
    def open(self, *, colour: bool) -> Iterator[tuple[CleanDrive, ...]]:  # noqa: ARG002 - its images are grey
        """Its frames, each made when it is read."""
        style = list(STYLES)[self.seed % len(STYLES)]
        drive = make_drive(self.seed, self.frames, n_cameras=self.cameras, style=style, vehicle=self.seed)
        known = content_id("street", __version__, self.seed, self.frames, self.cameras, style)
        yield (CleanDrive(known, f"{style} {self.seed}", synthetic=True, rig=drive.rig, frames=drive.frames()),)


Source = Recorded | Street
