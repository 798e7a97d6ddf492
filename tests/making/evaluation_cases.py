"""Evaluations with drawn counts, and the tables that the queries must give of them, spelled out in Python."""

from collections import defaultdict
from dataclasses import replace
from datetime import UTC, datetime
from decimal import Decimal
from itertools import combinations

import numpy as np

from auditor.identification.drive_level import for_drive
from auditor.identification.incidents.series import FrameSeries
from auditor.identification.paper import disagreements, identify
from auditor.identification.robust import judge_frames
from auditor.identification.scores import thresholds_from
from auditor.identification.systems import System
from auditor.identification.thresholds import threshold
from auditor.model.calibration import CleanFrames
from auditor.model.checks import rig_sensor_checks
from auditor.model.measurement import Counts
from auditor.store.evaluation_tables import EvaluationPart, MeasuredCase, part_writer
from tests.making.drawn_statistics import drawn_statistics
from tests.making.stores import PERIOD_NS, make_features, make_rig, new_store, part_columns

RATES = [Decimal(text) for text in ("0", "0.02", "0.05", "0.3", "1")]
BLOCK = 5
RIG = make_rig(4)
CHECKS = rig_sensor_checks(RIG)
FRAMES = {"a": 11, "b": 3}
SEEN, SPREAD = 0.4, 2.0
"""Some attacks are missed, and some clean frames raised."""


def part(recording, experiment, chunk=0, *, synthetic=False):
    return EvaluationPart(**part_columns(RIG, recording, experiment, chunk=chunk, synthetic=synthetic))


def write(store, which, cases, *, last=True):
    with part_writer(store, which) as writer:
        for case in cases:
            writer.add(case)
        writer.commit(
            frames=1, skipped=0, last=last, seconds=1.0, versions={}, evaluated_at=datetime(2026, 1, 1, tzinfo=UTC)
        )


def drawn_counts(rng, attacked, unmeasured):
    """Counts whose E mostly rises where a sensor of the triple is attacked; ties and gaps among them."""
    counts = []
    for triple in RIG.measured_triples:
        level = rng.integers(0, 60) + (rng.integers(20, 200) if set(attacked) & set(triple) else 0)
        valid = 100 if rng.random() < unmeasured else 1000
        counts.append(Counts(2 * valid, int(level), valid, int(level), 0) if rng.random() > unmeasured / 3 else None)
    return counts


def attacked_sets():
    triples = [t for t in RIG.triples if t.k == 4]
    sets = {s for t in triples for size in (1, 2, 3) for s in combinations(t, size)}
    return sorted(sets | set(combinations(RIG.sensors, 2)))


APART_NS = 6 * 10**9
"""Between two frames: so far apart that each is judged as if it were alone."""


def make_evaluation(folder):
    """A store of two recordings, and all of its cases by experiment and recording."""
    store = new_store(folder)
    store.write_rig(RIG)
    rng = np.random.default_rng(8)
    cases = defaultdict(list)
    for recording, frames in FRAMES.items():
        for frame in range(frames):

            def case(attacked, strength=None, size=None, *, at=frame):
                counts = drawn_counts(rng, attacked, 0.02)
                statistics = drawn_statistics(rng, RIG, attacked, seen=SEEN, unmeasured=0.02, spread=SPREAD)
                features = make_features(RIG, at)
                return MeasuredCase(
                    at, at * APART_NS, 0, attacked, None, strength, size, None, {}, counts, statistics, features
                )

            cases["clean", recording].append(case(()))
            for strength in ("mild", "opaque"):
                cases["combinations", recording] += [case(attacked, strength) for attacked in attacked_sets()]
            further = [replace(case((s,), "dark", 40.0), attack="stripes") for s in (1, 4)]
            cases["further", recording] += [*further, replace(case((0,), size=10.0), attack="hidden sector")]
            cases["sensitivity", recording] += [case((0,), None, width) for width in (0.5, 2.5)]
            cases["sensitivity", recording] += [case((s,), "mild", 75.0) for s in (1, 4)]
    for (experiment, recording), of_it in cases.items():
        half = len(of_it) // 2
        write(store, part(recording, experiment, 0), of_it[:half], last=False)
        write(store, part(recording, experiment, 1), of_it[half:])
    return store, cases


def folds(cases, statistic):
    """theta and N by (left_out, recording, block, r): the definition, spelled out."""
    clean = [(recording, case) for recording in FRAMES for case in cases["clean", recording]]
    blocks = {(recording, case.frame // BLOCK) for recording, case in clean}
    kept = {
        "nothing": lambda other, here: True,
        "block": lambda other, here: other != here,
        "recording": lambda other, here: other[0] != here[0],
    }
    found = {}
    for here in blocks:
        for left_out, keeps in kept.items():
            samples = [[] for _ in RIG.triples]
            for recording, case in clean:
                if keeps((recording, case.frame // BLOCK), here):
                    for of_triple, E in zip(samples, errors(case, statistic), strict=True):
                        if E is not None:
                            of_triple.append(E)
            for of_triple in samples:
                of_triple.sort()
            for r in RATES:
                theta = [threshold(of_triple, r) for of_triple in samples]
                found[left_out, *here, r] = theta, [len(of_triple) for of_triple in samples]
    return found


def errors(case, statistic):
    """By triple of e: the fallback, which is the last count, belongs to no query of the paper's figures."""
    return [c and c.disparity_error(statistic) for c in case.counts[: len(RIG.triples)]]


def state(E, theta):
    return "-" if E is None else "1" if theta < E else "0"


def judged(e):
    """The verdict by the paper, the named sensors, and whether any triple exceeds its threshold."""
    sensors = {s for t, x in zip(RIG.triples, e, strict=True) if x != "-" for s in t}
    if not sensors:
        return "not_auditable", None, False
    found = identify(e, RIG.triples, sensors)
    named = None if found.undetermined else found.attacked
    if "1" not in e:
        return "clean", named, False
    nameable = named and len(sensors) >= 4 and len(named) <= len(sensors) - 3
    if nameable and disagreements(e, named, RIG.triples) == 0:
        return "attacked", named, True
    return "unidentified", named, True


def learnt(cases, keeps, system, r, drive):
    """The robust method's thresholds from the clean cases that are kept, each recording taken for a drive.

    They are those for that `drive`, whose clean cases show what is usual there.
    """
    clean = []
    for recording in FRAMES:
        kept = [case for case in cases["clean", recording] if keeps(recording, case.frame)]
        columns = np.array([case.statistics for case in kept], dtype=np.float64).T
        statistics = dict(zip(CHECKS, columns, strict=False))
        stamps = np.array([case.stamp_ns for case in kept], dtype=np.int64)
        clean += [CleanFrames(recording, stamps, {}, statistics, {})] if kept else []
    thresholds = thresholds_from(clean, system.sensor_checks, system.judged_together, r)
    own = columns_of([case.statistics for case in cases["clean", drive]], system)
    stamps = np.array([case.stamp_ns for case in cases["clean", drive]], dtype=np.int64)
    return for_drive(thresholds, system.sensor_checks, own, stamps)


def columns_of(statistics, system):
    """(F, M) of statistics by all checks those that a system has."""
    inside = [place for place, check in enumerate(CHECKS) if check in system.sensor_checks]
    return np.array(statistics, dtype=np.float64)[:, inside]


def system_of(sensors):
    """What some of the rig's sensors are judged by."""
    checks = tuple(check for check in CHECKS if set(check.needed) <= set(sensors))
    triples = tuple(t for t in RIG.triples if set(t) <= set(sensors))
    return System(checks, triples, tuple(sensors), RIG.fallback if set(RIG.fallback) <= set(sensors) else None)


def judged_robustly(statistics, system, thresholds, runs):
    """The verdicts by all its checks, where every sensor was there and no fault is known; `runs` follow each other."""
    values = columns_of(statistics, system)
    nowhere = np.zeros((len(values), len(system.sensors)), dtype=np.bool_)
    numbers = np.array(runs, dtype=np.int64)
    stamps = np.arange(len(values), dtype=np.int64) * PERIOD_NS + numbers * 60 * 10**9  # none is nearby another run's
    series = FrameSeries(stamps, numbers, values, ~nowhere, nowhere)
    return judge_frames(series, system, thresholds, without_causes=True)


def judged_alone(statistics, system, thresholds):
    """The verdicts on frames, each by itself."""
    return judged_robustly(statistics, system, thresholds, range(len(statistics)))


def case_of(rng, frame, attacked, attack=None, strength=None):
    counts, features = drawn_counts(rng, attacked, 0), make_features(RIG, frame)
    statistics = drawn_statistics(rng, RIG, attacked, seen=SEEN, spread=SPREAD)
    return MeasuredCase(frame, frame, 0, attacked, attack, strength, None, None, {}, counts, statistics, features)
