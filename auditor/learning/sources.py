"""Where training samples come from: recordings, whose LiDAR knows sparse disparities, and streets that know all."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from auditor import __version__
from auditor.errors import RecordingError
from auditor.evidence.joining import OF_TWO
from auditor.evidence.lidar import lidar_view
from auditor.evidence.matchers.scoring import Sample
from auditor.evidence.rectifying import rectification
from auditor.evidence.stereo import seen_by_both
from auditor.frames import Frame
from auditor.lab.drives import SyntheticDrive, make_drive
from auditor.lab.streets import STYLES
from auditor.pipeline import rigs_of
from auditor.recordings import open_recording, survey, synchronise
from auditor.rig import Camera, Rig
from auditor.store.records import content_id

Pair = tuple[int, int]
Disparities = NDArray[np.float32]

_STREET_FRAMES = 60
_STREET_CAMERAS = 4


@dataclass(frozen=True, eq=False)
class Samples:
    """The samples of one source with the numbers of their frames, `kind` recordings or streets; can be read once."""

    source_id: str
    kind: str
    numbered: Iterator[tuple[int, Sample]]


@dataclass(frozen=True)
class Recorded:
    """A clean recording with a LiDAR, with its own rig or that of a rig.toml; of several rigs the first is taken."""

    path: Path
    rig: Path | None = None

    def __str__(self) -> str:
        return str(self.path)

    @contextmanager
    def open(self) -> Iterator[Samples]:
        """One pair of cameras a frame. Raises RecordingError where it cannot be read or was attacked, and RigError."""
        with open_recording(self.path) as recording:
            if recording.labels():
                raise RecordingError(
                    "it carries labels of attacks, so it is not clean",
                    where=self.path,
                    remedy="train on recordings that are free of attacks",
                )
            surveyed = survey(recording)
            rig = rigs_of(surveyed, self.rig)[0]
            if rig.lidar is None:
                raise RecordingError(
                    "it has no LiDAR that would know disparities", where=self.path, remedy="train on --synthetic scenes"
                )
            numbered = (
                (frame.number, sample)
                for frame in synchronise(recording, rig, surveyed, colour=False)
                if isinstance(frame, Frame) and (sample := lidar_sample(frame, rig)) is not None
            )
            yield Samples(recording.recording_id, "recordings", numbered)


@dataclass(frozen=True)
class Street:
    """A synthetic drive, `frames` of it spread over its length; `seed` decides everything about it."""

    seed: int
    frames: int

    def __str__(self) -> str:
        return f"street {self.seed}"

    @contextmanager
    def open(self) -> Iterator[Samples]:
        """One pair of cameras a frame, with a disparity for every pixel that does not show the sky."""
        style = list(STYLES)[self.seed % len(STYLES)]
        drive = make_drive(self.seed, _STREET_FRAMES, n_cameras=_STREET_CAMERAS, style=style, vehicle=self.seed)
        numbers = np.linspace(0, _STREET_FRAMES - 1, self.frames).astype(int).tolist()
        known = content_id("training street", __version__, self.seed, self.frames)
        yield Samples(known, "streets", ((number, dense_sample(drive, number)) for number in numbers))


SampleSource = Recorded | Street


def pair_of(number: int, rig: Rig) -> Pair:
    """The pair (i, k) that a frame gives a sample of: all that a scan matches, by turns."""
    return rig.pairs[number % len(rig.pairs)]


def lidar_sample(frame: Frame, rig: Rig) -> Sample | None:
    """The sample of a frame, rectified, its disparities those of the LiDAR's points; None where a sensor is missing."""
    seen, (i, k) = rectification(rig), pair_of(frame.number, rig)
    own = seen.pairs.get((i, k))
    if own is not None:
        seen, frame, (i, k) = own.seen, own.recorded(frame), OF_TWO
    frame, rig = seen.frame(frame), seen.rig
    if frame.cloud is None or not {i, k} <= set(frame.images):
        return None
    view = lidar_view(frame.cloud, rig, k)
    camera = rig.camera(k)
    disparity = np.full((camera.height_px, camera.width_px), np.nan, dtype=np.float32)
    disparity[view.row, view.column] = view.disparity_px(i)
    if own is not None:
        disparity[~seen_by_both(disparity, 1, own.sights[k], own.sights[i])] = np.nan
    return frame.images[k].pixels, frame.images[i].pixels, _inside(disparity, rig.camera(i))


def dense_sample(drive: SyntheticDrive, number: int) -> Sample:
    """The sample of a synthetic frame, its disparities worked out from the depths that the reference camera saw."""
    rig = drive.rig
    i, k = pair_of(number, rig)
    reference, witness = rig.camera(k), rig.camera(i)
    depth_m = drive.depth_m(number, k)
    # Eq. 1, exact here: cameras of a synthetic rig stand beside one another.
    disparity = np.float32(reference.focal_px * rig.baseline_m(i, k)) / depth_m
    disparity[~np.isfinite(depth_m)] = np.nan
    return drive.image(number, k).pixels, drive.image(number, i).pixels, _inside(disparity, witness)


def _inside(disparity: Disparities, witness: Camera) -> Disparities:
    """Without those whose match lies outside the witness's image, or behind it."""
    match = np.arange(disparity.shape[1], dtype=np.float32) - disparity
    there = (disparity > 0) & (match >= 0) & (match < witness.width_px)
    return np.where(there, disparity, np.float32(np.nan))
