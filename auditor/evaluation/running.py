"""The experiments on one recording: what is measured of its frames, clean and attacked."""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import KW_ONLY, dataclass
from pathlib import Path

from auditor.evaluation.bench import Bench
from auditor.evaluation.experiments import EXPERIMENTS, Case, Experiment, all_triples
from auditor.evaluation.further import FURTHER, pattern_cases, read_patterns
from auditor.evaluation.intervals import INTERVALS
from auditor.evaluation.runs import Evaluated, Progress, Run, Task
from auditor.evidence import use_one_thread
from auditor.evidence.matchers import find_matcher
from auditor.store import Store
from auditor.store.evaluations import EvaluationPart, MeasuredCase
from auditor.store.records import content_id


@dataclass(frozen=True)
class EvaluateTask(Task):
    """Measure all experiments; `patterns` are picture files of laser patterns to lay over the images."""

    _: KW_ONLY
    patterns: tuple[Path, ...] = ()


def evaluate_source(task: EvaluateTask, progress: Progress) -> Evaluated:
    """Measure every case of every clean frame; what is finished already is not measured again.

    Raises RecordingError, RigError, SettingError and StoreError.
    """
    use_one_thread()
    matcher = find_matcher(task.matcher, task.network)
    store = Store.open(task.store, create=True)
    with task.source.open(colour=matcher.colour) as drive:
        return _Run(task, drive, matcher, store, experiments_of(task.patterns)).go(progress)


class _Run(Run):
    def part(self, experiment: Experiment, stretch: int) -> EvaluationPart:
        return EvaluationPart(**self.shared_columns(experiment, stretch), inputs=experiment.inputs)

    def look(self, bench: Bench, experiment: Experiment, draw: int, cases: Sequence[Case]) -> Iterator[MeasuredCase]:
        triples = experiment.triples(bench.rig)
        bench.match_together((case.attacks for case in cases), triples)
        for case in cases:
            yield MeasuredCase(
                frame=bench.frame.number,
                stamp_ns=bench.frame.stamp_ns,
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


def experiments_of(patterns: Sequence[Path]) -> tuple[Experiment, ...]:
    """All experiments, those with the user's laser patterns last. Raises SettingError where one cannot be read."""
    if not patterns:
        return (*EXPERIMENTS, FURTHER, INTERVALS)
    read = read_patterns(patterns)
    inputs = content_id("patterns", *((one.title, hashlib.sha256(one.pixels.tobytes()).hexdigest()) for one in read))
    on_each = Experiment("patterns", all_triples, pattern_cases(read), drawn=False, inputs=inputs)
    return (*EXPERIMENTS, FURTHER, INTERVALS, on_each)
