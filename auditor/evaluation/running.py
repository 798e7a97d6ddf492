"""Evaluating one recording: its frames times the experiments' cases, measured into a store, stretch by stretch."""

import hashlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from time import perf_counter

from auditor import __version__
from auditor.evaluation.bench import Bench
from auditor.evaluation.experiments import EXPERIMENTS, Dice, Experiment, all_triples
from auditor.evaluation.further import FURTHER, pattern_cases, read_patterns
from auditor.evaluation.intervals import INTERVALS
from auditor.evaluation.sources import CleanDrive, Source
from auditor.evaluation.stretches import Stretches, all_finished
from auditor.evidence import use_one_thread
from auditor.evidence.matchers import NO_NETWORK, Matcher, MatcherOptions, find_matcher, libraries
from auditor.frames import Frame, Skipped
from auditor.results import Procedure
from auditor.store import Store
from auditor.store.evaluations import CasesWriter, EvaluationPart, MeasuredCase, cases_writer, finished_part
from auditor.store.records import content_id

_VERSIONED = ("numpy", "opencv-python-headless")


@dataclass(frozen=True)
class EvaluateTask:
    """A share of one source's stretches: every `of`-th, from the `share`-th. The seed decides the attacks.

    All frames are measured clean, each `attack_every`-th attacked as well, by their numbers. `patterns` are picture
    files of laser patterns to lay over the images.
    """

    source: Source
    store: Path
    matcher: str = "sgbm"
    network: MatcherOptions = NO_NETWORK
    seed: int = 0
    draws: int = 1
    attack_every: int = 1
    patterns: tuple[Path, ...] = ()
    share: int = 0
    of: int = 1

    def __str__(self) -> str:
        return f"{self.source}" + (f" ({self.share + 1}/{self.of})" if self.of > 1 else "")


@dataclass(frozen=True)
class Evaluated:
    """What was done for a task: frames and cases measured just now, and whether anything had to be."""

    frames: int
    cases: int

    @property
    def fresh(self) -> bool:
        """True where something was measured."""
        return self.cases > 0


def evaluate_source(task: EvaluateTask, progress: Callable[[str, int], None]) -> Evaluated:
    """Measure every case of every clean frame; what is finished already is not measured again.

    Raises RecordingError, RigError, SettingError and StoreError.
    """
    use_one_thread()
    matcher = find_matcher(task.matcher, task.network)
    store = Store.open(task.store, create=True)
    with task.source.open(colour=matcher.colour) as drive:
        run = _Run(task, drive, matcher, store)
        if run.finished():
            return Evaluated(0, 0)
        store.write_rig(drive.rig)
        stretches = Stretches(drive.frames)
        for stretch, frames in stretches:
            if stretch % task.of == task.share:
                run.measure(stretch, frames, stretches, progress)
        return Evaluated(run.frames, run.cases)


class _Run:
    def __init__(self, task: EvaluateTask, drive: CleanDrive, matcher: Matcher, store: Store) -> None:
        self._task = task
        self._drive = drive
        self._matcher = matcher
        self._store = store
        self._experiments = experiments_of(task.patterns)
        self.frames = 0
        self.cases = 0

    def part(self, experiment: Experiment, stretch: int) -> EvaluationPart:
        return EvaluationPart(
            recording_id=self._drive.recording_id,
            name=self._drive.name,
            synthetic=self._drive.synthetic,
            rig_id=self._drive.rig.rig_id,
            procedure=Procedure(self._matcher.name, self._matcher.settings),
            experiment=experiment.name,
            seed=self._task.seed if experiment.drawn else None,
            draws=self._task.draws if experiment.drawn else None,
            stretch=stretch,
            inputs=experiment.inputs,
            attack_every=self._task.attack_every if experiment.attacks else None,
        )

    def finished(self) -> bool:
        """True where every stretch of this share is there, and the last one is known."""
        return all_finished(
            lambda stretch: [finished_part(self._store, self.part(one, stretch)) for one in self._experiments],
            share=self._task.share,
            of=self._task.of,
        )

    def measure(
        self,
        stretch: int,
        frames: Iterator[Frame | Skipped],
        stretches: Stretches,
        progress: Callable[[str, int], None],
    ) -> None:
        todo = [e for e in self._experiments if finished_part(self._store, self.part(e, stretch)) is None]
        if not todo:
            return
        with ExitStack() as stack:
            writers = [stack.enter_context(cases_writer(self._store, self.part(e, stretch))) for e in todo]
            seconds, counts = [0.0] * len(todo), [0] * len(todo)
            skipped = 0
            for frame in frames:
                if isinstance(frame, Skipped):
                    skipped += 1
                    continue
                for at, spent in self._measure_frame(frame, tuple(stretches.past), todo, writers):
                    seconds[at] += spent
                    counts[at] += 1
                self.frames += 1
                progress(self._drive.name, self.frames)
            for writer, count, spent in zip(writers, counts, seconds, strict=True):
                writer.commit(
                    frames=count,
                    skipped=skipped,
                    last=stretches.ended,
                    seconds=spent,
                    versions=versions_of(self._matcher),
                    evaluated_at=datetime.now(UTC),
                )

    def _measure_frame(
        self,
        frame: Frame,
        past: Sequence[Frame],
        experiments: Sequence[Experiment],
        writers: Sequence[CasesWriter],
    ) -> Iterator[tuple[int, float]]:
        """Measure all cases; yields the places of the experiments that look at this frame, and their seconds."""
        bench = Bench(frame, self._drive.rig, self._matcher)
        for at, (experiment, writer) in enumerate(zip(experiments, writers, strict=True)):
            if not experiment.takes(frame.number, self._task.attack_every):
                continue
            started = perf_counter()
            for draw in range(self._task.draws if experiment.drawn else 1):
                for case in self._measured(bench, past, experiment, draw):
                    writer.add(case)
                    self.cases += 1
            yield at, perf_counter() - started

    def _measured(
        self, bench: Bench, past: Sequence[Frame], experiment: Experiment, draw: int
    ) -> Iterator[MeasuredCase]:
        frame, rig = bench.frame, self._drive.rig
        dice = Dice(self._task.seed, int(self._drive.recording_id[:8], 16), frame.number, draw)
        triples, present = experiment.triples(rig), set(bench.sensors)
        cases = [case for case in experiment.cases(rig, dice, past) if present.issuperset(case.attacked)]
        bench.match_together((case.attacks for case in cases), triples)
        for case in cases:
            yield MeasuredCase(
                frame=frame.number,
                stamp_ns=frame.stamp_ns,
                draw=draw,
                attacked=case.attacked,
                attack=case.attack,
                strength=case.strength,
                size=case.size,
                visible_share=case.visible_share,
                parameters={f"S_{s}": {"attack": a.name, **a.parameters} for s, a in sorted(case.attacks.items())},
                counts=bench.counts(case.attacks, triples),
                ratios=bench.ratios(case.attacks, triples),
            )
        bench.forget_attacks()


def experiments_of(patterns: Sequence[Path]) -> tuple[Experiment, ...]:
    """All experiments, those with the user's laser patterns last. Raises SettingError where one cannot be read."""
    if not patterns:
        return (*EXPERIMENTS, FURTHER, INTERVALS)
    read = read_patterns(patterns)
    inputs = content_id("patterns", *((one.title, hashlib.sha256(one.pixels.tobytes()).hexdigest()) for one in read))
    on_each = Experiment("patterns", all_triples, pattern_cases(read), drawn=False, inputs=inputs)
    return (*EXPERIMENTS, FURTHER, INTERVALS, on_each)


def versions_of(matcher: Matcher) -> dict[str, str]:
    """Of auditor and of the libraries that matter."""
    return {"auditor": __version__} | {name: version(name) for name in _VERSIONED} | dict(libraries(matcher))
