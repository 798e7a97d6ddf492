"""What makes a series of frames in an evaluation: one recording by one rig, while its clock goes on."""

from dataclasses import replace

import numpy as np
import pytest

from auditor.evaluation import judge_cases
from auditor.evaluation.verdicts import Case, judged
from auditor.model.checks import rig_pair_checks
from auditor.model.measurement import Counts
from auditor.model.verdict import FINDINGS
from auditor.reporting.evaluation.loading import load_evaluation
from auditor.store.evaluation_tables import EvaluationPart, MeasuredCase
from auditor.store.queries import list_queries, run_query
from tests.making.stores import PERIOD_NS, make_rig, new_store, part_columns
from tests.store.test_evaluation_queries import write

RIG, OTHER = make_rig(3), make_rig(3, focal_px=705.0)
R = {"r": "0.1"}


def measured(rig, raised, frames=20):
    """Cases of which the frames `raised` have a high E of every triple."""
    for frame in range(frames):
        E = 500 if frame in raised else 10
        counts, ratios = [Counts(2000, E, 1000, E, 0)] * len(rig.triples), [0.1] * len(rig_pair_checks(rig))
        yield MeasuredCase(frame, frame * PERIOD_NS, 0, (), None, None, None, None, {}, counts, ratios)


def keep(store, rig, cases, experiment="clean"):
    store.write_rig(rig)
    write(store, EvaluationPart(**part_columns(rig, "a", experiment)), cases)


def of_all(store, name):
    """The rows of the paper's method by all sensors, in sample."""
    rows = run_query(store, name, R).to_pylist()
    return [r for r in rows if (r["method"], r["held_out"], len(r["system"])) == ("paper", "nothing", 4)]


def test_two_rigs_of_a_kind_on_one_recording_are_two_drives(tmp_path):
    store = new_store(tmp_path)
    keep(store, RIG, measured(RIG, (5, 6)))
    keep(store, OTHER, measured(OTHER, (8, 9)))
    [alarms], [incidents] = of_all(store, "evaluation_false_alarms"), of_all(store, "evaluation_incidents")
    assert (alarms["frames"], alarms["raised"]) == (40, 4)
    assert (incidents["frames"], incidents["incidents"]) == (40, 2)
    assert alarms["hours"] == incidents["hours"] == pytest.approx(40 * 0.1 / 3600)


def test_a_moment_around_a_frame_is_of_its_own_rig():
    """One frame that stands out is raised; the half second around it says otherwise, whoever else looked."""
    pair_checks, rng = rig_pair_checks(RIG), np.random.default_rng(1)
    cases = []
    for rig_id in ("one", "other"):
        for frame in range(120):
            ratios = rng.uniform(0, 0.2, len(pair_checks))
            if frame == 60:
                ratios[[e.check == "unlike" and 1 in e.needed for e in pair_checks]] = 0.45
            at = frame, frame * PERIOD_NS, 0
            cases.append(Case(f"part of {rig_id}", "a" * 64, rig_id, "clean", *at, (), None, None, None, tuple(ratios)))
    told = [v for _, v in judged(cases, RIG) if (v.held_out, v.system) == ("nothing", RIG.sensors)]
    assert [v.frame for v in told if v.verdict in FINDINGS and v.frame == 60] == [60, 60]
    assert [v.lasting for v in told if v.frame == 60] == [None, None]


def test_an_incident_ends_where_the_clock_was_set_back_and_a_delay_over_that_is_not_known(tmp_path):
    def set_back(cases):
        return [replace(c, stamp_ns=c.stamp_ns - (2 * PERIOD_NS if c.frame >= 10 else 0)) for c in cases]

    store = new_store(tmp_path)
    keep(store, RIG, set_back(measured(RIG, (9, 12))))  # stamps 0.9 s and 1.0 s
    shifted = [replace(c, frame=c.frame + 5) for c in set_back(measured(RIG, (12,)))][:15]
    attacked = [replace(c, attacked=(1,), strength="still") for c in shifted if c.frame >= 10]
    keep(store, RIG, attacked, "intervals")
    clean, attack = of_all(store, "evaluation_incidents")
    assert (clean["frames"], clean["incidents"]) == (20, 2)
    assert clean["hours"] == pytest.approx(20 * 0.1 / 3600)
    assert (attack["intervals"], attack["found"], attack["delay_s"]) == (1, 1, None)


def test_where_no_time_between_frames_is_known_there_are_no_hours_to_divide_by(tmp_path):
    store = new_store(tmp_path)
    keep(store, RIG, [replace(case, stamp_ns=0) for case in measured(RIG, (), 2)])
    for one in list_queries():
        if one.name.startswith("evaluation_"):
            rows = run_query(store, one.name).to_pylist()
            wrong = [(n, x) for row in rows for n, x in row.items() if isinstance(x, float) and not np.isfinite(x)]
            assert wrong == [], one.name
    [row] = of_all(store, "evaluation_false_alarms")
    assert (row["frames"], row["hours"], row["raised_an_hour"]) == (2, None, None)


def test_rigs_without_triples_and_recordings_without_frames_end_no_page(tmp_path):
    store, alone = new_store(tmp_path), make_rig(2, lidar=False)
    keep(store, RIG, ())
    keep(store, alone, measured(alone, ()))
    judge_cases(store)
    assert len(load_evaluation(store).setups) == 2
