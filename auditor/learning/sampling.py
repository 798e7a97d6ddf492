"""Samples on disk: made once, whole or not at all, then read in any order as often as training needs them."""

import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import overload
from zipfile import BadZipFile

import numpy as np

from auditor.errors import SettingError
from auditor.evidence.matchers.scoring import Sample
from auditor.learning.sources import SampleSource

_SUFFIX = ".npz"
_UNITS = 64.0  # disparities are kept as whole numbers of this share of a pixel, 0 where unknown
_REPORT_EVERY = 5


@dataclass(frozen=True)
class SampleTask:
    """One source whose samples are wanted in a folder, at most so many of them, spread over it."""

    source: SampleSource
    folder: Path
    at_most: int

    def __str__(self) -> str:
        return str(self.source)


@dataclass(frozen=True)
class Made:
    """The samples of one source: files in the order of the frames, and whether they were made just now."""

    source_id: str
    kind: str
    files: tuple[Path, ...]
    fresh: bool


def make_samples(task: SampleTask, progress: Callable[[str, int], None]) -> Made:
    """Write the samples of a source into a folder of their own; those that are there already are not made again.

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
        return Made(samples.source_id, samples.kind, tuple(sorted(folder.glob(f"*{_SUFFIX}"))), fresh)


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
    """Samples in files, read when they are asked for."""

    files: tuple[Path, ...]

    def __len__(self) -> int:
        """How many there are."""
        return len(self.files)

    @overload
    def __getitem__(self, place: int) -> Sample: ...
    @overload
    def __getitem__(self, place: slice) -> Sequence[Sample]: ...
    def __getitem__(self, place: int | slice) -> Sample | Sequence[Sample]:
        """One of them, or some. Raises SettingError where a file is no longer there, or not whole."""
        return SampleFiles(self.files[place]) if isinstance(place, slice) else _unpacked(self.files[place])


def _pack(sample: Sample, file: Path) -> None:
    left, right, disparity = sample
    known = np.nan_to_num(disparity, nan=0.0)
    np.savez_compressed(file, left=left, right=right, disparity=np.rint(known * _UNITS).astype(np.uint16))


def _unpacked(file: Path) -> Sample:
    try:
        with np.load(file, allow_pickle=False) as arrays:
            left, right, units = (arrays[name] for name in ("left", "right", "disparity"))
    except (OSError, ValueError, KeyError, BadZipFile) as error:
        raise SettingError("no readable sample", where=file, remedy="remove its folder: it is made again") from error
    return left, right, np.where(units > 0, units / np.float32(_UNITS), np.float32(np.nan))
