"""The evaluation of one recording: its frames times the cases of some experiments, kept chunk by chunk."""

import hashlib
import itertools
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import KW_ONLY, dataclass
from datetime import UTC, datetime
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from time import perf_counter
from typing import Any

from auditor import __version__
from auditor.errors import RigError
from auditor.lab.evaluation.attacked_frame import AttackedFrame, InTime
from auditor.lab.evaluation.experiments import (
    DELAYS,
    EXPERIMENTS,
    FURTHER,
    INTERVALS,
    LADDERS,
    AttackCase,
    Experiment,
    SeededDraws,
    all_triples,
    parameters_of,
    pattern_cases,
    read_patterns,
)
from auditor.lab.evaluation.features import FeaturesOfCases
from auditor.lab.evaluation.sources import CleanFrameSource, Source
from auditor.measurement import use_one_thread
from auditor.measurement.disparity.matchers import NO_NETWORK, Matcher, MatcherOptions, find_matcher, libraries
from auditor.model.frames import Frame, SkippedFrame
from auditor.model.rig import Rig
from auditor.pipeline.measured import procedure_by
from auditor.resources import plug_ins
from auditor.store.evaluation_tables import (
    CaseRow,
    EvaluationPart,
    ExperimentChunk,
    MeasuredCase,
    PartWriter,
    finished_part,
    part_writer,
)
from auditor.store.log.runs import logged
from auditor.store.records import content_id
from auditor.store.store import Store

CHUNK_FRAMES = 20
"""Frames of a chunk: a killed evaluation loses no more than these."""


class Chunks:
    """Chunks of frames by number. `past` holds the frames before the current one, the latest last."""

    def __init__(self, frames: Iterator[Frame | SkippedFrame]) -> None:
        self._frames = frames
        self._ahead: deque[Frame | SkippedFrame] = deque()
        self.past: deque[Frame] = deque(maxlen=max(DELAYS))

    def __iter__(self) -> Iterator[tuple[int, Iterator[Frame | SkippedFrame]]]:
        for chunk in itertools.count():
            end = (chunk + 1) * CHUNK_FRAMES
            yield chunk, self._below(end)
            for _ in self._below(end):  # the frames that the caller left unread
                pass
            if self.ended:
                return

    @property
    def ended(self) -> bool:
        """True once the last frame has been given."""
        return self._next is None

    @property
    def following(self) -> Frame | None:
        """The frame after the current one; skipped frames between them are given later."""
        for item in self._ahead:
            if isinstance(item, Frame):
                return item
        for item in self._frames:
            self._ahead.append(item)
            if isinstance(item, Frame):
                return item
        return None

    @property
    def _next(self) -> Frame | SkippedFrame | None:
        if not self._ahead:
            self._ahead.extend(itertools.islice(self._frames, 1))
        return self._ahead[0] if self._ahead else None

    def _below(self, end: int) -> Iterator[Frame | SkippedFrame]:
        while (frame := self._next) is not None and frame.number < end:
            self._ahead.popleft()
            yield frame
            if isinstance(frame, Frame):
                self.past.append(frame)


def all_finished(parts: Callable[[int], Sequence[bool | None]], *, share: int, of: int) -> bool:
    """True where every chunk of a share, each `of`-th, is finished, and the last one is known.

    `parts` gives the parts of a chunk: None where one is not finished, else whether the recording ends in it.
    """
    for chunk in itertools.count():
        chunk_parts = parts(chunk)
        if (chunk % of == share and None in chunk_parts) or all(part is None for part in chunk_parts):
            return False
        if any(chunk_parts):
            return True
    raise AssertionError  # counting has no end


_VERSIONED = ("numpy", "opencv-python-headless")
Progress = Callable[[str, int], None]


@dataclass(frozen=True)
class Task:
    """A share of one source's chunks: every `of`-th, from the `share`-th. The seed determines the attacks.

    All frames are measured clean, each `attack_every`-th attacked as well, by their numbers.
    """

    source: Source
    store: Path
    _: KW_ONLY
    matcher: str = "sgbm"
    network: MatcherOptions = NO_NETWORK
    seed: int = 0
    draws: int = 1
    attack_every: int = 1
    share: int = 0
    of: int = 1

    def __str__(self) -> str:
        return f"{self.source}" + (f" ({self.share + 1}/{self.of})" if self.of > 1 else "")


@dataclass(frozen=True)
class EvaluationWork:
    """The work done for a task: the numbers of frames and cases that were measured in this run, and of what."""

    frames: int
    cases: int
    recordings: frozenset[str] = frozenset()

    @property
    def fresh(self) -> bool:
        """True where something was measured."""
        return self.cases > 0


class DriveEvaluation(ABC):
    """Goes through the frames of a drive for every experiment; finished chunks are not evaluated again."""

    def __init__(
        self, task: Task, drive: CleanFrameSource, matcher: Matcher, store: Store, experiments: Sequence[Experiment]
    ) -> None:
        self._task = task
        self._drive = drive
        self._matcher = matcher
        self._store = store
        self._experiments = experiments
        self._attacked_frames: dict[int, AttackedFrame] = {}
        self._frames = 0
        self._cases = 0

    @abstractmethod
    def part(self, experiment: Experiment, chunk: int) -> ExperimentChunk:
        """The part of the store that holds an experiment on a chunk."""

    @abstractmethod
    def results(self, now: InTime, experiment: Experiment, draw: int, cases: Sequence[AttackCase]) -> Iterator[CaseRow]:
        """The results of these cases of one frame, to be kept."""

    def versions(self) -> Mapping[str, str]:
        """The versions of auditor and of the libraries that can change a result."""
        named = {name: version(name) for name in _VERSIONED}
        return plug_ins() | {"auditor": __version__} | named | dict(libraries(self._matcher))

    def go(self, progress: Progress) -> EvaluationWork:
        """Evaluate the chunks that are not finished. Raises RecordingError, RigError and StoreError."""
        _check(self._drive.rig, self._task.source)
        if self._finished():
            return EvaluationWork(0, 0, frozenset([self._drive.recording_id]))
        with logged(self._store.folder) as entry:
            entry.used("recording", self._drive.recording_id, self._drive.name)
            self._store.write_rig(self._drive.rig)
        chunks = Chunks(self._drive.frames)
        for chunk, frames in chunks:
            if chunk % self._task.of == self._task.share:
                self._evaluate_chunk(chunk, frames, chunks, progress)
        return EvaluationWork(self._frames, self._cases, frozenset([self._drive.recording_id]))

    def shared_columns(self, experiment: Experiment, chunk: int) -> dict[str, Any]:
        """The columns that identify a part, whatever its kind."""
        task, drive = self._task, self._drive
        return {
            "recording_id": drive.recording_id,
            "name": drive.name,
            "synthetic": drive.synthetic,
            "rig_id": drive.rig.rig_id,
            "procedure": procedure_by(self._matcher, drive.rig.kind.compared_to),
            "experiment": experiment.name,
            "seed": task.seed if experiment.drawn else None,
            "draws": task.draws if experiment.drawn else None,
            "chunk": chunk,
            "attack_every": task.attack_every if experiment.attacks else None,
        }

    def _finished(self) -> bool:
        """True where every chunk of this share is finished, and the last one is known."""
        return all_finished(
            lambda chunk: [finished_part(self._store, self.part(one, chunk)) for one in self._experiments],
            share=self._task.share,
            of=self._task.of,
        )

    def _evaluate_chunk(
        self, chunk: int, frames: Iterator[Frame | SkippedFrame], chunks: Chunks, progress: Progress
    ) -> None:
        todo = [e for e in self._experiments if finished_part(self._store, self.part(e, chunk)) is None]
        if not todo:
            return
        with ExitStack() as stack:
            writers = [stack.enter_context(part_writer(self._store, self.part(e, chunk))) for e in todo]
            seconds, counts = [0.0] * len(todo), [0] * len(todo)
            skipped = 0
            for frame in frames:
                if isinstance(frame, SkippedFrame):
                    skipped += 1
                    continue
                now = self._in_time(frame, chunks)
                for at, (experiment, writer) in enumerate(zip(todo, writers, strict=True)):
                    if experiment.takes(frame.number, self._task.attack_every):
                        started = perf_counter()
                        self._attack(now, tuple(chunks.past), experiment, writer)
                        seconds[at] += perf_counter() - started
                        counts[at] += 1
                self._frames += 1
                progress(self._drive.name, self._frames)
            for writer, count, spent in zip(writers, counts, seconds, strict=True):
                writer.commit(
                    frames=count,
                    skipped=skipped,
                    last=chunks.ended,
                    seconds=spent,
                    versions=self.versions(),
                    evaluated_at=datetime.now(UTC),
                )

    def _in_time(self, frame: Frame, chunks: Chunks) -> InTime:
        """The attacked frame with its neighbours; results of the same clean frame are used again."""
        before = chunks.past[-1] if chunks.past else None
        near = [one for one in (before, frame, chunks.following) if one is not None]
        frames = self._attacked_frames
        self._attacked_frames = {
            f.number: frames.get(f.number) or AttackedFrame(f, self._drive.rig, self._matcher) for f in near
        }
        return InTime(
            self._attacked_frames[frame.number],
            self._attacked_frames[before.number] if before is not None else None,
            self._attacked_frames[near[-1].number] if near[-1] is not frame else None,
        )

    def _attack(self, now: InTime, past: Sequence[Frame], experiment: Experiment, writer: PartWriter) -> None:
        attacked_frame, present = now.attacked_frame, set(now.attacked_frame.sensors)
        for draw in range(self._task.draws if experiment.drawn else 1):
            draws = SeededDraws(
                self._task.seed, int(self._drive.recording_id[:8], 16), attacked_frame.frame.number, draw
            )
            cases = [
                case for case in experiment.cases(attacked_frame.rig, draws, past) if present.issuperset(case.attacked)
            ]
            for kept in self.results(now, experiment, draw, cases):
                writer.add(kept)
                self._cases += 1
            attacked_frame.forget_attacks()


def _check(rig: Rig, where: Source) -> None:
    """Raises RigError where a rig has no three sensors to compare; attacks are put into frames one by one."""
    if not rig.triples or rig.by_time:
        cameras = f"{rig.n} camera{'s' * (rig.n != 1)}"
        raise RigError(
            f"no triple possible: the rig has {cameras} and {'a' if rig.lidar else 'no'} LiDAR",
            where=where,
            remedy="evaluate on recordings of two cameras side by side and a LiDAR, or of three cameras",
        )


@dataclass(frozen=True)
class EvaluateTask(Task):
    """Measure all experiments; `patterns` are picture files of laser patterns to lay over the images."""

    _: KW_ONLY
    patterns: tuple[Path, ...] = ()


def evaluate_source(task: EvaluateTask, progress: Progress) -> EvaluationWork:
    """Measure every case of every clean frame, by each rig of the source; finished chunks are not measured again.

    Raises RecordingError, RigError, SettingError and StoreError.
    """
    use_one_thread()
    matcher = find_matcher(task.matcher, task.network)
    store = Store.open(task.store, create=True)
    experiments = experiments_of(task.patterns)
    with task.source.open() as drives:
        return together(_Run(task, drive, matcher, store, experiments).go(progress) for drive in drives)


def together(parts: Iterable[EvaluationWork]) -> EvaluationWork:
    """The work done for all rigs of a source."""
    done = list(parts)
    of = frozenset(recording for one in done for recording in one.recordings)
    return EvaluationWork(sum(one.frames for one in done), sum(one.cases for one in done), of)


class _Run(DriveEvaluation):
    @cached_property
    def _features(self) -> FeaturesOfCases:
        return FeaturesOfCases()

    def part(self, experiment: Experiment, chunk: int) -> EvaluationPart:
        shared = self.shared_columns(experiment, chunk)
        return EvaluationPart(**shared, inputs=experiment.inputs, family=self._drive.family)

    def results(
        self, now: InTime, experiment: Experiment, draw: int, cases: Sequence[AttackCase]
    ) -> Iterator[MeasuredCase]:
        attacked_frame, triples = now.attacked_frame, experiment.triples(now.attacked_frame.rig)
        attacked_frame.match_together((case.attacks for case in cases), triples)
        for case in cases:
            yield MeasuredCase(
                frame=attacked_frame.frame.number,
                stamp_ns=attacked_frame.frame.stamp_ns,
                draw=draw,
                attacked=case.attacked,
                attack=case.attack,
                strength=case.strength,
                size=case.size,
                visible_share=case.visible_share,
                parameters=parameters_of(case.attacks),
                counts=attacked_frame.counts(case.attacks, triples),
                statistics=attacked_frame.statistics(case.attacks, triples),
                features=self._features.of(now, experiment, draw, case),
            )


def experiments_of(patterns: Sequence[Path]) -> tuple[Experiment, ...]:
    """All experiments, those with the user's laser patterns last. Raises SettingError where a file cannot be read."""
    if not patterns:
        return (*EXPERIMENTS, FURTHER, INTERVALS, LADDERS)
    read = read_patterns(patterns)
    inputs = content_id("patterns", *((one.title, hashlib.sha256(one.pixels.tobytes()).hexdigest()) for one in read))
    on_each = Experiment("patterns", all_triples, pattern_cases(read), drawn=False, inputs=inputs)
    return (*EXPERIMENTS, FURTHER, INTERVALS, LADDERS, on_each)
