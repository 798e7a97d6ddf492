"""Incidents of an evaluation equal those that Python makes of the same cases, exactly."""

from collections import defaultdict
from dataclasses import replace
from decimal import Decimal
from math import exp, factorial

import numpy as np
import pytest

from auditor.lab.evaluation import judge_cases
from auditor.model.measurement import Statistic
from auditor.store.evaluation_tables import INTERVAL_FRAMES
from auditor.store.queries import run_query, run_sql
from tests.making.evaluation_cases import BLOCK as PAPER_BLOCK
from tests.making.evaluation_cases import (
    FRAMES,
    RIG,
    case_of,
    errors,
    folds,
    judged,
    judged_robustly,
    learnt,
    part,
    state,
    system_of,
    write,
)
from tests.making.stores import PERIOD_NS, new_store

R = Decimal("0.05")
ROBUST_R, ROBUST_BLOCK = Decimal("0.01"), 10
SYSTEM = system_of(RIG.sensors)
SETS = [((1,), "still"), ((1,), "moving"), ((1,), "lasting"), ((0, 4), "still")]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    store, rng = new_store(tmp_path_factory.mktemp("evaluation")), np.random.default_rng(3)
    store.write_rig(RIG)
    cases = defaultdict(list)
    for recording, frames in FRAMES.items():
        for frame in range(frames):
            drawn = [("clean", (), None), *(("intervals", attacked, variant) for attacked, variant in SETS)]
            for experiment, attacked, variant in drawn:
                late = frame % INTERVAL_FRAMES < 3 or rng.random() < 0.2  # not all frames of an interval show it
                shown = () if late else attacked
                case = replace(case_of(rng, frame, shown, None, variant), attacked=attacked, stamp_ns=frame * PERIOD_NS)
                cases[experiment, recording].append(case)
    for (experiment, recording), of_it in cases.items():
        write(store, part(recording, experiment), of_it)
    judge_cases(store)
    return store, cases


def lines(cases):
    """Clean drives, and intervals under one attack each, in order: (attacked, variant), recording, cases."""
    for recording in FRAMES:
        yield ((), None), recording, cases["clean", recording]
        intervals = defaultdict(list)
        for case in cases["intervals", recording]:
            number = 0 if case.strength == "lasting" else case.frame // INTERVAL_FRAMES
            intervals[case.attacked, case.strength, number].append(case)
        for (attacked, variant, _), of_it in intervals.items():
            yield (attacked, variant), recording, of_it


def by_paper(cases, left_out, recording, line, theta_of):
    """What is said of each frame, by the thresholds of every fold."""
    for case in line:
        theta, _ = theta_of[left_out, recording, case.frame // PAPER_BLOCK, R]
        pairs = zip(errors(case, Statistic.GATED), theta, strict=True)
        kind, found, _ = judged("".join(state(*pair) for pair in pairs))
        yield kind, found if kind == "attacked" else (), None


def by_robust(cases, left_out, recording, line):
    """The incidents that the frames belong to, in an otherwise clean drive."""
    drive = {case.frame: case for case in cases["clean", recording]} | {case.frame: case for case in line}
    statistics = [drive[frame].statistics for frame in sorted(drive)]
    judged_without = {}
    for case in line:
        block = case.frame // ROBUST_BLOCK
        if block not in judged_without:
            kept = {
                "nothing": lambda *_: True,
                "block": lambda r, f, block=block: (r, f // ROBUST_BLOCK) != (recording, block),
                "recording": lambda r, _: r != recording,
            }[left_out]
            thresholds = learnt(cases, kept, SYSTEM, ROBUST_R, recording)
            judged_without[block] = judged_robustly(statistics, SYSTEM, thresholds, [0] * len(statistics))
        verdict = judged_without[block][case.frame]
        found = verdict.finding
        yield (found.kind.value, found.attacked, found.event) if verdict.in_incident else ("clean", (), None)


@pytest.fixture(scope="module")
def told(made):
    """By method and what is left out: each line, and what is said of each of its frames."""
    _, cases = made
    theta_of = folds(cases, Statistic.GATED)
    found = defaultdict(list)
    for left_out in ("nothing", "block", "recording"):
        for what, recording, line in lines(cases):
            found["paper", left_out].append((what, line, list(by_paper(cases, left_out, recording, line, theta_of))))
            found["robust", left_out].append((what, line, list(by_robust(cases, left_out, recording, line))))
    return found


def incidents(line, told, gap_s):
    """(frames, first stamp, identified) of each event, or run of frames of which the same is said.

    Events end with the block that is judged at once.
    """
    stamps = defaultdict(list)
    for case, (kind, identified, event) in zip(line, told, strict=True):
        if kind in ("attacked", "unidentified", "suspect"):
            stamps[kind, identified].append((case.stamp_ns, event and (event, case.frame // ROBUST_BLOCK)))
    for (_, identified), of_it in stamps.items():
        starts = [n for n in range(len(of_it)) if n == 0 or not goes_on(of_it[n - 1], of_it[n], gap_s)]
        for first, end in zip(starts, [*starts[1:], len(of_it)], strict=True):
            yield end - first, of_it[first][0], identified


def goes_on(before, one, gap_s):
    (earlier, event), (later, same) = before, one
    return later - earlier <= gap_s * 1e9 or (event is not None and event == same)


@pytest.mark.parametrize("gap_s", [0.15, 0.5])
@pytest.mark.parametrize(("method", "r", "block"), [("paper", R, PAPER_BLOCK), ("robust", ROBUST_R, ROBUST_BLOCK)])
def test_incidents_their_names_and_delays_equal_python(made, told, method, r, block, gap_s):
    expected = defaultdict(lambda: defaultdict(list))
    for left_out in ("nothing", "block", "recording"):
        for what, line, said in told[method, left_out]:
            found = sorted(incidents(line, said, gap_s), key=lambda i: i[1])
            longest = max(found, key=lambda i: i[0], default=(0, 0, None))[2]
            tally = expected[left_out, *what]
            tally["frames"].append(len(line))
            tally["incidents"].append(len(found))
            tally["found"].append(bool(found))
            tally["named"].append(longest == what[0])
            tally["delay_s"] += [(found[0][1] - line[0].stamp_ns) / 1e9] if found else []
    parameters = {"r": str(r), "block_frames": block, "gap_s": gap_s}
    rows = [
        row for row in run_query(made[0], "evaluation_incidents", parameters).to_pylist() if row["method"] == method
    ]
    assert {(row["left_out"], tuple(row["attacked"]), row["variant"]) for row in rows} == expected.keys()
    for row in rows:
        tally = expected[row["left_out"], tuple(row["attacked"]), row["variant"]]
        assert (row["frames"], row["incidents"]) == (sum(tally["frames"]), sum(tally["incidents"]))
        if row["attacked"]:
            assert row["intervals"] == len(tally["found"]) == (2 if row["variant"] == "lasting" else 3)
            assert (row["found"], row["named"]) == (sum(tally["found"]), sum(tally["named"]))
            assert row["delay_s"] == (np.median(tally["delay_s"]) if tally["delay_s"] else None)
            assert row["hours"] is None
        else:
            hours = sum(FRAMES.values()) * 0.1 / 3600
            assert row["hours"] == pytest.approx(hours)
            assert row["incidents_an_hour"] == pytest.approx(row["incidents"] / hours)
            assert row["at_most_an_hour"] > row["incidents_an_hour"]
            assert row["found"] is None
    assert sum(row["found"] or 0 for row in rows) > 0
    assert any(row["longest_delay_s"] for row in rows)


@pytest.mark.parametrize("k", [0, 1, 7, 120])
def test_the_upper_bound_leaves_five_per_cent_below(made, k):
    [row] = run_sql(made[0], f"SELECT poisson_at_most({k}) AS mean, count(*) FROM evaluations").to_pylist()
    assert sum(exp(-row["mean"]) * row["mean"] ** n / factorial(n) for n in range(k + 1)) == pytest.approx(0.05)
