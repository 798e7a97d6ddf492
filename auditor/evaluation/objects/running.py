"""The object-level baseline on one recording: its frames times the cases that compare with the method's."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from time import perf_counter

from auditor.errors import SettingError
from auditor.evaluation.bench import Bench
from auditor.evaluation.experiments import EXPERIMENTS, Case, Dice, Experiment
from auditor.evaluation.objects.scoring import Scored, score_in_image, score_on_ground
from auditor.evaluation.objects.seeing import ObjectBench, in_view, scenarios
from auditor.evaluation.running import Evaluated, versions_of
from auditor.evaluation.sources import CleanDrive, Source
from auditor.evaluation.stretches import Stretches, all_finished
from auditor.evidence import use_one_thread
from auditor.evidence.detectors import Detectors, find_detectors
from auditor.evidence.matchers import NO_NETWORK, Matcher, MatcherOptions, find_matcher
from auditor.frames import Frame, Skipped
from auditor.recordings.object_labels import LabelledDrive, ObjectLabel, read_object_labels
from auditor.results import Procedure
from auditor.rig import LIDAR, Rig, Triple
from auditor.store import Store
from auditor.store.object_evaluations import (
    ObjectCase,
    ObjectCasesWriter,
    ObjectPart,
    finished_object_part,
    object_cases_writer,
)

_SENSITIVITY = "sensitivity"


@dataclass(frozen=True)
class ObjectTask:
    """A share of one source's stretches, as in `EvaluateTask`; `detectors` are names, `labels` a folder of KITTI's."""

    source: Source
    store: Path
    detectors: tuple[str, ...]
    labels: Path | None = None
    matcher: str = "sgbm"
    network: MatcherOptions = NO_NETWORK
    seed: int = 0
    draws: int = 1
    attack_every: int = 1
    share: int = 0
    of: int = 1

    def __str__(self) -> str:
        return f"{self.source}, objects" + (f" ({self.share + 1}/{self.of})" if self.of > 1 else "")


def check_detectors(detectors: Sequence[str], labels: Path | None) -> None:
    """Raises SettingError where a detector cannot be used, or labels have nobody whom they could score."""
    found = find_detectors(detectors)
    if labels is not None and found.camera is None and found.cloud is None:
        raise SettingError(
            "labels need a detector whose objects have kinds", where="--labels", remedy="add --detector onnx:FILE"
        )


def evaluate_objects(task: ObjectTask, progress: Callable[[str, int], None]) -> Evaluated:
    """Compare the sensors' objects in every case; what is finished already is not looked at again.

    Raises RecordingError, RigError, SettingError and StoreError.
    """
    use_one_thread()
    matcher, detectors = find_matcher(task.matcher, task.network), find_detectors(task.detectors)
    store = Store.open(task.store, create=True)
    with task.source.open(colour=matcher.colour or detectors.camera is not None) as drive:
        labels = read_object_labels(task.labels, drive.name) if task.labels else None
        run = _Run(task, drive, matcher, detectors, labels, store)
        if run.finished():
            return Evaluated(0, 0)
        store.write_rig(drive.rig)
        stretches = Stretches(drive.frames)
        for stretch, frames in stretches:
            if stretch % task.of == task.share:
                run.compare(stretch, frames, stretches, progress)
        return Evaluated(run.frames, run.cases)


class _Run:
    def __init__(
        self,
        task: ObjectTask,
        drive: CleanDrive,
        matcher: Matcher,
        detectors: Detectors,
        labels: LabelledDrive | None,
        store: Store,
    ) -> None:
        self._task = task
        self._drive = drive
        self._matcher = matcher
        self._detectors = detectors
        self._labels = labels
        self._store = store
        known = labels is not None and (detectors.camera is not None or detectors.cloud is not None)
        self._experiments = [one for one in EXPERIMENTS if known or one.name != _SENSITIVITY]
        self.frames = 0
        self.cases = 0

    def finished(self) -> bool:
        """True where every stretch of this share is there, and the last one is known."""
        return all_finished(
            lambda stretch: [finished_object_part(self._store, self.part(one, stretch)) for one in self._experiments],
            share=self._task.share,
            of=self._task.of,
        )

    def part(self, experiment: Experiment, stretch: int) -> ObjectPart:
        return ObjectPart(
            recording_id=self._drive.recording_id,
            name=self._drive.name,
            synthetic=self._drive.synthetic,
            rig_id=self._drive.rig.rig_id,
            procedure=Procedure(self._matcher.name, self._matcher.settings),
            detector=self._detectors.name,
            detector_settings=self._detectors.settings,
            experiment=experiment.name,
            seed=self._task.seed if experiment.drawn else None,
            draws=self._task.draws if experiment.drawn else None,
            labels=self._labels.content if self._labels else None,
            stretch=stretch,
            attack_every=self._task.attack_every if experiment.attacks else None,
        )

    def compare(
        self,
        stretch: int,
        frames: Iterator[Frame | Skipped],
        stretches: Stretches,
        progress: Callable[[str, int], None],
    ) -> None:
        todo = [e for e in self._experiments if finished_object_part(self._store, self.part(e, stretch)) is None]
        if not todo:
            return
        with ExitStack() as stack:
            writers = [stack.enter_context(object_cases_writer(self._store, self.part(e, stretch))) for e in todo]
            seconds, counts = [0.0] * len(todo), [0] * len(todo)
            skipped = 0
            for frame in frames:
                if isinstance(frame, Skipped):
                    skipped += 1
                    continue
                bench = Bench(frame, self._drive.rig, self._matcher)
                for at, (experiment, writer) in enumerate(zip(todo, writers, strict=True)):
                    if not experiment.takes(frame.number, self._task.attack_every):
                        continue
                    started = perf_counter()
                    self._compare_frame(bench, experiment, writer)
                    seconds[at] += perf_counter() - started
                    counts[at] += 1
                self.frames += 1
                progress(self._drive.name, self.frames)
            for writer, count, spent in zip(writers, counts, seconds, strict=True):
                writer.commit(
                    frames=count,
                    skipped=skipped,
                    last=stretches.ended,
                    seconds=spent,
                    versions=versions_of(self._matcher) | dict(self._detectors.libraries),
                    evaluated_at=datetime.now(UTC),
                )

    def _compare_frame(self, bench: Bench, experiment: Experiment, writer: ObjectCasesWriter) -> None:
        frame, objects = bench.frame, ObjectBench(bench, self._detectors)
        for draw in range(self._task.draws if experiment.drawn else 1):
            dice = Dice(self._task.seed, int(self._drive.recording_id[:8], 16), frame.number, draw)
            cases = [case for case in experiment.cases(bench.rig, dice, ()) if set(case.attacked) <= set(bench.sensors)]
            if self._detectors.camera is None and experiment.name != _SENSITIVITY:
                compared = (case.attacks for case in cases if self._triples(bench, case, experiment))
                bench.match_together(compared, scenarios(bench.rig))
            for case in cases:
                overlaps = self._overlaps(objects, bench, case, experiment)
                scored = self._scored(objects, bench, case)
                if scored or any(one is not None for one in overlaps):
                    rows = [asdict(one) for one in scored]
                    varied = case.strength, case.size, case.visible_share
                    writer.add(ObjectCase(frame.number, frame.stamp_ns, draw, case.attacked, *varied, overlaps, rows))
                    self.cases += 1
            bench.forget_attacks()

    def _overlaps(
        self, objects: ObjectBench, bench: Bench, case: Case, experiment: Experiment
    ) -> list[tuple[float, ...] | None]:
        """By triple; None for those that are not compared."""
        compared = self._triples(bench, case, experiment)
        return [objects.agreement(triple, case.attacks) if triple in compared else None for triple in bench.rig.triples]

    @staticmethod
    def _triples(bench: Bench, case: Case, experiment: Experiment) -> list[Triple]:
        """Those whose sensors are all there, and hold all that are attacked."""
        asked = scenarios(bench.rig) if experiment.name != _SENSITIVITY else ()
        return [triple for triple in asked if set(bench.sensors) >= set(triple) >= set(case.attacked)]

    def _scored(self, objects: ObjectBench, bench: Bench, case: Case) -> list[Scored]:
        """What the detectors found against the labels: of clean data, and of what a sensitivity case varies."""
        labels = self._labels.frames.get(bench.frame.number) if self._labels else None
        if labels is None or (case.attacked and case.size is None):
            return []
        return list(_score(objects, bench, case, labels, self._detectors))


def _score(
    objects: ObjectBench, bench: Bench, case: Case, labels: Sequence[ObjectLabel], detectors: Detectors
) -> Iterator[Scored]:
    rig: Rig = bench.view_rig
    looked_at = set(case.attacked or rig.sensors) & set(bench.sensors)
    if detectors.camera is not None and rig.n in looked_at:
        yield from score_in_image(rig.n, objects.in_image(rig.n, case.attacks), labels, detectors.camera.labels)
    if detectors.cloud is not None and LIDAR in looked_at:
        found = objects.in_cloud(case.attacks)
        yield from score_on_ground(
            LIDAR, found, labels, detectors.cloud.labels, lambda box: in_view(box, rig.camera(rig.n))
        )
