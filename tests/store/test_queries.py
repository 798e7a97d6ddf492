import re
from decimal import Decimal

import pytest

from auditor.errors import QueryError
from auditor.identification.prior import log_odds, statistic_at
from auditor.model.calibration import NullDistribution, RobustThresholds
from auditor.model.checks import LIDAR_CHECKS, rig_sensor_checks
from auditor.model.measurement import Statistic
from auditor.model.verdict import (
    Alternative,
    AttackLabel,
    Cause,
    Evidence,
    FaultHypothesis,
    Finding,
    Verdict,
    VerdictKind,
)
from auditor.store.calibrations import make_calibration
from auditor.store.connection import shut_connection
from auditor.store.queries import describe, list_queries, list_views, query, run_query, run_sql
from auditor.store.records import JudgementRecord
from auditor.store.sql_files import bind
from tests.making.calibrations import clean_frames
from tests.making.stores import (
    NOON,
    PERIOD_NS,
    PROCEDURE,
    RULES,
    add_judgement,
    add_measurement,
    make_measurement,
    make_rig,
    new_store,
    skip,
)
from tests.store.store_page import PAGE, written_anew

RIG = make_rig(3)


@pytest.fixture
def store(tmp_path):
    return new_store(tmp_path)


def judged(store, kinds, *, skipped=(), scores=None, stamps=None, recording="a", **settings):
    """A recording with one frame a character of `kinds`; a blank is a frame that was skipped."""
    frames = [
        skip(f) if kind == " " else make_measurement(RIG, f, stamp_ns=stamps[f] if stamps else None)
        for f, kind in enumerate(kinds)
    ]
    measurement_id = add_measurement(store, RIG, [*frames, *skipped], recording=recording, **settings)
    add_judgement(store, RIG, measurement_id, kinds, scores=scores, stamps=stamps)
    return measurement_id


def incidents(store, **parameters):
    rows = run_query(store, "incidents", parameters).to_pylist()
    return [(row["first_frame"], row["last_frame"], row["frames"], row["kind"], row["attacked"]) for row in rows]


def test_the_queries_are_listed_and_found_by_name():
    names = [query.name for query in list_queries()]
    assert names == sorted(names)
    assert {"summary", "incidents", "frame", "skipped", "coverage", "error_distribution", "identification_rate"} <= {
        *names
    }
    assert query("summary").text.endswith(".")
    with pytest.raises(QueryError, match=r"there is no such query.*summary"):
        query("summery")


# incidents


def test_the_first_frame_of_a_recording_can_begin_an_incident(store):
    judged(store, "11cc")
    assert incidents(store) == [(0, 1, 2, "attacked", [1])]


def test_an_incident_of_one_frame_is_one(store):
    judged(store, "cc1cc")
    assert incidents(store) == [(2, 2, 1, "attacked", [1])]


def test_gaps_up_to_half_a_second_are_bridged_and_no_longer_ones(store):
    judged(store, "1cccc1" + "ccccc" + "1")
    assert incidents(store) == [(0, 5, 2, "attacked", [1]), (11, 11, 1, "attacked", [1])]
    assert incidents(store, gap_s=0.6) == [(0, 11, 3, "attacked", [1])]
    assert [row[:2] for row in incidents(store, gap_s=0)] == [(0, 0), (5, 5), (11, 11)]


def test_skipped_and_unaudited_frames_end_an_incident_only_by_their_length(store):
    judged(store, "1 n1" + " " * 5 + "1")
    assert incidents(store) == [(0, 3, 2, "attacked", [1]), (9, 9, 1, "attacked", [1])]


def test_each_attacked_set_and_kind_has_its_own_incidents(store):
    judged(store, "1212uu1s")
    assert incidents(store) == [
        (0, 6, 3, "attacked", [1]),
        (1, 3, 2, "attacked", [2]),
        (4, 5, 2, "unidentified", []),
        (7, 7, 1, "suspect", []),
    ]


def test_recordings_do_not_share_incidents(store):
    judged(store, "c1", recording="a")
    judged(store, "1c", recording="b")
    assert incidents(store) == [(1, 1, 1, "attacked", [1]), (0, 0, 1, "attacked", [1])]
    assert incidents(store, recording="b.mcap") == incidents(store, recording="bbbb") == [(0, 0, 1, "attacked", [1])]
    assert incidents(store, recording="nowhere") == []


def test_where_a_clock_is_set_back_within_a_recording_an_incident_ends(store):
    kinds = "c" * 10 + "111" + "c" * 17 + "11"
    stamps = [f * PERIOD_NS for f in range(20)] + [f * PERIOD_NS + 7 for f in range(3, 15)]
    judged(store, kinds, stamps=stamps)
    assert incidents(store) == [(10, 12, 3, "attacked", [1]), (30, 31, 2, "attacked", [1])]
    rows = run_query(store, "incidents").to_pylist()
    assert [(row["from_ns"], row["to_ns"]) for row in rows] == [(stamps[10], stamps[12]), (stamps[30], stamps[31])]


def test_an_incident_ends_where_the_clock_is_set_back_within_it_by_little(store):
    stamps = [0, PERIOD_NS, 2 * PERIOD_NS, PERIOD_NS + 7, 2 * PERIOD_NS + 7]
    judged(store, "1" * 5, stamps=stamps)
    assert [row[:3] for row in incidents(store)] == [(0, 2, 3), (3, 4, 2)]


def test_an_incident_tells_when_who_and_its_strongest_frame(store):
    stamps = [1_700_000_000_000_000_000 + f * PERIOD_NS for f in range(4)]
    judged(store, "c33c", scores=[0.9, 0.2, 0.4, 0.9], stamps=stamps, clock="utc")
    (row,) = run_query(store, "incidents").to_pylist()
    assert (row["from_ns"], row["to_ns"], row["seconds"]) == (stamps[1], stamps[2], 0.1)
    assert str(row["from_utc"])[:21] == "2023-11-14 22:13:20.1"
    assert row["attacked_names"] == ["S_3 cam3"]
    assert (row["strongest_frame"], row["largest_gap"]) == (2, 0.4)


def test_without_a_utc_clock_there_is_no_time_of_day(store):
    judged(store, "1")
    assert run_query(store, "incidents").column("from_utc").to_pylist() == [None]


def test_only_the_current_judgement_makes_incidents(store):
    measurement_id = judged(store, "1111")
    add_judgement(store, RIG, measurement_id, "cc2c", minutes=5, r="0.01")
    assert incidents(store) == [(2, 2, 1, "attacked", [2])]


# summary


def test_a_summary_counts_by_hand(store):
    edges = [skip(9, "edge", None), skip(10, "edge", None)]
    judged(store, "ccc12uns ", skipped=edges, damage=("chunk 7 is cut",))
    (row,) = run_query(store, "summary").to_pylist()
    counts = {name: row[name] for name in ("clean", "attacked", "unidentified", "suspect", "not_auditable")}
    assert counts == {"clean": 3, "attacked": 2, "unidentified": 1, "suspect": 1, "not_auditable": 1}
    assert (row["frames"], row["measured"], row["damage"]) == (9, 8, 1)
    assert row["audited_share"] == 7 / 9
    assert row["attacked_sensors"] == [1, 2]
    assert row["attacked_names"] == ["S_1 cam1", "S_2 cam2"]
    assert (row["r"], row["resolvable"]) == (0.0, True)


def test_what_was_not_judged_is_not_summed_up_as_clean(store):
    add_measurement(store, RIG, [make_measurement(RIG, 0)])
    (row,) = run_query(store, "summary").to_pylist()
    assert (row["measured"], row["clean"], row["audited_share"]) == (1, None, None)


def test_a_recording_that_was_not_measured_is_in_the_summary(store):
    judged(store, "cc")
    store.path("measurements", store.ids("measurements")[0]).unlink()
    (row,) = run_query(store, "summary").to_pylist()
    assert (row["name"], row["measured"], row["audited_share"]) == ("a.mcap", None, None)


# skipped and coverage


def test_skipped_ticks_are_counted_by_reason_and_sensor(store):
    add_measurement(store, RIG, [make_measurement(RIG, 0), skip(1), skip(2), skip(3, "late", 2), skip(4, "edge", None)])
    rows = run_query(store, "skipped").to_pylist()
    assert [(row["reason"], row["sensor"], row["ticks"], row["share"], row["first_frame"]) for row in rows] == [
        ("no LiDAR", 0, 2, 0.4, 1),
        ("edge", None, 1, 0.2, 4),
        ("late", 2, 1, 0.2, 3),
    ]


def test_coverage_counts_each_sensor(store):
    frames = [make_measurement(RIG, f, missing=(2,) if f < 3 else ()) for f in range(4)]
    add_measurement(store, RIG, [*frames, skip(4)])
    rows = run_query(store, "coverage").to_pylist()
    assert [(row["sensor_name"], row["present"], row["missing"], row["damaged"]) for row in rows] == [
        ("velo", 4, 0, 0),
        ("cam1", 4, 0, 0),
        ("cam2", 1, 3, 0),
        ("cam3", 4, 0, 0),
    ]
    assert (rows[0]["returns"], rows[0]["fewest_returns"], rows[0]["saturated_share"]) == (1001.5, 1000, None)
    assert (rows[1]["saturated_share"], rows[1]["textureless_share"], rows[1]["returns"]) == (0.25, 0.5, None)


# frame


def by_all_there(rig, absent=()):
    """The sensor checks that count in a frame without some sensors, in their order."""
    there = [one for one in rig_sensor_checks(rig) if not set(one.needed) & set(absent)]
    most = {}
    for one in there:
        most[one[:2]] = max(len(one.others), most.get(one[:2], 0))
    return [one for one in there if one.check in LIDAR_CHECKS or len(one.others) == most[one[:2]]]


def in_words(check):
    return f"{check.check.value} S_{check.sensor} by {' and '.join(f'S_{other}' for other in check.others)}"


def test_everything_of_one_frame_is_told(store):
    measurement_id = add_measurement(store, RIG, [make_measurement(RIG, 7, [250, None, 100])])
    store.write_labels("a" * 64, [AttackLabel("/cam1", "facula", 0, 10**12, {})], RIG)
    stamps = dict.fromkeys(range(8), 7 * PERIOD_NS)
    add_judgement(store, RIG, measurement_id, " " * 7 + "1", stamps=stamps, theta=0.1)
    answer = run_query(store, "frame", {"frame": 7})
    assert answer.column_names == [
        "part", "item", "value", "measured", "theta", "score", "note", "name", "measurement_id"
    ]  # fmt: skip
    rows = [tuple(row.values())[:7] for row in answer.to_pylist()]
    checks = [("score", in_words(one), None, None, None, None, None) for one in by_all_there(RIG)]
    camera = "skew +0.0 ms, 25.0 % saturated, 50.0 % without texture, 12.5 % unmatched"
    assert rows == [
        ("frame", "time", "0.700 s", None, None, None, "stamp 700000000 ns"),
        ("frame", "skipped", "no", None, None, None, None),
        ("frame", "labels", "S_1", None, None, None, None),
        ("sensor", "S_0 velo", "present", None, None, None, "skew +0.0 ms, 1007 points"),
        *(("sensor", f"S_{k} cam{k}", "present", None, None, None, camera) for k in (1, 2, 3)),
        ("verdict", "kind", "attacked", None, None, None, None),
        ("verdict", "attacked", "S_1", None, None, None, None),
        ("verdict", "reached with", "S_0 and S_1 and S_2 and S_3", None, None, None, None),
        ("verdict", "gap", None, 0.1, None, None, "the smallest distance of an E from its theta"),
        ("verdict", "probability", None, None, None, None, None),
        ("verdict", "likelihood ratio", None, None, None, None, None),
        ("verdict", "finding", None, None, None, None, None),
        ("verdict", "method", "algorithm2", None, None, None, None),
        ("error", "E_0,1,3", "1", 0.25, 0.1, None, "250 of 1000 px with texture inconsistent"),
        ("error", "E_0,2,3", "-", None, 0.1, None, None),
        ("error", "E_1,2,3", "0", 0.1, 0.1, None, "100 of 1000 px with texture inconsistent"),
        ("error", "E_0,1,2", None, None, None, None, None),  # the fallback, which was not needed
        *checks,
    ]
    assert run_query(store, "frame", {"frame": 8}).num_rows == 0


def test_a_frame_by_the_robust_method_has_scores_causes_and_alternatives(store):
    checks = rig_sensor_checks(RIG)
    counting = by_all_there(RIG, absent=(1,))
    statistics = [{counting[0]: 0.5, counting[1]: 0.1}.get(one) for one in checks]
    measurement_id = add_measurement(store, RIG, [make_measurement(RIG, 0, statistics=statistics, missing=(1,))])
    usual = float(log_odds(0.2))
    expected = {one: NullDistribution(usual, 0.5, 0.5, 2, 50, 0.0) for one in checks}
    thresholds = RobustThresholds("c" * 32, Decimal(0), 3.0, expected, {}, drives=2)
    verdict = Verdict(
        VerdictKind.SUSPECT,
        "---",
        out_of_system=(1,),
        reason="too few sensors",
        alternatives=(Alternative((), 1.5), Alternative((2, 3), 2.0)),
        causes=(FaultHypothesis(Cause.LATE, 2, 0.75),),
        evidence=(Evidence("added_light", 2, None, None, 5.5), Evidence("unmatched_light", 3, None, 2, 4.5)),
        finding=Finding(VerdictKind.SUSPECT, ()),
    )
    record = JudgementRecord(measurement_id, "robust", thresholds, RULES, judged_at=NOON)
    store.write_judgement(record, [(0, 0, verdict)])
    rows = [tuple(row.values())[:7] for row in run_query(store, "frame", {"frame": 0}).to_pylist()]
    assert ("sensor", "S_1 cam1", "missing", None, None, None) in [row[:6] for row in rows]
    assert ("verdict", "kind", "suspect", None, None, None, "too few sensors") in rows
    assert ("verdict", "reached with", "S_0 and S_2 and S_3", None, None, None, "without S_1") in rows
    assert [row[1:6] for row in rows if row[0] == "evidence"] == [
        ("added_light S_2", None, None, None, 5.5),
        ("unmatched_light S_3 or S_2", None, None, None, 4.5),
    ]
    scores = [row for row in rows if row[0] == "score"]
    theta, z = pytest.approx(statistic_at(usual + 3 * 0.5)), (log_odds(0.5) - usual) / 0.5
    assert scores[0] == ("score", in_words(counting[0]), None, 0.5, theta, pytest.approx(z), None)
    assert scores[1][3:6] == (0.1, theta, pytest.approx((log_odds(0.1) - usual) / 0.5))
    assert [row[1] for row in scores] == [in_words(one) for one in counting]
    assert rows[-3:] == [
        ("cause", "late S_2", None, 0.75, None, None, "S_2 lags by a frame"),
        ("alternative", "no attack", None, 1.5, None, None, "worse by so much"),
        ("alternative", "S_2 and S_3", None, 2.0, None, None, "worse by so much"),
    ]


def test_a_frame_that_was_skipped_or_not_judged_says_so(store):
    add_measurement(store, RIG, [skip(0), make_measurement(RIG, 1)])
    rows = {row["item"]: row for row in run_query(store, "frame", {"frame": 0}).to_pylist()}
    assert {item: (row["value"], row["note"]) for item, row in rows.items()} == {
        "time": ("0.000 s", "stamp 0 ns"),
        "skipped": ("yes", "no LiDAR (S_0)"),
    }
    rows = {row["item"]: row for row in run_query(store, "frame", {"frame": 1}).to_pylist()}
    assert (rows["kind"]["value"], rows["kind"]["note"]) == (None, "not judged")
    assert rows["labels"]["note"] == "the recording has no labels"
    assert rows["reached with"]["value"] is None


def test_a_frame_has_to_be_named(store):
    with pytest.raises(QueryError, match="frame is missing"):
        run_query(store, "frame")


# error_distribution


def distribution(store, **parameters):
    rows = run_query(store, "error_distribution", parameters).to_pylist()
    return {((row["i"], row["j"], row["k"]), row["attacked"]): row for row in rows}


def test_disparity_errors_are_told_apart_by_the_labels(store):
    frames = [make_measurement(RIG, f, [10 * f, None if f == 9 else 5, 1000]) for f in range(1, 11)]
    add_measurement(store, RIG, frames)
    store.write_labels("a" * 64, [AttackLabel("/cam1", "facula", 9 * PERIOD_NS, 10 * PERIOD_NS, {})], RIG)
    found = distribution(store, bins=10)
    clean, attacked = found[(0, 1, 3), False], found[(0, 1, 3), True]
    assert (clean["frames"], attacked["frames"]) == (8, 2)
    assert (clean["smallest"], clean["median"], clean["q90"], clean["largest"]) == (0.01, 0.04, 0.08, 0.08)
    assert clean["histogram"] == [8, 0, 0, 0, 0, 0, 0, 0, 0, 0]
    assert attacked["histogram"] == [1, 1, 0, 0, 0, 0, 0, 0, 0, 0]
    untouched = found[(0, 2, 3), False]
    assert (untouched["frames"], untouched["not_measured"], sum(untouched["histogram"])) == (10, 1, 9)
    assert ((0, 2, 3), True) not in found
    assert found[(1, 2, 3), False]["histogram"] == [0, 0, 0, 0, 0, 0, 0, 0, 0, 8]


def test_without_labels_nothing_is_called_clean_or_attacked(store):
    add_measurement(store, RIG, [make_measurement(RIG, f, [None, 5, 6]) for f in range(3)])
    found = distribution(store)
    assert {attacked for _, attacked in found} == {None}
    row = found[(0, 1, 3), None]
    assert (row["frames"], row["not_measured"], row["median"], sum(row["histogram"])) == (3, 3, None, 0)


def test_either_statistic_can_be_looked_at_and_no_other(store):
    add_measurement(store, RIG, [make_measurement(RIG, f, [100, 100, 100]) for f in range(3)])
    assert distribution(store)[(0, 1, 3), None]["median"] == 0.1
    assert distribution(store, statistic="plain")[(0, 1, 3), None]["median"] == 0.05
    with pytest.raises(QueryError, match="statistic is 'other', not plain or gated"):
        distribution(store, statistic="other")


# truth


def test_a_clock_that_is_set_back_does_not_narrow_the_half_period_that_a_label_is_given(store):
    stamps = [f * PERIOD_NS for f in range(8)] + [f * PERIOD_NS + 10_000_000 for f in range(8)]
    add_measurement(store, RIG, [make_measurement(RIG, f, stamp_ns=stamp) for f, stamp in enumerate(stamps)])
    store.write_labels("a" * 64, [AttackLabel("/cam1", "facula", 3 * PERIOD_NS + 40_000_000, 4 * PERIOD_NS, {})], RIG)
    sql = "SELECT frame FROM truth WHERE truth = [1] ORDER BY frame"
    assert run_sql(store, sql).column(0).to_pylist() == [3, 4, 11, 12]


def test_a_label_covers_the_frames_whose_stamps_it_holds_give_or_take_half_a_period(store):
    frames = [make_measurement(RIG, f, missing=(2,) if f == 4 else ()) for f in range(8)]
    add_measurement(store, RIG, [*frames, skip(8)])
    labels = [
        AttackLabel("/cam2", "facula", 3 * PERIOD_NS + 10_000_000, 5 * PERIOD_NS - 10_000_000, {}),
        AttackLabel("/velo", "wall", 5 * PERIOD_NS, 5 * PERIOD_NS, {}),
        AttackLabel("/elsewhere", "wall", 0, 10**15, {}),
    ]
    store.write_labels("a" * 64, labels, RIG)
    truth = run_sql(store, "SELECT truth FROM truth ORDER BY frame").column(0).to_pylist()
    assert truth == [[], [], [], [2], [], [0, 2], [], []]


# identification_rate: see also test_identification_sql


def rates(store, **parameters):
    rows = run_query(store, "identification_rate", parameters).to_pylist()
    return {(row["r"], tuple(row["attacked"])): row for row in rows}


@pytest.fixture
def attacked_store(store):
    """Ten clean frames, then eight with S_1 attacked; N = 10 clean samples of 0.01 to 0.10 a triple."""
    samples = {(Statistic.GATED, t): [n / 100 for n in range(1, 11)] for t in RIG.triples}
    calibration = make_calibration(RIG.kind, PROCEDURE, clean_frames(samples, ["b" * 64]))
    store.write_calibration(calibration)
    clean = [[10 * f + 10] * 3 for f in range(10)]  # E = 0.01 .. 0.10: at r = 0.2 theta = 0.08, two are above
    attack = [
        [300, 50, 300],  # 101, S_1 named
        [300, 50, 300],
        [300, 300, 50],  # 110, S_0 named in its place
        [300, 300, 300],  # 111, S_3 named in its place
        [300, 50, 50],  # 100: Algorithm 2 names S_1, but no attack explains it
        [50, 50, 50],  # missed
        [None, None, None],  # not measured
        [300, 50, 300],
    ]
    measurement_id = add_measurement(store, RIG, [make_measurement(RIG, f, E) for f, E in enumerate(clean + attack)])
    store.write_labels("a" * 64, [AttackLabel("/cam1", "facula", 10 * PERIOD_NS, 17 * PERIOD_NS, {})], RIG)
    add_judgement(store, RIG, measurement_id, "", calibration_id=calibration.calibration_id)
    return store


def test_the_identification_rate_is_counted_by_hand(attacked_store):
    found = rates(attacked_store, r="0,0.2,0.05,1")
    attack = found[0.0, (1,)]
    assert (attack["frames"], attack["detected"], attack["named"], attack["identified"]) == (8, 6, 4, 3)
    assert attack["not_auditable"] == 1
    assert (attack["naming_rate"], attack["identification_rate"]) == (4 / 8, 3 / 8)
    assert attack["false_alarms"] is None
    assert found[0.0, ()]["false_alarms"] == 0
    clean = found[0.2, ()]
    assert (clean["frames"], clean["false_alarms"], clean["false_alarm_rate"]) == (10, 2, 0.2)
    assert clean["detected"] is None
    assert found[1.0, ()]["false_alarms"] == 10
    assert found[1.0, (1,)]["named"] == 0
    assert not clean["in_sample"]
    assert not clean["transferred"]


def test_a_rate_below_one_in_n_is_marked_and_judged_like_zero(attacked_store):
    found = rates(attacked_store, r="0,0.05,0.1")
    assert [found[r, ()]["resolvable"] for r in (0.0, 0.05, 0.1)] == [True, False, True]
    assert [found[r, ()]["false_alarms"] for r in (0.0, 0.05, 0.1)] == [0, 0, 1]
    assert {row["samples"] for row in found.values()} == {10}


def test_rates_stand_with_wilsons_interval(attacked_store):
    row = rates(attacked_store)[0.0, (1,)]
    assert (row["identification_low"], row["identification_high"]) == pytest.approx((0.136844, 0.694257), abs=1e-6)
    nobody = rates(attacked_store)[0.0, ()]
    assert nobody["detection_low"] is None
    assert (nobody["false_alarm_low"], nobody["false_alarm_high"]) == pytest.approx((0, 0.277533), abs=1e-6)


def test_without_a_calibration_there_is_no_rate(store):
    judged(store, "cc")
    assert run_query(store, "identification_rate").num_rows == 0


def test_another_calibration_can_be_named_and_says_that_it_was_transferred(attacked_store):
    samples = {(Statistic.GATED, t): [0.2] for t in RIG.triples}
    other = make_calibration(make_rig(3, focal_px=900.0).kind, PROCEDURE, clean_frames(samples, ["a" * 64]))
    attacked_store.write_calibration(other)
    row = rates(attacked_store, calibration=other.calibration_id[:12], r=[Decimal(0)])[0.0, (1,)]
    assert (row["transferred"], row["in_sample"], row["calibration_id"]) == (True, True, other.calibration_id)


def test_a_triple_without_samples_is_not_measured(attacked_store):
    partly = make_calibration(RIG.kind, PROCEDURE, clean_frames({(Statistic.GATED, RIG.triples[0]): [0.1]}))
    attacked_store.write_calibration(partly)
    row = rates(attacked_store, calibration=partly.calibration_id, r="0")[0.0, (1,)]
    assert (row["detected"], row["named"], row["not_auditable"]) == (6, 0, 1)


def test_vehicles_of_one_kind_are_one_kind_in_words(store):
    rigs = [make_rig(3, focal_px=focal_px) for focal_px in (700.0, 704.0, 710.0, 900.0)]
    for rig in rigs:
        store.write_rig(rig)
    words = {row["rig_id"]: row["kind"] for row in run_sql(store, "SELECT rig_id, kind FROM rigs").to_pylist()}
    first = min(rigs[:3], key=lambda rig: rig.rig_id)
    assert [words[rig.rig_id] for rig in rigs] == [str(first.kind)] * 3 + [str(rigs[3].kind)]


def test_no_connection_shows_a_bar_that_would_stand_in_redirected_output():
    with shut_connection() as connection:
        assert connection.execute("SELECT current_setting('enable_progress_bar')").fetchone() == (False,)


def test_every_column_of_every_view_and_query_has_its_sentence_and_no_other_is_described():
    for file in (*list_queries(), *list_views()):
        description = describe(file.name)
        assert description.text.endswith("."), file.name
        for column in description.columns:
            assert column.sentence.endswith("."), (file.name, column)
            assert column.type, (file.name, column)
        assert set(file.columns) <= {column.name for column in description.columns}, file.name


def test_every_parameter_is_used_and_its_default_is_of_its_type():
    for one in list_queries():
        names = {parameter.name for parameter in one.parameters}
        assert set(re.findall(r"\$(\w+)", one.sql)) == names, one.name
        required = {parameter.name: "0" for parameter in one.parameters if parameter.required}
        assert bind(one, required).keys() == names, one.name


def test_what_is_not_there_is_not_described():
    with pytest.raises(QueryError, match=r"no such query or view; did you mean incidents\?"):
        describe("incident")


def test_the_page_lists_every_table_view_query_and_parameter_in_their_own_words():
    page = PAGE.read_text(encoding="utf-8")
    assert page == written_anew(page), "write it: python -m tests.store.store_page"
    assert re.findall(r"^### (\w+)$", page, re.MULTILINE) == [query.name for query in list_queries()]
