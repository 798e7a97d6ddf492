"""Stores of evaluations in which attacks raise the E of their triples."""

from datetime import UTC, datetime

import numpy as np

from auditor.lab.evaluation import judge_cases
from auditor.lab.evaluation.experiments import EXPERIMENTS, SeededDraws
from auditor.model.measurement import Counts
from auditor.store.evaluation_tables import EvaluationPart, MeasuredCase, part_writer
from tests.making.drawn_statistics import drawn_statistics
from tests.making.stores import PERIOD_NS, make_features, new_store, part_columns


def evaluated(folder, rig, *, frames=10, attacked=None, names=("a.mcap", "b.mcap"), seen=0.9, experiments=EXPERIMENTS):
    """A store in which an attack raises the E of its triples, in a share of its cases.

    Only the first `attacked` frames are attacked, where it says how many.
    """
    store = new_store(folder)
    store.write_rig(rig)
    rng = np.random.default_rng(5)
    for number, name in enumerate(names):
        for experiment in experiments:
            drawn = 1 if experiment.drawn else None
            part = EvaluationPart(**part_columns(rig, f"{number}", experiment.name, drawn=drawn, name=name))
            with part_writer(store, part) as writer:
                for frame in range(frames)[: attacked if experiment.attacks else None]:
                    for case in experiment.cases(rig, SeededDraws(0, number, frame, 0), ()):
                        writer.add(measured(rig, frame, case, rng, seen))
                writer.commit(
                    frames=frames,
                    skipped=1,
                    last=True,
                    seconds=2.0,
                    versions={},
                    evaluated_at=datetime(2026, 1, 1, tzinfo=UTC),
                )
    judge_cases(store)
    return store


def measured(rig, frame, case, rng, seen):
    counts = []
    for triple in rig.measured_triples:
        raised = set(case.attacked) & set(triple) and rng.random() < seen
        E = int(rng.integers(300, 900) if raised else rng.integers(10, 200))
        counts.append(Counts(2000, E, 1000, E, 0))
    varied = case.attacked, case.attack, case.strength, case.size, case.visible_share
    statistics = drawn_statistics(rng, rig, case.attacked, seen=seen)
    return MeasuredCase(frame, frame * PERIOD_NS, 0, *varied, {}, counts, statistics, make_features(rig, frame))
