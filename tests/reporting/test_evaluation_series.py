"""What makes a series of frames in an evaluation: one recording by one rig, while its clock goes on."""

from dataclasses import fields, replace

import numpy as np
import pyarrow.parquet as pq
import pytest

from auditor.lab.evaluation import judge_cases
from auditor.model.checks import Check, rig_sensor_checks
from auditor.model.measurement import Counts
from auditor.model.verdict import FINDINGS
from auditor.reporting.evaluation.loading import load_evaluation
from auditor.store.evaluation_tables import CaseFeatures, EvaluationPart, MeasuredCase
from auditor.store.queries import list_queries, run_query, run_sql
from tests.making.drawn_statistics import drawn_statistics
from tests.making.evaluation_cases import write
from tests.making.stores import PERIOD_NS, make_features, make_rig, new_store, part_columns

RIG, OTHER = make_rig(3), make_rig(3, focal_px=705.0)
R = {"r": "0.1"}


def measured(rig, raised, frames=20):
    """Cases of which the frames `raised` have a high E of every triple."""
    for frame in range(frames):
        E = 500 if frame in raised else 10
        counts, statistics = [Counts(2000, E, 1000, E, 0)] * len(rig.triples), [0.1] * len(rig_sensor_checks(rig))
        yield MeasuredCase(
            frame, frame * PERIOD_NS, 0, (), None, None, None, None, {}, counts, statistics, make_features(rig, frame)
        )


def keep(store, rig, cases, experiment="clean"):
    store.write_rig(rig)
    write(store, EvaluationPart(**part_columns(rig, "a", experiment)), cases)


def of_all(store, name):
    """The rows of the paper's method by all sensors, in sample."""
    rows = run_query(store, name, R).to_pylist()
    return [r for r in rows if (r["method"], r["left_out"], len(r["system"])) == ("paper", "nothing", 4)]


def test_two_rigs_of_a_kind_on_one_recording_are_two_drives(tmp_path):
    store = new_store(tmp_path)
    keep(store, RIG, measured(RIG, (5, 6)))
    keep(store, OTHER, measured(OTHER, (8, 9)))
    [alarms], [incidents] = of_all(store, "evaluation_false_alarms"), of_all(store, "evaluation_incidents")
    assert (alarms["frames"], alarms["raised"]) == (40, 4)
    assert (incidents["frames"], incidents["incidents"]) == (40, 2)
    assert alarms["hours"] == incidents["hours"] == pytest.approx(40 * 0.1 / 3600)


def statistics_of(rig, frame, *, high=(), level=0.8):
    """Statistics of which those of light on S_1 are high in some frames."""
    quiet = drawn_statistics(np.random.default_rng(frame), rig, spread=0.5)
    checks = rig_sensor_checks(rig)
    raised = [frame in high and c.check is Check.ADDED_LIGHT and 1 in c.nameable for c in checks]
    return [level if high_here else value for high_here, value in zip(raised, quiet, strict=True)]


def case(rig, frame, experiment="clean", *, high=(), level=0.8, variant=None, **features):
    """A case of a camera S_1 that is attacked, or of a clean frame."""
    attacked = () if experiment == "clean" else (1,)
    counts, statistics = [None] * len(rig.triples), statistics_of(rig, frame, high=high, level=level)
    told = make_features(rig, frame, **features)
    return MeasuredCase(frame, frame * PERIOD_NS, 0, attacked, None, variant, None, None, {}, counts, statistics, told)


def verdicts(store, experiment):
    """What is said by all sensors in sample, by frame."""
    judge_cases(store)
    rows = run_sql(store, f"SELECT * FROM case_verdicts WHERE experiment = '{experiment}'").to_pylist()
    chosen = [row for row in rows if row["left_out"] == "nothing" and len(row["system"]) == 4]
    return {(row["rig_id"], row["frame"]): row for row in chosen}


def test_a_moment_around_a_frame_is_of_its_own_rig(tmp_path):
    """One frame that stands out is raised; it is no incident."""
    store = new_store(tmp_path)
    for rig in (RIG, OTHER):
        keep(store, rig, [case(rig, frame, high=(60,), level=0.45) for frame in range(120)])
    told = verdicts(store, "clean")
    for rig in (RIG, OTHER):
        assert told[rig.rig_id, 60]["verdict"] in FINDINGS
        assert told[rig.rig_id, 60]["window_kind"] is None


def test_an_interval_is_judged_with_all_of_its_frames_attacked_and_a_single_frame_alone(tmp_path):
    store, drive = new_store(tmp_path), range(40)
    keep(store, RIG, [case(RIG, frame) for frame in drive])
    keep(store, RIG, [case(RIG, f, "intervals", high=drive, variant="still") for f in range(10, 20)], "intervals")
    keep(store, RIG, [case(RIG, f, "further", high=drive, level=0.45) for f in (5, 25)], "further")
    window_kind = verdicts(store, "intervals")
    assert {row["verdict"] for row in window_kind.values()} == {"attacked"}
    assert {(row["window_kind"], tuple(row["window_named"])) for row in window_kind.values()} == {("attacked", (1,))}
    single = verdicts(store, "further")
    assert [(row["verdict"], row["identified"], row["window_kind"]) for row in single.values()] == [
        ("attacked", [1], None)
    ] * 2


def test_a_fault_and_a_sensor_that_stands_still_are_what_a_scan_calls_them(tmp_path):
    store, drive = new_store(tmp_path), range(40)
    keep(store, RIG, [case(RIG, frame) for frame in drive])
    late = [case(RIG, f, "intervals", high=drive, late=(1,), variant="moving") for f in range(10)]
    still = [case(RIG, f, "intervals", variant="still") for f in range(20, 30)]
    prints = [0, 77, 2, 3]
    still = [replace(c, features=replace(c.features, fingerprint=[x or 10 * c.frame for x in prints])) for c in still]
    keep(store, RIG, [*late, *still], "intervals")
    told = {frame: row for (_, frame), row in verdicts(store, "intervals").items()}
    causes = {frame: [(one["cause"], one["sensor"]) for one in row["causes"]] for frame, row in told.items()}
    assert {told[frame]["verdict"] for frame in (*range(1, 9), *range(21, 30))} == {"suspect"}
    assert causes[5] == [("late", 1)]
    assert causes[25] == [("frozen", 1), ("frozen", 2), ("frozen", 3)]
    assert [told[frame]["window_kind"] for frame in (5, 25)] == ["suspect", "suspect"]


def test_a_sensor_that_was_not_there_takes_no_part(tmp_path):
    store = new_store(tmp_path)
    keep(store, RIG, [case(RIG, frame, high=(7,), missing=(0, 2) if frame == 7 else ()) for frame in range(20)])
    assert verdicts(store, "clean")[RIG.rig_id, 7]["verdict"] == "unidentified"


def test_parts_that_an_earlier_version_finished_are_counted_and_not_judged(tmp_path):
    store = new_store(tmp_path)
    keep(store, RIG, [case(RIG, frame) for frame in range(20)])
    assert judge_cases(store) == 0
    store.write_rig(OTHER)
    old = EvaluationPart(**part_columns(OTHER, "b", "clean"), experiments_version=1)
    write(store, old, [case(OTHER, frame) for frame in range(20)])
    path = store.path("cases", old.evaluation_id)
    columns = pq.read_table(path)
    newer = {"statistics", *(field.name for field in fields(CaseFeatures))}
    pq.write_table(columns.select([name for name in columns.column_names if name not in newer]), path)
    assert judge_cases(store) == 1
    rows = run_sql(store, "SELECT DISTINCT recording_id FROM case_verdicts").to_pylist()
    assert rows == [{"recording_id": "a" * 64}]
    assert len(run_sql(store, "SELECT * FROM cases")) == 40


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


@pytest.mark.parametrize(("returns", "named"), [(10_000, True), (5_000, False)])
def test_a_lidar_of_half_the_points_is_judged_by_the_prior_as_in_a_scan(tmp_path, returns, named):
    store = new_store(tmp_path)
    store.write_rig(RIG)
    isolated = [check.check is Check.ISOLATED_POINTS for check in rig_sensor_checks(RIG)]

    def drive_of(share, points):
        for frame in range(20):
            one = case(RIG, frame)
            statistics = [share if here else value for here, value in zip(isolated, one.statistics, strict=True)]
            yield replace(one, statistics=statistics, features=replace(one.features, returns=points))

    for name, share, points in (("a", 0.0, 10_000), ("b", 0.0, 10_000), ("c", 0.0, 10_000), ("d", 0.3, returns)):
        write(store, EvaluationPart(**part_columns(RIG, name, "clean")), drive_of(share, points))
    judge_cases(store)
    sql = "SELECT * FROM case_verdicts WHERE left_out = 'recording' AND len(system) = 4 AND recording_id LIKE 'd%'"
    rows = run_sql(store, sql).to_pylist()
    assert ([0] in [row["identified"] for row in rows]) == named
