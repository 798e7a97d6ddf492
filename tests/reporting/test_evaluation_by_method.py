"""What the evaluation tables say of the robust method equals Python from the stored statistics, exactly."""

from collections import Counter
from decimal import Decimal

import numpy as np
import pytest

from auditor.identification.drive_level import for_drive
from auditor.identification.scores import thresholds_from
from auditor.lab.evaluation import judge_cases
from auditor.model.verdict import VerdictKind
from auditor.store.queries import run_query, run_sql
from tests.making.evaluation_cases import (
    RIG,
    case_of,
    columns_of,
    judged_alone,
    learnt,
    make_evaluation,
    part,
    system_of,
    write,
)
from tests.making.stores import new_store

R = Decimal("0.01")
BLOCK = 10
LARGE = ((0, 1, 2, 4), (0, 1, 2, 3, 4))
SMALL = tuple(tuple(triple) for triple in RIG.triples if triple.k == 4)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    store, cases = make_evaluation(tmp_path_factory.mktemp("evaluation"))
    judge_cases(store)
    return store, cases


@pytest.fixture(scope="module")
def told(made):
    """(left_out, system, experiment, case, verdict): the definition, spelled out."""
    _, cases = made
    everything = [(e, recording, case) for (e, recording), of_it in cases.items() for case in of_it]
    found, thresholds_by = [], {}
    for here in {(recording, case.frame // BLOCK) for _, recording, case in everything}:
        mine = [(e, case) for e, recording, case in everything if (recording, case.frame // BLOCK) == here]
        kept = {
            "nothing": lambda *_: True,
            "block": lambda recording, frame, here=here: (recording, frame // BLOCK) != here,
            "recording": lambda recording, _, here=here: recording != here[0],
        }
        for left_out, keeps in kept.items():
            for sensors in (*SMALL, *LARGE):
                system = system_of(sensors)
                learnt_from = left_out, sensors, here if left_out == "block" else here[0]
                if learnt_from not in thresholds_by:
                    thresholds_by[learnt_from] = learnt(cases, keeps, system, R, here[0])
                thresholds = thresholds_by[learnt_from]
                chosen = [(e, case) for e, case in mine if is_asked(e, case, sensors)]
                verdicts = judged_alone([case.statistics for _, case in chosen], system, thresholds)
                found += [(left_out, sensors, e, c, v) for (e, c), v in zip(chosen, verdicts, strict=True)]
    return found


def is_asked(experiment, case, system):
    if not set(case.attacked) <= set(system):
        return False
    if len(system) == 3:
        return experiment in ("clean", "combinations") or (experiment == "sensitivity" and system == (0, 1, 4))
    return experiment in ("clean", "further") or (
        experiment == "combinations" and len(case.attacked) <= len(system) - 3
    )


def raised(verdict):
    return verdict.kind not in (VerdictKind.CLEAN, VerdictKind.NOT_AUDITABLE)


def answer(made, name, **parameters):
    rows = run_query(made[0], name, {"r": "0.01", **parameters}).to_pylist()
    assert {row["method"] for row in rows} == {"paper", "robust"}
    return [row for row in rows if row["method"] == "robust"]


def test_detection_equals_python(made, told):
    expected = Counter()
    for left_out, system, experiment, case, verdict in told:
        if experiment == "combinations" and len(system) == 3:
            for attacked in (case.attacked, None):
                key = left_out, system, case.strength, attacked
                expected[*key, "cases"] += 1
                expected[*key, "detected"] += raised(verdict)
                expected[*key, "not_measured"] += verdict.kind is VerdictKind.NOT_AUDITABLE
    rows = answer(made, "evaluation_detection")
    assert len(rows) == 3 * len(SMALL) * 2 * 8
    for row in rows:
        attacked = None if row["attacked"] is None else tuple(row["attacked"])
        key = row["left_out"], (row["i"], row["j"], row["k"]), row["strength"], attacked
        for column in ("cases", "detected", "not_measured"):
            assert row[column] == expected[*key, column], (key, column)
        assert row["rate"] == row["detected"] / row["cases"]
    assert np.mean([row["rate"] for row in rows]) > 0.5


def test_identification_equals_python(made, told):
    expected = Counter()
    for left_out, system, experiment, case, verdict in told:
        if experiment == "combinations" and len(system) > 3:
            key = left_out, system, case.strength, case.attacked
            expected[*key, "cases"] += 1
            expected[*key, "named"] += verdict.kind is VerdictKind.ATTACKED and verdict.attacked == case.attacked
            expected[*key, "misnamed"] += not set(verdict.attacked) <= set(case.attacked)
    rows = [row for row in answer(made, "evaluation_identification") if row["attacked"] is not None]
    assert len(rows) == 3 * 2 * (4 + 5 + 10)
    for row in rows:
        key = row["left_out"], tuple(row["system"]), row["strength"], tuple(row["attacked"])
        assert (row["cases"], row["named"]) == (expected[*key, "cases"], expected[*key, "named"])
        assert row["identified"] == row["named"]
        assert row["misnamed"] == expected[*key, "misnamed"]
        assert row["misnaming_low"] <= row["misnaming_rate"] == row["misnamed"] / row["cases"] <= row["misnaming_high"]
    assert 0 < sum(row["named"] for row in rows) < sum(row["cases"] for row in rows)


def test_false_alarms_equal_python(made, told):
    expected = Counter()
    for left_out, system, experiment, _, verdict in told:
        if experiment == "clean":
            expected[left_out, system, "frames"] += 1
            expected[left_out, system, "raised"] += raised(verdict)
            expected[left_out, system, "identified"] += verdict.kind is VerdictKind.ATTACKED
            expected[left_out, system, "not_clean"] += verdict.kind is not VerdictKind.CLEAN
    rows = answer(made, "evaluation_false_alarms")
    assert len(rows) == 3 * 8
    for row in rows:
        for column in ("frames", "raised", "identified", "not_clean"):
            assert row[column] == expected[row["left_out"], tuple(row["system"]), column]
        assert row["not_clean_low"] <= row["not_clean_rate"] <= row["not_clean_high"]
        # The whole of one recording is one block.
        assert (row["samples"], row["drives"]) == (None, 2 if row["left_out"] == "nothing" else 1)
    assert 0 < sum(row["raised"] for row in rows) < sum(row["frames"] for row in rows)


def test_sensitivity_and_further_attacks_equal_python(made, told):
    expected = Counter()
    for left_out, system, experiment, case, verdict in told:
        key = experiment, left_out, system, case.attacked, case.size
        expected[*key, "cases"] += 1
        expected[*key, "detected"] += raised(verdict)
        expected[*key, "named"] += verdict.kind is VerdictKind.ATTACKED and verdict.attacked == case.attacked
    rows = answer(made, "evaluation_sensitivity")
    assert len(rows) == 3 * 4
    for row in rows:
        attacked = ({"lidar": 0, "source": 1, "reference": 4}[row["sensor"]],)
        key = "sensitivity", row["left_out"], (0, 1, 4), attacked, row["size"]
        assert (row["cases"], row["detected"]) == (expected[*key, "cases"], expected[*key, "detected"])
    rows = answer(made, "evaluation_further")
    assert len(rows) == 3 * 3 * 2
    for row in rows:
        key = "further", row["left_out"], tuple(row["system"]), tuple(row["attacked"]), row["size"]
        for column in ("cases", "detected", "named"):
            assert row[column] == expected[*key, column], (key, column)


def test_the_matrix_and_the_summary_agree_with_the_tables(made, told):
    expected = Counter(
        (left_out, system, case.strength, case.attacked, v.kind.value, v.attacked)
        for left_out, system, experiment, case, v in told
        if experiment in ("clean", "combinations") and len(system) > 3
    )
    names = ("left_out", "system", "strength", "attacked", "verdict", "identified")
    rows = answer(made, "evaluation_confusion")
    found = {tuple(tuple(x) if isinstance(x := row[n], list) else x for n in names): row["cases"] for row in rows}
    assert found == expected
    summary = {(row["left_out"], row["strength"]): row for row in answer(made, "evaluation_summary")}
    for row in answer(made, "evaluation_detection"):
        if row["attacked"] is None and (row["i"], row["j"]) in ((0, 1), (1, 2)):
            assert summary[row["left_out"], row["strength"]][f"scenario_{row['scenario']}"] == row["rate"]
    for row in answer(made, "evaluation_false_alarms"):
        if len(row["system"]) == len(RIG.sensors):
            of_it = [one for (left_out, _), one in summary.items() if left_out == row["left_out"]]
            assert {(one["clean_frames"], one["not_clean"]) for one in of_it} == {
                (row["frames"], row["not_clean_rate"])
            }
    rows = answer(made, "evaluation_identification")
    for (left_out, strength), one in summary.items():
        of_all = [
            row
            for row in rows
            if (row["left_out"], row["strength"], len(row["system"]), row["attacked"]) == (left_out, strength, 5, None)
        ]
        assert one["misnamed"] == sum(row["misnamed"] for row in of_all) / sum(row["cases"] for row in of_all)


def test_other_rates_and_blocks_were_not_judged(made):
    for parameters in ({"r": "0.02"}, {"block_frames": 5}):
        rows = run_query(made[0], "evaluation_false_alarms", parameters).to_pylist()
        robust = {row["left_out"] for row in rows if row["method"] == "robust"}
        assert robust == (set() if "r" in parameters else {"nothing", "recording"})


def test_judging_again_after_another_recording_replaces_what_was_said(tmp_path):
    store, rng = new_store(tmp_path), np.random.default_rng(1)
    store.write_rig(RIG)

    def add(recording):
        write(store, part(recording, "clean"), [case_of(rng, frame, ()) for frame in range(12)])
        judge_cases(store)
        sql = "SELECT left_out, count(*) AS n, max(drives) AS D FROM case_verdicts GROUP BY left_out ORDER BY left_out"
        return [tuple(row.values()) for row in run_sql(store, sql).to_pylist()]

    systems = len(SMALL) + len(LARGE)
    assert add("a") == [(left_out, 12 * systems, D) for left_out, D in (("block", 1), ("nothing", 1), ("recording", 0))]
    assert add("b") == [(left_out, 24 * systems, D) for left_out, D in (("block", 2), ("nothing", 2), ("recording", 1))]


def test_without_any_other_recording_the_thresholds_are_the_prior_and_its_own_frames(tmp_path):
    store, rng = new_store(tmp_path), np.random.default_rng(1)
    store.write_rig(RIG)
    cases = [case_of(rng, frame, (1,) if frame == 3 else ()) for frame in range(BLOCK)]
    write(store, part("a", "clean"), cases)
    judge_cases(store)
    sql = "SELECT * FROM case_verdicts WHERE len(system) = 5 ORDER BY left_out, frame"
    rows = run_sql(store, sql).to_pylist()
    system = system_of(RIG.sensors)
    prior = thresholds_from([], system.sensor_checks, system.judged_together, R)
    statistics = [case.statistics for case in cases]
    stamps = np.array([case.stamp_ns for case in cases], dtype=np.int64)
    own = for_drive(prior, system.sensor_checks, columns_of(statistics, system), stamps)
    expected = judged_alone(statistics, system, own)
    for left_out in ("block", "recording"):  # all ten frames are one block
        of_it = [row for row in rows if row["left_out"] == left_out]
        assert [(row["verdict"], tuple(row["identified"]), row["drives"]) for row in of_it] == [
            (verdict.kind.value, verdict.attacked, 0) for verdict in expected
        ]
