"""Synthetic drives whose frames are rendered once, for tests that each change what they record of them."""

from collections.abc import Iterator
from dataclasses import dataclass

from auditor.lab.simulation.drives import make_drive
from auditor.model.frames import Frame
from auditor.model.rig import Rig


@dataclass(frozen=True, eq=False)
class RenderedDrive:
    """The rig and frames of a drive; nobody writes into their images."""

    rig: Rig
    kept: tuple[Frame, ...]

    def frames(self) -> Iterator[Frame]:
        """All frames, in order."""
        return iter(self.kept)


def rendered_drive(seed: int, frames: int, *, width_px: int, height_px: int) -> RenderedDrive:
    """A street of images of this size: to render four frames of 621 x 188 px takes a second."""
    drive = make_drive(seed, frames, width_px=width_px, height_px=height_px)
    kept = tuple(drive.frames())
    for frame in kept:
        for image in frame.images.values():
            image.pixels.setflags(write=False)
    return RenderedDrive(drive.rig, kept)
