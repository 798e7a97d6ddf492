"""A store judged by the robust method: what SQL says of it is what Python said."""

from dataclasses import replace
from decimal import Decimal
from operator import itemgetter

import numpy as np
import pytest

from auditor.identification.incidents.series import FrameSeries
from auditor.identification.parameters import SCORE_LIMITS
from auditor.identification.prior import statistic_at
from auditor.identification.robust import judge_frames
from auditor.identification.scores import normalised_scores
from auditor.identification.systems import System
from auditor.model.calibration import NullDistribution, RobustThresholds
from auditor.model.checks import Check, rig_sensor_checks
from auditor.model.verdict import Cause, Evidence, FaultHypothesis, Finding, VerdictKind
from auditor.pipeline.judge import todays_rules
from auditor.pipeline.reading import frames_not_audited
from auditor.reporting.fleet import load_fleet, render
from auditor.store.queries import describe, run_query, run_sql
from auditor.store.records import JudgementRecord
from auditor.store.reviews import ReviewVerdict, review_incident
from tests.making.stores import (
    NOON,
    RULES,
    add_judgement,
    add_measurement,
    make_measurement,
    make_rig,
    make_verdict,
    new_store,
)

RIG = make_rig(3)
CHECKS = rig_sensor_checks(RIG)
FRAMES = 30


@pytest.fixture
def judged(tmp_path):
    """A store with random statistics, among which S_1 is attacked in ten frames, and the verdicts given on them."""
    rng = np.random.default_rng(3)
    statistics = rng.uniform(0.05, 0.15, (FRAMES, len(CHECKS)))
    statistics[rng.random(statistics.shape) < 0.05] = np.nan
    strong = [place for place, one in enumerate(CHECKS) if one.check is Check.ADDED_LIGHT and one.sensor == 1]
    statistics[10:20, strong] = 0.99
    given = [[None if np.isnan(x) else x for x in row] for row in statistics.tolist()]
    store = new_store(tmp_path)
    known = add_measurement(store, RIG, [make_measurement(RIG, f, statistics=row) for f, row in enumerate(given)])
    expected = {check: NullDistribution(-2.2, 0.4, 0.4, 3, 100, 0.0) for check in CHECKS[:-1]}  # of the last nothing is
    loaded = store.load_statistics(known)
    system = System(CHECKS, RIG.triples, RIG.sensors, RIG.fallback)
    thresholds = RobustThresholds(
        "c" * 32, Decimal("0.01"), 3.5, expected, {}, drives=3, evidence_limit=1.0, incidents_per_hour=2.0
    )
    present = loaded.states == "present"
    series = FrameSeries.of_recording(loaded.stamps_ns, loaded.statistics, present, loaded.fingerprints, {})
    verdicts = judge_frames(series, system, thresholds)
    rows = zip(loaded.frames.tolist(), loaded.stamps_ns.tolist(), verdicts, strict=True)
    store.write_judgement(JudgementRecord(known, "robust", thresholds, todays_rules(), NOON), rows)
    return store, known, verdicts, normalised_scores(loaded.statistics, [expected.get(check) for check in CHECKS])


def test_scores_in_sql_are_those_in_python(judged):
    store, _, _, z = judged
    rows = run_sql(store, "SELECT frame, position, z FROM statistics ORDER BY frame, position").to_pylist()
    found = np.array([np.nan if row["z"] is None else row["z"] for row in rows]).reshape(z.shape)
    np.testing.assert_allclose(found, z, rtol=1e-12)
    assert np.nanmax(found) == SCORE_LIMITS.highest
    assert np.isnan(found[:, -1]).all()


def test_findings_are_the_frames_of_incidents_with_what_they_add(judged):
    store, known, verdicts, _ = judged
    sql = "SELECT frame, kind, attacked, own_kind, event, event_added FROM findings ORDER BY frame"
    found = [tuple(row.values()) for row in run_sql(store, sql).to_pylist()]
    expected = [
        (f, v.finding.kind, list(v.finding.attacked), v.kind, v.finding.event, v.finding.added)
        for f, v in enumerate(verdicts)
        if v.in_incident
    ]
    assert found == expected
    assert {frame for frame, *_ in expected} >= set(range(10, 20))
    judgement = store.current_judgements()[known]
    assert judgement.in_incidents == len(expected)
    assert judgement.statistic is None
    assert judgement.counts[VerdictKind.CLEAN] == sum(v.kind is VerdictKind.CLEAN for v in verdicts)


def test_an_incident_says_in_words_what_carried_it_and_what_else_it_could_be(judged):
    store, *_ = judged
    (row,) = [row for row in run_query(store, "incidents").to_pylist() if row["attacked"] == [1]]
    assert "S_1 sees light that others do not in 10 frames (+12.00)" in row["evidence"]
    assert "no attack (under 1 %)" in row["alternatives"]
    assert row["causes"] is None
    facts = {(row["part"], row["item"]): row for row in run_query(store, "frame", {"frame": 15}).to_pylist()}
    assert (facts["verdict", "finding"]["value"], facts["verdict", "finding"]["note"]) == ("attacked", "S_1")
    light = facts["score", "added_light S_1 by S_2 and S_3"]
    assert (light["measured"], light["score"]) == (0.99, SCORE_LIMITS.highest)
    assert light["theta"] == pytest.approx(statistic_at(-2.2 + 3.5 * 0.4))
    assert "added_light S_1 by S_2" not in {item for _, item in facts}
    assert all(row["measured"] > 0 for (part, _), row in facts.items() if part == "alternative")
    assert "alternative" in {part for part, _ in facts}


def kept_verdicts(store, *verdicts, step_ns=10**9):
    """A judgement by the robust method with these verdicts on successive frames."""
    known = add_measurement(store, RIG, [make_measurement(RIG, f) for f in range(len(verdicts))])
    thresholds = RobustThresholds("c" * 32, Decimal(0), 4.0, {}, {}, drives=0)
    rows = [(f, f * step_ns, verdict) for f, verdict in enumerate(verdicts)]
    return store.write_judgement(JudgementRecord(known, "robust", thresholds, RULES, NOON), rows)


def part_of(own, attacked, event, *, alert=False, added=1.0):
    """A frame with a verdict of its own that belongs to an event."""
    return replace(make_verdict(RIG, own), finding=Finding(VerdictKind.ATTACKED, attacked, event, alert, added))


def test_one_event_is_one_incident_with_the_shares_of_what_its_frames_say(tmp_path):
    store, clean = new_store(tmp_path), make_verdict(RIG, "c")
    strobe = [part_of("1", (1,), 1, added=3.0), clean, part_of("2", (1,), 1), clean, part_of("c", (1,), 1, added=0.5)]
    kept = kept_verdicts(store, *strobe, *[clean] * 3, part_of("1", (1,), 2))
    assert kept.in_incidents == 4
    first, second = run_query(store, "incidents").to_pylist()
    assert (first["frames"], first["first_frame"], first["last_frame"], first["seconds"]) == (3, 0, 4, 4.0)
    assert first["shares"] == "attacked: S_1 75 %, attacked: S_2 25 %"
    assert first["strongest_frame"] in (0, 2), "not one that is clean by itself"
    assert (second["first_frame"], second["frames"]) == (8, 1)


def test_an_incident_of_frames_none_of_which_is_a_finding_counts_as_found_and_says_so(tmp_path):
    store = new_store(tmp_path)
    weak = part_of("c", (1,), 1, added=0.1)
    kept = kept_verdicts(store, make_verdict(RIG, "c"), *[weak] * 3)
    assert (kept.in_incidents, kept.found, kept.counts[VerdictKind.CLEAN]) == (3, 3, 4)
    [incident] = run_query(store, "incidents").to_pylist()
    assert (incident["frames"], incident["strongest_frame"]) == (3, None)
    assert (incident["weak"], incident["evidence"]) == (True, "no single frame: weak evidence that lasts")


def test_an_incident_of_what_lasts_says_that_its_frames_say_another_thing(tmp_path):
    store = new_store(tmp_path)
    evidence, dirt = (Evidence(Check.ADDED_LIGHT, 1, None, None, 4.0),), (FaultHypothesis(Cause.SOILED, 1, 0.5),)
    lasts = replace(part_of("s", (1,), 1), evidence=evidence, causes=dirt)
    kept_verdicts(store, *[lasts] * 3)
    [incident] = run_query(store, "incidents").to_pylist()
    assert (incident["weak"], incident["shares"]) == (False, "suspect 100 %")
    assert incident["evidence"].endswith(" in 3 frames (+4.00); no single frame is attacked by itself: what lasts is")
    assert incident["causes"].endswith("on its lens do (score 0.50 of 1), of single frames and not of what lasts")


@pytest.mark.parametrize(
    ("own", "said"), [("1", "under the attack as without"), ("s", "with an attack or a fault as with neither")]
)
def test_what_a_ratio_weighs_is_an_attack_only_where_the_verdict_is_one(tmp_path, own, said):
    store, verdict = new_store(tmp_path), replace(make_verdict(RIG, own), log10_ratio=1.0)
    finding = Finding(verdict.kind, verdict.attacked, 1, alert=False, added=1.0)
    kept_verdicts(store, *[replace(verdict, finding=finding)] * 3)
    [incident] = run_query(store, "incidents").to_pylist()
    assert incident["ratio"] == f"about 10 times as likely {said}: moderate support"
    facts = {row["item"]: row["note"] for row in run_query(store, "frame", {"frame": 1}).to_pylist()}
    assert facts["likelihood ratio"] == incident["ratio"]


def test_too_few_audited_frames_are_told_with_the_most_frequent_reason(tmp_path):
    store = new_store(tmp_path)
    seldom = replace(make_verdict(RIG, "n"), reason="seldom")
    kept = kept_verdicts(store, *(make_verdict(RIG, kind) for kind in "cnn"), seldom)
    told = frames_not_audited(store, store.measurement(kept.measurement_id), kept, 0.9, RIG, ())
    assert list(told) == ["1 of 4 frames audited; 2 others: a reason"]


def test_a_day_counts_its_alerts_apart_from_its_incidents_and_both_without_excused_ones(tmp_path):
    store = new_store(tmp_path)
    alerts = [part_of("2", (2,), 2, alert=True), make_verdict(RIG, "c"), part_of("3", (3,), 3, alert=True)]
    kept_verdicts(store, part_of("1", (1,), 1), *alerts)
    counts = itemgetter("incidents", "alerts", "excused")
    assert [counts(day) for day in run_query(store, "report_days").to_pylist()] == [(1, 2, 0)]
    rows = run_query(store, "incidents").to_pylist()
    assert "<b>1\u00a0incident and 2\u00a0alerts</b>" in render(load_fleet(store, rows))
    review_incident(store, next(row for row in rows if row["grade"] == "alert"), ReviewVerdict.KNOWN, "low sun")
    assert [counts(day) for day in run_query(store, "report_days").to_pylist()] == [(1, 1, 1)]
    page = render(load_fleet(store, run_query(store, "incidents").to_pylist()))
    assert "1\u00a0alert excused by a review" in page


def test_what_several_views_and_checks_of_a_frame_say_is_said_once_and_counts_it_once(tmp_path):
    store = new_store(tmp_path)
    checks = (Check.SURROUNDING_CONFLICT, Check.FREE_SPACE_CONFLICT, Check.FREE_SPACE_CONFLICT, Check.FALSE_RANGES)
    evidence = tuple(Evidence(check, 0, None, None, 8.0 - place) for place, check in enumerate(checks))
    kept_verdicts(store, *[replace(part_of("0", (0,), 1), evidence=evidence)] * 3)
    [incident] = run_query(store, "incidents").to_pylist()
    passed = "the LiDAR has points where its beams passed a moment ago"
    seen = "the LiDAR has points where the cameras see nothing"
    assert incident["evidence"] == f"{passed} in 3 frames (+8.00), {seen} in 3 frames (+5.00)"
    [frame] = run_query(store, "look_first").to_pylist()
    assert frame["evidence"] == f"{passed} (+8.00), {seen} (+5.00)"


def test_the_frames_worth_looking_at_say_the_names_of_the_cameras_in_their_evidence(tmp_path):
    store = new_store(tmp_path)
    evidence = (Evidence(Check.ADDED_LIGHT, 1, None, 2, 8.0), Evidence(Check.REMOVED_LIGHT, 2, None, None, 7.0))
    kept_verdicts(store, replace(part_of("1", (1,), 1), evidence=evidence))
    [frame] = run_query(store, "look_first").to_pylist()
    assert frame["evidence"] == (
        "S_1 cam1 or S_2 cam2 alone sees light (+8.00), S_2 cam2 lacks light that others see (+7.00)"
    )


def test_events_of_one_set_that_a_gap_parts_by_little_are_one_incident(tmp_path):
    store = new_store(tmp_path)
    kept_verdicts(store, part_of("1", (1,), 1), part_of("1", (1,), 2), part_of("2", (2,), 3), step_ns=10**8)
    assert [(row["attacked"], row["frames"]) for row in run_query(store, "incidents").to_pylist()] == [
        ([1], 2),
        ([2], 1),
    ]


def test_an_alert_is_told_apart_from_incidents(tmp_path):
    store = new_store(tmp_path)
    clean = make_verdict(RIG, "c")
    kept = kept_verdicts(store, clean, part_of("1", (1,), 1, alert=True), clean, make_verdict(RIG, "2"))
    assert (kept.in_incidents, kept.in_alerts, kept.found) == (0, 1, 1)
    [incident] = run_query(store, "incidents").to_pylist()
    assert (incident["grade"], incident["first_frame"], incident["attacked"]) == ("alert", 1, [1])
    assert run_sql(store, "SELECT frame, alert FROM findings").to_pylist() == [{"frame": 1, "alert": True}]
    looked_at = run_query(store, "look_first").to_pylist()
    assert [(row["frame"], row["grade"]) for row in looked_at] == [(1, "alert"), (3, None)]


RIG_OF_TWO = make_rig(2)
"""Another rig of the same recording: it has the LiDAR and the first two cameras."""


def said_by_two_rigs(store, verdicts, others, *, step_ns=10**8):
    """What two rigs of one recording say of its frames; the ids of the incidents of each."""
    for rig, said in ((RIG, verdicts), (RIG_OF_TWO, others)):
        known = add_measurement(store, rig, [make_measurement(rig, frame) for frame in range(len(said))])
        thresholds = RobustThresholds("c" * 32, Decimal(0), 4.0, {}, {}, drives=0)
        rows = [(frame, frame * step_ns, verdict) for frame, verdict in enumerate(said)]
        store.write_judgement(JudgementRecord(known, "robust", thresholds, RULES, NOON), rows)
    incidents = run_query(store, "incidents").to_pylist()
    return [next(row for row in incidents if row["rig_id"] == rig.rig_id) for rig in (RIG, RIG_OF_TWO)]


def unnamed(own):
    """A frame of an event that names no sensor."""
    return replace(make_verdict(RIG, own, 5.0), finding=Finding(VerdictKind.UNIDENTIFIED, (), 1))


@pytest.mark.parametrize("own", ["c", "n"])
def test_a_name_by_weak_evidence_alone_takes_no_place_of_findings_without_a_name(tmp_path, own):
    clean = make_verdict(RIG, "c")
    weak = [clean] * 4 + [part_of(own, (0,), 1)] * 4
    strong, named = said_by_two_rigs(new_store(tmp_path), [clean, *[unnamed("u")] * 7], weak)
    assert (strong["same_as"], named["same_as"]) == (None, strong["incident_id"])


def test_a_name_by_findings_of_its_own_frames_takes_the_place_of_findings_without_a_name(tmp_path):
    named, strong = said_by_two_rigs(new_store(tmp_path), [part_of("0", (0,), 1)] * 4, [unnamed("u")] * 4)
    assert (named["same_as"], strong["same_as"]) == (None, named["incident_id"])


def test_of_one_name_findings_of_frames_stand_before_weak_evidence_and_more_of_them_before_fewer(tmp_path):
    weak, strong = said_by_two_rigs(new_store(tmp_path / "a"), [part_of("c", (0,), 1)] * 4, [part_of("0", (0,), 1)] * 4)
    assert (weak["same_as"], strong["same_as"]) == (strong["incident_id"], None)
    mixed = [part_of("0", (0,), 1), *[part_of("c", (0,), 1)] * 3]
    fewer, more = said_by_two_rigs(new_store(tmp_path / "b"), mixed, [part_of("0", (0,), 1)] * 4)
    assert (fewer["same_as"], more["same_as"]) == (more["incident_id"], None)


def test_weak_evidence_takes_no_place_of_other_weak_evidence_without_a_name(tmp_path):
    named, other = said_by_two_rigs(new_store(tmp_path), [part_of("c", (0,), 1)] * 4, [unnamed("c")] * 4)
    assert (named["same_as"], other["same_as"]) == (None, None)


def test_a_frame_that_belongs_to_no_incident_names_no_sensor_in_the_summary(tmp_path):
    store = new_store(tmp_path)
    known = add_measurement(store, RIG, [make_measurement(RIG, f) for f in range(3)])
    alone = replace(make_verdict(RIG, "2"), finding=None)
    confirmed = replace(make_verdict(RIG, "1"), finding=Finding(VerdictKind.ATTACKED, (1,)))
    thresholds = RobustThresholds("c" * 32, Decimal(0), 4.0, {}, {}, drives=0)
    rows = [(f, f, verdict) for f, verdict in enumerate((alone, confirmed, make_verdict(RIG, "c")))]
    kept = store.write_judgement(JudgementRecord(known, "robust", thresholds, RULES, NOON), rows)
    assert kept == store.current_judgements()[known]
    assert (kept.drives, kept.resolvable) == (0, True)
    (row,) = run_query(store, "summary").to_pylist()
    assert (row["attacked"], row["attacked_sensors"]) == (2, [1])
    column = next(column for column in describe("summary").columns if column.name == "attacked_sensors")
    assert column.sentence.startswith("Sensors that an incident or an alert names")


def test_the_later_judgement_decides_by_which_method_a_frame_belongs_to_an_incident(judged):
    store, known, *_ = judged
    add_judgement(store, RIG, known, "c" * 29 + "2", minutes=5, method="paper")
    (row,) = run_query(store, "incidents").to_pylist()
    assert (row["first_frame"], row["attacked"]) == (29, [2])
    assert [row["method"] for row in run_query(store, "summary").to_pylist()] == ["paper"]
