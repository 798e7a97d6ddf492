"""The incident page of judgements by the robust method: evidence by sensor and check, and z against the limit."""

from dataclasses import replace
from decimal import Decimal

import numpy as np
import pytest

from auditor.identification.evidence_parameters import LIKELIHOOD
from auditor.model.calibration import RobustThresholds
from auditor.model.checks import Check, SensorCheck
from auditor.model.checks.kind import Of
from auditor.model.verdict import Alternative, Evidence, Finding, VerdictKind
from auditor.reporting.fleet import render_fleet_report
from auditor.reporting.incident.loading import load_page
from auditor.reporting.incident.render import render, render_incident_page
from auditor.reporting.incident.timeline import evidence_lines, sensor_scores, with_evidence
from auditor.store.queries import run_query
from auditor.store.records import JudgementRecord
from tests.making.pages import Page
from tests.making.report_stores import add_recording, make_rig, new_store
from tests.making.stores import NOON, RULES, add_measurement, make_measurement, make_verdict

NAN = np.nan


@pytest.fixture
def store(tmp_path):
    return new_store(tmp_path)


def part_of(store):
    (part,) = load_page(store).recordings
    return part


def words_of(store):
    return Page(render(load_page(store))).words


def test_an_incident_tells_its_evidence_by_sensor_and_check_with_z_and_the_limit(store):
    add_recording(store, attacks=[((1,), 10, 19)], drives=3, r="0.01")
    (incident,) = part_of(store).incidents
    assert sorted((line.check, line.sensor, line.other, line.frames) for line in incident.checks) == [
        ("added_light", 1, None, 10),
        ("added_texture", 1, None, 10),
        ("coloured_light", 1, None, 10),
        ("foreign_texture", 1, None, 10),
        ("photometric_inconsistency", 1, None, 10),
        ("removed_light", 1, None, 10),
        ("striped_light", 1, None, 10),
        ("unmatched_light", 1, None, 10),
        ("veiling_light", 1, None, 10),
    ]
    limit = part_of(store).provenance.limit
    assert all(limit < line.mean <= line.largest + 1e-9 <= 12 for line in incident.checks)
    words = words_of(store)
    assert "Sensor What its checks say Frames Mean z Largest z Limit" in words
    strongest = incident.checks[0]
    assert f"10 {strongest.mean:.1f} {strongest.largest:.1f} {limit:.1f}" in words
    assert "S1 sees light that the others do not 10" in words
    assert "Carried by" not in words


def test_every_sensor_has_a_chart_of_its_largest_z_and_the_limit(store):
    add_recording(store, attacks=[((1,), 10, 19)], drives=3, r="0.01")
    part = part_of(store)
    charts = part.incidents[0].figure.charts
    assert [(chart.name, chart.indices, chart.theta, chart.mark) for chart in charts] == [
        ("S", (sensor,), part.provenance.limit, "limit") for sensor in range(4)
    ]
    assert [chart.above.count("M") for chart in charts] == [0, 10, 0, 0]
    assert f"limit {part.provenance.limit:.2f}" in words_of(store)


def test_a_sensor_that_is_missing_has_no_z_and_the_others_have_that_of_the_voters_that_are_left(store):
    add_recording(store, frames=30, attacks=[((1,), 10, 19)], missing=[(2, 12), (2, 13)], drives=3, r="0.01")
    charts = part_of(store).incidents[0].figure.charts
    assert charts[2].path.count("M") == 2
    assert charts[1].path.count("M") == 1


def test_thresholds_say_how_many_drives_they_were_learnt_from(store):
    add_recording(store, attacks=[((1,), 10, 19)], drives=3, r="0.01")
    by = part_of(store).provenance
    words = words_of(store)
    assert f"Thresholds Learnt from 3 drives; the largest z of a frame must exceed {by.limit:.2f}" in words
    assert "false-alarm rate of a frame" in words
    assert "resolvable" not in words
    assert {(line.check, line.sensor, line.others) for line in by.checks if line.sensor == 1} == {
        (check, 1, (2, 3)) for check in Check if check.kind.of is Of.CAMERAS
    }
    assert all(0 < line.expected < line.theta <= 1 and line.samples == 60 for line in by.checks)


def test_the_prior_alone_is_a_caution(store):
    add_recording(store, attacks=[((1,), 10, 19)], drives=0, r="0.01")
    words = words_of(store)
    assert "Judged by the prior alone: no clean drive of this rig kind was seen." in words
    assert "Thresholds Prior; the largest z of a frame must exceed" in words


def test_two_cameras_alone_are_told_as_a_pair(store):
    rig = make_rig(("velo", "right", "left"))
    add_recording(store, rig=rig, attacks=[((1,), 10, 19)], drives=3, r="0.01")
    (incident,) = part_of(store).incidents
    of_two = [line for line in incident.checks if line.check != "coloured_light"]  # that one camera alone can show
    assert {(line.sensor, line.other) for line in of_two} <= {(1, 2), (2, 1)}
    assert "one of the two sees light that the other does not" in words_of(store)


def kept(store, *verdicts):
    """A store with these verdicts on successive frames."""
    rig = make_rig()
    known = add_measurement(store, rig, [make_measurement(rig, frame) for frame in range(len(verdicts))])
    thresholds = RobustThresholds("c" * 32, Decimal("0.01"), 4.0, {}, {}, drives=0)
    rows = [(frame, frame * 10**9, verdict) for frame, verdict in enumerate(verdicts)]
    store.write_judgement(JudgementRecord(known, "robust", thresholds, RULES, NOON), rows)
    return store


def of_event(own, event, *, alert=False, **more):
    """A frame with a verdict of its own, in an event that names S_1."""
    finding = Finding(VerdictKind.ATTACKED, (1,), event, alert)
    return replace(make_verdict(make_rig(), own, 2.0), finding=finding, **more)


def test_incidents_and_alerts_are_counted_apart_on_the_page_of_all(store):
    clean = make_verdict(make_rig(), "c")
    kept(store, *[of_event("1", 1)] * 3, clean, of_event("1", 2, alert=True), clean, of_event("1", 3, alert=True))
    page = Page(render(load_page(store)))
    assert "<title>Sensor audit: 1\u00a0incident and 2\u00a0alerts</title>" in render(load_page(store))
    assert "This is the longest of 1 incident and 2 alerts in 1 recording" in page.words
    assert "and 2 alerts; 5 frames in incidents or alerts" in page.words


def test_the_title_of_the_index_counts_incidents_and_alerts_apart(store, tmp_path):
    clean = make_verdict(make_rig(), "c")
    kept(store, *[of_event("1", 1)] * 3, clean, of_event("1", 2, alert=True))
    index = render_fleet_report(store, out=tmp_path).read_text()
    assert "<title>Sensor audit: 1\u00a0incident and 1\u00a0alert in 1\u00a0recording</title>" in index


def test_the_strongest_frame_and_its_explanations_are_of_the_sensors_that_the_incident_names(store):
    weighed = (Alternative((1,), 1.0), Alternative((), 2.0))
    both = replace(of_event("1", 1, posterior=0.9), attacked=(0, 1), gap=9.0, alternatives=weighed)
    own = of_event("1", 1, posterior=0.9, alternatives=(Alternative((), 2.0), Alternative((2,), 3.0)))
    [row] = run_query(kept(store, both, own, both), "incidents").to_pylist()
    assert (row["strongest_frame"], row["largest_gap"]) == (1, 2.0)
    assert row["alternatives"] == "no attack (under 1 %), S_2 (under 1 %)"


def test_where_no_frame_names_just_the_sensors_of_the_incident_no_explanations_are_given(store):
    weighed = (Alternative((1,), 1.0), Alternative((), 2.0))
    both = replace(of_event("1", 1, posterior=0.9), attacked=(0, 1), alternatives=weighed)
    [row] = run_query(kept(store, both, both), "incidents").to_pylist()
    assert row["alternatives"] is None


def test_a_page_says_what_was_held_before_where_it_says_a_ratio_beside_shares(store, tmp_path):
    kept(store, *[of_event("1", 1, posterior=0.9, log10_ratio=2.3, alternatives=(Alternative((), 1.0),))] * 3)
    [row] = run_query(store, "incidents").to_pylist()
    page = render_incident_page(store, row["incident_id"], out=tmp_path / "page.html").read_text()
    assert "How much it weighs" in page
    assert f"Each further sensor is held {LIKELIHOOD.further_sensor:g} times as likely." in page


def test_checks_that_say_the_same_of_one_sensor_are_one_line():
    def says(check, score):
        return Evidence(check, 0, None, None, score)._asdict()

    [line] = evidence_lines(
        [[says("free_space_conflict", 5.0), says("surrounding_conflict", 7.0)], [says("surrounding_conflict", 9.0)]]
    )
    assert (line.sensor, line.frames, line.mean, line.largest) == (0, 2, 8.0, 9.0)
    assert line.found == "has points where its beams passed a moment ago"


def test_the_largest_z_is_of_the_checks_that_count():
    by_both = SensorCheck(Check.ADDED_LIGHT, 1, (2, 3))
    by_two = SensorCheck(Check.ADDED_LIGHT, 1, (2,))
    other = SensorCheck(Check.REMOVED_LIGHT, 1, (2, 3))
    z = np.array([[1.0, 9.0, 2.0], [NAN, 9.0, NAN], [1.0, 9.0, 2.0]])
    missing = [frozenset(), frozenset(), frozenset({3})]
    scores = sensor_scores(z, (by_both, by_two, other), (0, 1, 2, 3), missing)
    assert np.array_equal(
        scores, [[NAN, 2, NAN, NAN], [NAN, NAN, NAN, NAN], [NAN, 9, 9, NAN]], equal_nan=True
    )  # one voter that is left speaks of both


def test_a_curve_shows_what_the_evidence_of_a_frame_says_where_that_is_more():
    scores = np.array([[1.0, np.nan, 2.0], [1.0, 5.0, 2.0]])
    evidence = [
        [{"i": 1, "k": None, "check_name": "unmatched_light", "score": 9.0}],
        [{"i": 1, "k": None, "check_name": "added_light", "score": 4.0}],
    ]
    np.testing.assert_array_equal(with_evidence(scores, evidence, (0, 1, 2)), [[1, 9, 2], [1, 5, 2]])


def test_a_check_of_several_views_counts_once_a_frame():
    def found(check, i, score, k=None):
        return Evidence(check, i, None, k, score)._asdict()

    lines = evidence_lines(
        [
            [found("point_dropout", 0, 4.0), found("point_dropout", 0, 6.0), found("added_light", 1, 5.0)],
            [found("point_dropout", 0, 8.0), found("lidar_conflict", 0, 3.5)],
        ]
    )
    assert [(line.check, line.sensor, line.frames, line.mean, line.largest) for line in lines] == [
        ("point_dropout", 0, 2, 7.0, 8.0),
        ("lidar_conflict", 0, 1, 3.5, 3.5),
        ("added_light", 1, 1, 5.0, 5.0),
    ]
