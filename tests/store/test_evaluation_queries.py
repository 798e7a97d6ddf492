"""The SQL tables of an evaluation equal the same tables computed in Python from the stored counts, exactly."""

from collections import Counter, defaultdict
from dataclasses import replace
from decimal import Decimal

import numpy as np
import pytest

from auditor.identification.thresholds import resolvable
from auditor.lab.evaluation.verdicts import judge_cases
from auditor.model.measurement import Statistic
from auditor.model.rig import Triple
from auditor.store.evaluation_tables import finished_part, part_writer
from auditor.store.queries import run_query, run_sql
from tests.making.evaluation_cases import (
    APART_NS,
    BLOCK,
    FRAMES,
    RATES,
    RIG,
    case_of,
    errors,
    folds,
    judged,
    make_evaluation,
    part,
    state,
    write,
)
from tests.making.stores import new_store

R = ",".join(map(str, RATES))


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return make_evaluation(tmp_path_factory.mktemp("evaluation"))


def answer(made, name, **parameters):
    return run_query(made[0], name, {"block_frames": BLOCK, **parameters}).to_pylist()


@pytest.mark.parametrize("statistic", list(Statistic))
def test_detection_by_combination_equals_python(made, statistic):
    theta_of = folds(made[1], statistic)
    expected = Counter()
    smallest = {}
    for (left_out, recording, block, r), (theta, N) in theta_of.items():
        for case in made[1]["combinations", recording]:
            for at, triple in enumerate(RIG.triples):
                if case.frame // BLOCK == block and triple.k == 4 and set(case.attacked) <= set(triple):
                    found = state(errors(case, statistic)[at], theta[at])
                    for attacked in (case.attacked, None):
                        key = left_out, triple, case.strength, attacked, r
                        expected[key, "cases"] += 1
                        expected[key, "not_measured"] += found == "-"
                        expected[key, "detected"] += found == "1"
                        smallest[key] = min(smallest.get(key, N[at]), N[at])
    rows = answer(made, "evaluation_detection", r=R, statistic=statistic.value)
    assert len(rows) == len(smallest)
    for row in rows:
        triple = Triple(row["i"], row["j"], row["k"])
        attacked = None if row["attacked"] is None else tuple(row["attacked"])
        key = row["left_out"], triple, row["strength"], attacked, Decimal(str(row["r"])).normalize() + 0
        for column in ("cases", "not_measured", "detected"):
            assert row[column] == expected[key, column], (key, column)
        assert row["rate"] == expected[key, "detected"] / expected[key, "cases"]
        assert row["low"] <= row["rate"] <= row["high"]
        assert row["samples"] == smallest[key]
        assert row["resolvable"] == resolvable(key[-1], smallest[key])
        assert row["scenario"] == (1 if triple.i == 0 else 2)


def verdicts(made, statistic):
    """(left_out, system, strength, attacked, r) -> counts of (verdict, named or None, raised)."""
    found = defaultdict(Counter)
    for (left_out, recording, block, r), (theta, _) in folds(made[1], statistic).items():
        for case in made[1]["clean", recording] + made[1]["combinations", recording]:
            if case.frame // BLOCK != block:
                continue
            for system in ((0, 1, 2, 3, 4), (0, 1, 2, 4)):
                if set(case.attacked) <= set(system) and len(case.attacked) <= len(system) - 3:
                    E = errors(case, statistic)
                    states = zip(RIG.triples, E, theta, strict=True)
                    e = "".join(state(E_t, th) if set(t) <= set(system) else "-" for t, E_t, th in states)
                    found[left_out, system, case.strength, case.attacked, r][judged(e)] += 1
    return found


def test_identification_equals_python(made):
    rows = answer(made, "evaluation_identification", r=R)
    expected = verdicts(made, Statistic.GATED)
    assert {(len(row["system"]), row["attacked_sensors"]) for row in rows} == {(4, 1), (5, 1), (5, 2)}
    averages = defaultdict(Counter)
    for row in rows:
        if row["attacked"] is None:
            continue
        attacked = tuple(row["attacked"])
        r = Decimal(str(row["r"])).normalize() + 0
        counts = expected[row["left_out"], tuple(row["system"]), row["strength"], attacked, r]
        named = sum(n for (_, name, raised), n in counts.items() if raised and name == attacked)
        identified = sum(n for (kind, name, _), n in counts.items() if kind == "attacked" and name == attacked)
        assert (row["cases"], row["named"], row["identified"]) == (counts.total(), named, identified)
        assert row["rate"] == named / counts.total()
        average = averages[row["left_out"], tuple(row["system"]), row["strength"], len(attacked), row["r"]]
        average.update(cases=row["cases"], named=row["named"], identified=row["identified"])
    for row in rows:
        if row["attacked"] is None:
            key = row["left_out"], tuple(row["system"]), row["strength"], row["attacked_sensors"], row["r"]
            assert averages[key] == {name: row[name] for name in averages[key]}


def test_the_matrix_of_truth_against_verdict_equals_python(made):
    expected = Counter()
    for (left_out, system, strength, attacked, r), counts in verdicts(made, Statistic.GATED).items():
        for (kind, named, _), n in counts.items():
            if r == Decimal("0.05"):
                expected[left_out, system, strength, attacked, kind, named if kind == "attacked" else ()] += n
    rows = answer(made, "evaluation_confusion", r="0.05")
    names = ("left_out", "system", "strength", "attacked", "verdict", "identified")
    found = {tuple(tuple(x) if isinstance(x := row[n], list) else x for n in names): row["cases"] for row in rows}
    assert found == expected


def test_false_alarms_equal_python(made):
    expected = Counter()
    theta_of = folds(made[1], Statistic.GATED)
    for (left_out, system, _, attacked, r), counts in verdicts(made, Statistic.GATED).items():
        if not attacked:
            for (kind, _, raised), n in counts.items():
                expected[left_out, system, r, "frames"] += n
                expected[left_out, system, r, "raised"] += n * raised
                expected[left_out, system, r, "identified"] += n * (kind == "attacked")
    for (left_out, recording, block, r), (theta, _) in theta_of.items():
        for case in made[1]["clean", recording]:
            for at, triple in enumerate(RIG.triples):
                if case.frame // BLOCK == block and triple.k == 4:
                    key = left_out, tuple(triple), r
                    expected[*key, "frames"] += 1
                    expected[*key, "raised"] += state(errors(case, Statistic.GATED)[at], theta[at]) == "1"
    rows = answer(made, "evaluation_false_alarms", r=R)
    an_hour, frames = 3600 * 10**9 / APART_NS, sum(FRAMES.values())
    assert len(rows) == 3 * len(RATES) * 8
    for row in rows:
        key = row["left_out"], tuple(row["system"]), Decimal(str(row["r"])).normalize() + 0
        for column in ("frames", "raised", "identified"):
            assert row[column] == expected[*key, column], (key, column)
        assert row["hours"] == pytest.approx(frames / an_hour)
        assert row["raised_an_hour"] == pytest.approx(row["raised"] / frames * an_hour)
        assert row["low_an_hour"] == pytest.approx(row["low"] * an_hour)
        assert row["high_an_hour"] == pytest.approx(row["high"] * an_hour)


def test_sensitivity_equals_python(made):
    at = RIG.triples.index(Triple(0, 1, 4))
    expected = Counter()
    for (left_out, recording, block, r), (theta, _) in folds(made[1], Statistic.GATED).items():
        for case in made[1]["sensitivity", recording]:
            if case.frame // BLOCK == block:
                role = {0: "lidar", 1: "source", 4: "reference"}[case.attacked[0]]
                key = left_out, role, case.size, r
                expected[key] += state(errors(case, Statistic.GATED)[at], theta[at]) == "1"
                expected[key, "cases"] += 1
    rows = answer(made, "evaluation_sensitivity", r=R)
    assert len(rows) == 3 * 4 * len(RATES)
    for row in rows:
        key = row["left_out"], row["sensor"], row["size"], Decimal(str(row["r"])).normalize() + 0
        assert (row["detected"], row["cases"]) == (expected[key], expected[key, "cases"])
    facula = next(row for row in rows if row["sensor"] == "source")
    assert facula["nominal_share"] == pytest.approx(0.0379, abs=5e-5)


def test_distributions_equal_python(made):
    rows = run_query(made[0], "evaluation_distribution", {"bins": 8}).to_pylist()
    clean = [row for row in rows if not row["attacked"]]
    assert [(row["i"], row["j"]) for row in clean] == [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
    for row in clean:
        at = RIG.triples.index(Triple(row["i"], row["j"], row["k"]))
        E = [errors(case, Statistic.GATED)[at] for recording in FRAMES for case in made[1]["clean", recording]]
        measured = sorted(x for x in E if x is not None)
        assert (row["cases"], row["not_measured"]) == (len(E), len(E) - len(measured))
        assert (row["smallest"], row["largest"]) == (measured[0], measured[-1])
        assert row["histogram"] == np.histogram(measured, bins=8, range=(0, 1))[0].tolist()
        assert row["median"] == measured[-(-len(measured) // 2) - 1]


def test_attacks_beyond_the_papers_equal_python(made):
    expected = Counter()
    for (left_out, recording, block, r), (theta, _) in folds(made[1], Statistic.GATED).items():
        for case in made[1]["further", recording]:
            if case.frame // BLOCK == block and r == Decimal("0.05"):
                states = zip(errors(case, Statistic.GATED), theta, strict=True)
                _, named, raised = judged("".join(state(*pair) for pair in states))
                key = left_out, case.attack, case.strength, case.size, case.attacked
                expected[*key, "cases"] += 1
                expected[*key, "detected"] += raised
                expected[*key, "named"] += raised and named == case.attacked
    rows = [row for row in answer(made, "evaluation_further", r="0.05") if len(row["system"]) == 5]
    assert len(rows) == 3 * 3
    for row in rows:
        key = row["left_out"], row["attack"], row["variant"], row["size"], tuple(row["attacked"])
        for column in ("cases", "detected", "named"):
            assert row[column] == expected[*key, column], (key, column)


def test_the_summary_agrees_with_the_tables(made):
    summary = {(row["left_out"], row["strength"], row["r"]): row for row in answer(made, "evaluation_summary", r=R)}
    for row in answer(made, "evaluation_detection", r=R):
        if row["attacked"] is None and (row["i"], row["j"]) in ((0, 1), (1, 2)):
            short = summary[row["left_out"], row["strength"], row["r"]]
            assert short[f"scenario_{row['scenario']}"] == row["rate"]
    for row in answer(made, "evaluation_identification", r=R):
        if row["attacked"] is None:
            short = summary[row["left_out"], row["strength"], row["r"]]
            name = {(4, 1): "one_of_3", (5, 1): "one_of_all", (5, 2): "two_of_all"}
            assert short[name[len(row["system"]), row["attacked_sensors"]]] == row["rate"]


def test_the_summary_can_be_of_one_way_of_leaving_out_alone(made):
    everything = answer(made, "evaluation_summary", r=R)
    for left_out, shown in (("block", "block"), ("recording", "recording"), ("family", "recording")):
        chosen = answer(made, "evaluation_summary", r=R, left_out=left_out)
        assert chosen == [row for row in everything if row["left_out"] == shown] != []


def test_the_cost_of_a_case_stands_beside_that_of_a_clean_frame(made):
    rows = {row["experiment"]: row for row in run_query(made[0], "evaluation_cost").to_pylist()}
    cases = {name: sum(len(made[1][name, recording]) for recording in FRAMES) for name in rows}
    assert rows.keys() == {"clean", "combinations", "further", "sensitivity"}
    for name, row in rows.items():
        assert (row["cases"], row["seconds"], row["cases_a_second"]) == (cases[name], 4.0, cases[name] / 4)
        assert row["ratio"] == pytest.approx(cases["clean"] / cases[name])


def test_one_recording_alone_is_never_held_out_as_a_whole(tmp_path):
    store = new_store(tmp_path)
    store.write_rig(RIG)
    rng = np.random.default_rng(1)
    clean = [case_of(rng, f, ()) for f in range(12)]
    hit = [case_of(rng, f, (1,), "facula", "mild") for f in range(12)]
    write(store, part("a", "clean"), clean)
    write(store, part("a", "combinations"), hit)
    rows = run_query(store, "evaluation_detection", {"r": "0"}).to_pylist()
    assert {row["left_out"] for row in rows} == {"nothing", "block"}


def test_a_family_is_left_out_with_all_its_recordings(tmp_path):
    store, frames = new_store(tmp_path), {"a": 17, "b": 9, "c": 5}
    store.write_rig(RIG)
    rng = np.random.default_rng(8)
    for recording, family in (("a", "city, wet"), ("b", "city, wet"), ("c", None)):
        whole = replace(part(recording, "clean", synthetic=True), family=family)
        write(store, whole, [case_of(rng, frame, ()) for frame in range(frames[recording])])
    rows = run_query(store, "evaluation_false_alarms", {"r": "0.05"}).to_pylist()
    learnt = {row["left_out"]: (row["samples"], row["drives"]) for row in rows if row["method"] == "paper"}
    assert learnt == {"nothing": (31, 3), "block": (21, 2), "recording": (14, 2), "family": (5, 1)}
    judge_cases(store)
    table = run_sql(store, "SELECT DISTINCT left_out, recording_id, drives FROM case_verdicts").to_pylist()
    robust = {(row["left_out"], row["recording_id"][0]): row["drives"] for row in table if row["left_out"] != "block"}
    assert {key: n for key, n in robust.items() if key[0] == "family"} == {
        ("family", "a"): 1, ("family", "b"): 1, ("family", "c"): 2,
    }  # fmt: skip


def test_real_and_synthetic_drives_are_not_pooled(tmp_path):
    store = new_store(tmp_path)
    store.write_rig(RIG)
    rng = np.random.default_rng(1)
    for recording, synthetic in (("a", False), ("b", True)):
        clean = [case_of(rng, f, ()) for f in range(12)]
        write(store, part(recording, "clean", synthetic=synthetic), clean)
    rows = run_query(store, "evaluation_false_alarms", {"r": "0"}).to_pylist()
    assert len({row["setup"] for row in rows}) == 2
    assert {row["frames"] for row in rows} == {12}


def test_a_part_is_finished_only_once_its_row_is_there(tmp_path):
    store = new_store(tmp_path)
    store.write_rig(RIG)
    which = part("a", "clean")
    with part_writer(store, which) as writer:
        writer.add(case_of(np.random.default_rng(1), 0, ()))
    assert finished_part(store, which) is None
    write(store, which, [], last=False)
    assert finished_part(store, which) is False
    write(store, which, [])
    assert finished_part(store, which) is True
