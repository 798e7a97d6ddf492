"""The sources of clean frames: recordings, and synthetic streets made for the evaluation."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from auditor import __version__
from auditor.errors import RecordingError
from auditor.lab.simulation.conditions import CONDITIONS
from auditor.lab.simulation.drives import HEIGHT_PX, WIDTH_PX, SyntheticDrive, make_drive
from auditor.lab.simulation.streets import STYLES
from auditor.measurement.disparity.rectification import shown_rectification
from auditor.model.frames import Frame, SkippedFrame
from auditor.model.rig import Rig
from auditor.model.text import storable
from auditor.pipeline.geometry import rigs_through
from auditor.recordings import Location, Recording, RigInForce, open_recording, survey, synchronise
from auditor.store.records import content_id


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
        yield recording, [one for one in in_force.rigs if not one.rig.by_time] or list(in_force.rigs)


@dataclass(frozen=True, eq=False)
class CleanFrameSource:
    """Clean frames of one rig, in order; `frames` can be read once.

    Drives of one `family` are alike in what can be learnt from them (docs/figures.md); None is a family of its own.
    `street` knows the truth of a synthetic one.
    """

    recording_id: str
    name: str
    family: str | None
    synthetic: bool
    rig: Rig
    frames: Iterator[Frame | SkippedFrame]
    street: SyntheticDrive | None = None


@dataclass(frozen=True)
class RecordingSource:
    """A recording known to be clean, with each of its rigs, or that of a rig file.

    Images that are not rectified are rectified first, and attacks are made on the rectified images. Where pairs have
    views of their own, attacks are made on the images as recorded.
    """

    path: Path | Location
    rig: Path | None = None

    def __str__(self) -> str:
        return str(self.path)

    @contextmanager
    def open(self) -> Iterator[tuple[CleanFrameSource, ...]]:
        """Its frames by each rig. Raises RecordingError where it cannot be read or was attacked, and RigError."""
        with clean_recording(self.path, self.rig, "evaluate") as (recording, rigs):
            yield tuple(
                _clean_drive(
                    recording,
                    one.rig,
                    iter(synchronise(recording, one.rig, one.survey, colour=True, stretches=one.stretches)),
                )
                for one in rigs
            )


def _clean_drive(recording: Recording, rig: Rig, frames: Iterator[Frame | SkippedFrame]) -> CleanFrameSource:
    seen = shown_rectification(rig)
    if not seen.pairs:
        rig, frames = seen.rig, seen.frames(frames)
    name = storable(recording.path.name)
    return CleanFrameSource(recording.recording_id, name, family=None, synthetic=False, rig=rig, frames=frames)


@dataclass(frozen=True)
class Street:
    """A synthetic drive of `frames` frames; `seed` determines all of it, and each has a vehicle of its own.

    Style and condition follow from the seed in turn, so that a few streets hold all of them. The vehicle's cameras are
    grey, colour or both; pictures are KITTI's size times `scale`.
    """

    seed: int
    frames: int
    cameras: int = 3
    scale: float = 1.0
    path: ClassVar[None] = None

    def __str__(self) -> str:
        return f"street {self.seed}"

    @property
    def style(self) -> str:
        """One of STYLES."""
        return list(STYLES)[self.seed % len(STYLES)]

    @property
    def condition(self) -> str:
        """One of CONDITIONS."""
        return list(CONDITIONS)[self.seed // len(STYLES) % len(CONDITIONS)]

    @property
    def family(self) -> str:
        """Its style and condition."""
        return f"{self.style}, {self.condition}"

    @property
    def drive(self) -> SyntheticDrive:
        """The drive along it, made anew."""
        return make_drive(
            self.seed,
            self.frames,
            n_cameras=self.cameras,
            style=self.style,
            width_px=round(WIDTH_PX * self.scale),
            height_px=round(HEIGHT_PX * self.scale),
            vehicle=self.seed,
            condition=self.condition,
        )

    @contextmanager
    def open(self) -> Iterator[tuple[CleanFrameSource, ...]]:
        """Its frames, each made when it is read."""
        drive = self.drive
        given = (self.seed, self.frames, self.cameras, self.scale, self.family)
        yield (
            CleanFrameSource(
                recording_id=content_id("street", __version__, *given),
                name=f"{self.family} {self.seed}",
                family=self.family,
                synthetic=True,
                rig=drive.rig,
                frames=drive.frames(),
                street=drive,
            ),
        )


Source = RecordingSource | Street
