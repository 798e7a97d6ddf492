"""Training samples of recordings and streets: files that are made once, and are whole or absent."""

import shutil
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, overload
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from auditor import __version__
from auditor.errors import RecordingError, SettingError
from auditor.lab.evaluation.sources import clean_recording
from auditor.lab.simulation.drives import SyntheticDrive, make_drive
from auditor.lab.simulation.streets import STYLES
from auditor.measurement.disparity.half_resolution import grey
from auditor.measurement.disparity.lidar import lidar_view
from auditor.measurement.disparity.matchers.interface import Matcher
from auditor.measurement.disparity.rectification import rectification
from auditor.measurement.disparity.stereo import seen_by_both
from auditor.measurement.pairwise_views import OF_TWO
from auditor.model.arrays import Floats32
from auditor.model.frames import Frame
from auditor.model.rig import Camera, Rig
from auditor.recordings import Location, synchronise
from auditor.safety.budget import SAMPLE
from auditor.safety.zips import UnsafeZipError, check_file
from auditor.store.records import content_id

_FAR_PX = 3.0

Sample = tuple[NDArray[np.uint8], NDArray[np.uint8], NDArray[np.floating]]
"""Left and right image (H, W, 3) BGR, and the disparities (H, W) of the left one in pixels, NaN where unknown."""


@dataclass(frozen=True)
class Score:
    """Over `pixels` with known disparities: mean of |d - truth| in pixels, and the share over 3 px.

    A pixel without a disparity is over 3 px and has no part in the mean, which is None where none has one.
    """

    pixels: int
    mean_px: float | None
    over_3px_share: float | None


def score(matcher: Matcher, samples: Iterable[Sample], *, least_px: float = 0.0) -> Score:
    """Compare a matcher with known disparities on the pixels whose truth is above `least_px`.

    Give two matchers the same samples and they are compared on the same pixels, at full resolution.
    """
    pixels = matched = far = 0
    total = 0.0
    for left, right, truth in samples:
        inputs = (left, right) if matcher.colour else (grey(left), grey(right))
        disparity = matcher.match(*inputs).repeat(matcher.step, axis=0).repeat(matcher.step, axis=1)
        labelled = truth > least_px  # False where it is NaN
        error = np.abs(disparity[: truth.shape[0], : truth.shape[1]][labelled] - truth[labelled])
        pixels += error.size
        matched += int(np.count_nonzero(~np.isnan(error)))
        far += int(np.count_nonzero(~(error <= _FAR_PX)))
        total += float(np.nansum(error, dtype=np.float64))
    return Score(pixels, total / matched if matched else None, far / pixels if pixels else None)


Pair = tuple[int, int]
_STREET_FRAMES = 60
_STREET_CAMERAS = 4
_SUFFIX = ".npz"
_UNITS = 64.0  # disparities are kept as whole multiples of 1/64 px, 0 where unknown
_REPORT_EVERY = 5


@dataclass(frozen=True, eq=False)
class Samples:
    """The samples of one source with the numbers of their frames, `kind` recordings or streets; can be read once."""

    source_id: str
    kind: str
    numbered: Iterator[tuple[int, Sample]]


@dataclass(frozen=True)
class RecordingSamples:
    """A clean recording with a LiDAR, with its own rig or that of a rig.toml; of several rigs the first is taken."""

    path: Path | Location
    rig: Path | None = None

    def __str__(self) -> str:
        return str(self.path)

    @contextmanager
    def open(self) -> Iterator[Samples]:
        """One pair of cameras a frame. Raises RecordingError where it cannot be read or was attacked, and RigError."""
        with clean_recording(self.path, self.rig, "train") as (recording, rigs):
            first = rigs[0]
            rig = first.rig
            if rig.lidar is None:
                raise RecordingError(
                    "it has no LiDAR to give disparities", where=self.path, remedy="train on --synthetic scenes"
                )
            numbered = (
                (frame.number, sample)
                for frame in synchronise(recording, rig, first.survey, stretches=first.stretches)
                if isinstance(frame, Frame) and (sample := lidar_sample(frame, rig)) is not None
            )
            yield Samples(recording.recording_id, "recordings", numbered)


@dataclass(frozen=True)
class StreetSamples:
    """A synthetic drive, `frames` of it spread over its length; `seed` determines all of it."""

    seed: int
    frames: int
    path: ClassVar[None] = None

    def __str__(self) -> str:
        return f"street {self.seed}"

    @contextmanager
    def open(self) -> Iterator[Samples]:
        """One pair of cameras a frame, with a disparity for every pixel that does not show the sky."""
        style = list(STYLES)[self.seed % len(STYLES)]
        drive = make_drive(self.seed, _STREET_FRAMES, n_cameras=_STREET_CAMERAS, style=style, vehicle=self.seed)
        numbers = np.linspace(0, _STREET_FRAMES - 1, self.frames).astype(int).tolist()
        sample_id = content_id("training street", __version__, self.seed, self.frames)
        yield Samples(sample_id, "streets", ((number, dense_sample(drive, number)) for number in numbers))


SampleSource = RecordingSamples | StreetSamples


def pair_of(number: int, rig: Rig) -> Pair:
    """The pair (i, k) of a frame's sample: the pairs that a scan matches, in turn."""
    return rig.pairs[number % len(rig.pairs)]


def lidar_sample(frame: Frame, rig: Rig) -> Sample | None:
    """The sample of a frame, rectified, its disparities those of the LiDAR's points; None where a sensor is missing.

    None also where the two cameras have no view in common, and of a lone camera.
    """
    if rig.by_time:
        return None
    seen, (i, k) = rectification(rig), pair_of(frame.number, rig)
    own = seen.pairs.get((i, k))
    if seen.pairs and own is None:
        return None
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
        disparity[~seen_by_both(disparity, 1, own.valid_masks[k], own.valid_masks[i])] = np.nan
    return frame.images[k].pixels, frame.images[i].pixels, _inside(disparity, rig.camera(i))


def dense_sample(drive: SyntheticDrive, number: int) -> Sample:
    """The sample of a synthetic frame, its disparities computed from the true depths of the reference camera."""
    rig = drive.rig
    i, k = pair_of(number, rig)
    reference, source = rig.camera(k), rig.camera(i)
    depth_m = drive.depth_m(number, k)
    # Eq. 1, exact here: cameras of a synthetic rig stand beside one another.
    disparity = np.float32(reference.focal_px * rig.baseline_m(i, k)) / depth_m
    disparity[~np.isfinite(depth_m)] = np.nan
    return drive.image(number, k).pixels, drive.image(number, i).pixels, _inside(disparity, source)


def _inside(disparity: Floats32, source: Camera) -> Floats32:
    """Floats32 without those whose match lies outside the source camera's image, or behind it."""
    match = np.arange(disparity.shape[1], dtype=np.float32) - disparity
    there = (disparity > 0) & (match >= 0) & (match < source.width_px)
    return np.where(there, disparity, np.float32(np.nan))


@dataclass(frozen=True)
class SampleTask:
    """One source whose samples are wanted in a folder, at most so many of them, spread over it."""

    source: SampleSource
    folder: Path
    at_most: int

    def __str__(self) -> str:
        return str(self.source)


@dataclass(frozen=True)
class SampleSet:
    """The samples of one source: files in the order of the frames, and whether they were made just now."""

    source_id: str
    kind: str
    files: tuple[Path, ...]
    fresh: bool


def make_samples(task: SampleTask, progress: Callable[[str, int], None]) -> SampleSet:
    """Write the samples of a source into a folder of their own; existing ones are not made again.

    Raises RecordingError, RigError, and SettingError where they cannot be written.
    """
    with task.source.open() as samples:
        folder = task.folder / f"{samples.source_id[:16]}_{task.at_most}"
        fresh = not folder.is_dir()
        if fresh:
            beside = folder.with_suffix(".part")
            try:
                shutil.rmtree(beside, ignore_errors=True)
                beside.mkdir(parents=True)
                _write(samples.numbered, beside, task.at_most, lambda done: progress("", done))
                beside.rename(folder)
            except OSError as error:
                raise SettingError(
                    error.strerror or str(error), where=folder, remedy="choose another --out folder"
                ) from error
        return SampleSet(samples.source_id, samples.kind, tuple(sorted(folder.glob(f"*{_SUFFIX}"))), fresh)


def _write(numbered: Iterator[tuple[int, Sample]], folder: Path, at_most: int, progress: Callable[[int], None]) -> None:
    """Every frame until there are too many, then every second of them, every fourth: evenly spread, whatever comes."""
    stride, kept = 1, 0
    for number, sample in numbered:
        if number % stride:
            continue
        _pack(sample, folder / f"{number:08}{_SUFFIX}")
        kept += 1
        while kept > at_most:
            stride *= 2
            for file in [file for file in folder.iterdir() if int(file.stem) % stride]:
                file.unlink()
                kept -= 1
        if kept % _REPORT_EVERY == 0:
            progress(kept)


@dataclass(frozen=True)
class SampleFiles(Sequence[Sample]):
    """Samples in files, each read when it is used."""

    files: tuple[Path, ...]

    def __len__(self) -> int:
        """How many there are."""
        return len(self.files)

    @overload
    def __getitem__(self, place: int) -> Sample: ...
    @overload
    def __getitem__(self, place: slice) -> Sequence[Sample]: ...
    def __getitem__(self, place: int | slice) -> Sample | Sequence[Sample]:
        """One of them, or some. Raises SettingError where a file is missing or not whole."""
        return SampleFiles(self.files[place]) if isinstance(place, slice) else _unpacked(self.files[place])


def _pack(sample: Sample, file: Path) -> None:
    left, right, disparity = sample
    filled = np.nan_to_num(disparity, nan=0.0)
    np.savez_compressed(file, left=left, right=right, disparity=np.rint(filled * _UNITS).astype(np.uint16))


def _unpacked(file: Path) -> Sample:
    try:
        check_file(file, SAMPLE)
        with np.load(file, allow_pickle=False) as arrays:
            left, right, units = (arrays[name] for name in ("left", "right", "disparity"))
    except (OSError, ValueError, KeyError, BadZipFile, MemoryError, UnsafeZipError) as error:
        raise SettingError(
            "it is not a readable sample", where=file, remedy="remove its folder: it is made again"
        ) from error
    return left, right, np.where(units > 0, units / np.float32(_UNITS), np.float32(np.nan))
