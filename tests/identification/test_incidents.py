"""The sequential test: evidence of frames, excursions from zero, events, and the limit."""

import numpy as np
import pytest

from auditor.identification.evidence_parameters import INCIDENTS
from auditor.identification.incidents.sequential import (
    QUIET_FRAMES,
    Event,
    FrameEvidence,
    apart,
    events,
    evidence_of,
    excursions,
    frame_worth,
    incident_limit,
    log_ratios,
    of_sensors,
    peaks_of,
    periods_of,
    strong_frames,
)
from auditor.identification.parameters import SCORE_LIMITS
from auditor.identification.prior import joint_limit
from auditor.identification.statistics import runs_of

CHECKS = 25
LIMIT = joint_limit(INCIDENTS.tail_rate, CHECKS)
CLEAN, RAISED, STRONG = LIMIT - 2, LIMIT + 0.6, LIMIT + 4


def stamps_at(hz, frames):
    return (np.arange(frames) * (10**9 / hz)).astype(np.int64)


def pace(stamps):
    runs = runs_of(stamps)
    return periods_of(stamps, runs), runs


def evidence_at(hz, scores):
    stamps = stamps_at(hz, len(scores))
    return evidence_of(np.asarray(scores, dtype=np.float64), CHECKS, *pace(stamps))


def found(hz, scores, limit=None):
    scores = np.asarray(scores, dtype=np.float64)
    return events(evidence_at(hz, scores), scores > LIMIT, incident_limit() if limit is None else limit)


def strong(hz, scores):
    scores = np.asarray(scores, dtype=np.float64)
    return np.flatnonzero(strong_frames(evidence_at(hz, scores), scores > LIMIT, None)).tolist()


def added(*values, runs=None, period=1.0, of_each=None, unexplained=None, worth=1.0):
    """Evidence that adds these values, at one frame a second."""
    frames = len(values)
    runs = np.zeros(frames, dtype=np.int64) if runs is None else np.array(runs)
    of_sensor = values if of_each is None else of_each
    of_no_fault = of_sensor if unexplained is None else unexplained
    parts = (np.array(part, dtype=np.float64).reshape(frames, -1) for part in (of_sensor, of_no_fault))
    values = np.array(values, dtype=np.float64)
    return FrameEvidence(values, *parts, np.zeros(frames), np.full(frames, worth), runs, np.full(frames, period))


def parts_of(evidence):
    """The excursions, where all frames are findings."""
    return list(excursions(evidence, np.ones(len(evidence.added), dtype=np.bool_)))


def test_the_ratio_compares_a_flat_density_with_the_tail_of_clean_frames():
    scores = np.array([LIMIT, LIMIT + 1, -np.inf, np.nan])
    ratios = log_ratios(scores, CHECKS)
    clean = INCIDENTS.tail_slope * INCIDENTS.tail_rate
    assert ratios[0] == pytest.approx(np.log(1 / SCORE_LIMITS.highest / clean))
    assert ratios[1] - ratios[0] == pytest.approx(INCIDENTS.tail_slope)
    assert np.isnan(ratios[2:]).all()


def test_a_frame_adds_a_bounded_share_and_one_without_measurements_nothing():
    at = evidence_at(0.5, [CLEAN - 2, RAISED, STRONG, SCORE_LIMITS.highest, -np.inf]).added
    assert at[0] == pytest.approx(np.log(1 - INCIDENTS.duty), rel=0.05)
    assert at[0] < 0 < at[1] < at[2] == pytest.approx(at[3])
    assert at[4] == 0


@pytest.mark.parametrize(("hz", "a_second"), [(0.5, 0.5), (1, 0.94), (2, 1.6), (5, 2.5), (10, 3.0), (20, 3.3)])
def test_a_second_is_worth_no_more_frames_the_faster_they_come(hz, a_second):
    assert hz * frame_worth(np.array([1 / hz]))[0] == pytest.approx(a_second, rel=0.03)


def test_a_frame_whose_rate_is_not_known_is_worth_one():
    assert frame_worth(np.array([np.nan])).tolist() == [1.0]
    assert evidence_at(10, [STRONG]).added[0] > evidence_at(10, [STRONG] * 2).added[0]


def test_an_excursion_goes_from_zero_to_zero_and_lists_its_rises():
    one, other = parts_of(added(-1, 2, -1, 3, -1, -1, -1, -1, 1, -2))
    assert (one.rises, one.peak) == ((1, 3), 4.0)
    assert (other.rises, other.peak) == ((8,), 0.0), "one finding is not enough"


def test_an_excursion_ends_where_the_sum_has_not_risen_for_some_time_however_high_it_is():
    quiet = [-0.01] * QUIET_FRAMES
    assert [one.rises for one in parts_of(added(9, *quiet, 9))] == [(0, 6)]
    assert [one.rises for one in parts_of(added(9, *quiet, -0.01, 9))] == [(0,), (7,)]
    long = round(INCIDENTS.quiet_s / 0.1)
    assert [one.rises for one in parts_of(added(9, *[-0.01] * long, 9, period=0.1))] == [(0, long + 1)]
    assert [one.rises for one in parts_of(added(9, *[-0.01] * (long + 1), 9, period=0.1))] == [(0,), (long + 2,)]


def test_the_sum_begins_anew_after_a_gap():
    assert [one.peak for one in parts_of(added(2, 2, 3, 3, runs=[0, 0, 1, 1]))] == [4.0, 6.0]


def test_what_a_fault_explains_counts_for_a_share_and_what_nothing_explains_for_all():
    def peak(*explained):
        own = [-1, *(0 if one else 2 for one in explained)]
        return parts_of(added(-1, 2, 2, 2, 2, unexplained=own))[0].peak

    share = INCIDENTS.explained_share
    assert peak(False, False, False, False) == 8
    assert peak(True, False, False, False) == 6
    assert peak(True, True, True, True) == pytest.approx(8 * share)
    assert peak(False, False, True, True) == 4 > 8 * share
    assert peak(False, True, True, True) == pytest.approx(8 * share), "one finding that nothing explains is not enough"


def test_quiet_frames_between_lower_the_sum_that_no_fault_explains_but_never_below_zero():
    [one] = parts_of(added(2, 2, -1, 2, 2, unexplained=[0, 0, -1, 2, 2]))
    assert one.peak == pytest.approx(4)


def test_an_excursion_goes_as_far_as_all_evidence_and_its_peak_is_of_one_sensor():
    (one,) = parts_of(added(2, 2, 2, -1, 2, of_each=[2, -1, -1, -1, 1.5]))
    assert (one.rises, one.peak) == ((0, 1, 2, 4), 2.0)
    (one,) = parts_of(added(2, 2, 2, of_each=[2, 2, 2], unexplained=[0, 0, 0]))
    assert one.peak == pytest.approx(6 * INCIDENTS.explained_share)
    (one,) = parts_of(added(2, 2, 2, of_each=[2, -0.5, 1], unexplained=[0, 0, 0]))
    assert one.peak == pytest.approx(2.5 * INCIDENTS.explained_share)


def test_the_peak_is_of_evidence_of_one_and_the_same_sensor():
    (one,) = parts_of(added(2, 2, 2, of_each=[[2, -1], [-1, 2], [2, -1]]))
    assert (one.rises, one.peak) == ((0, 1, 2), 3.0)


def test_a_frame_with_a_little_evidence_apart_from_an_incident_is_no_part_of_it():
    raised = np.array([False, False, True, True, True, False, False, False, False])
    assert events(added(1, -0.2, 9, 9, 9, 1, -0.2, -0.2, 1), raised, 1.0) == [Event((2, 3, 4, 5))]
    raised[0] = True
    assert events(added(1, -0.2, 9, 9, 9, 1, -0.2, -0.2, 1), raised, 1.0) == [Event((0, 2, 3, 4, 5))]


def test_a_lone_finding_far_from_the_others_is_no_end_of_an_incident():
    def frames(*findings):
        values = [9.0 if place in findings else -0.1 for place in range(40)]
        raised = np.array([place in findings for place in range(40)])
        return [one.frames for one in events(added(*values, period=0.1), raised, 1.0)]

    assert frames(2, 9, 10, 11, 19) == [(9, 10, 11)]
    assert frames(4, 9, 10, 11, 17) == [(4, 9, 10, 11)], "half a second is not far"
    assert frames(2, 9, 16, 23) == [(2, 9, 16, 23)], "where all are far apart it is a strobe"


def test_findings_of_other_sensors_make_no_incident_of_one():
    raised = np.ones(4, dtype=np.bool_)
    in_turn = [[9, -1], [9, -1], [-1, 9], [-1, 9]]
    assert events(added(9, 9, 9, 9, of_each=in_turn, worth=0.3), raised, 1.0) == []
    one_more = [[9, -1], [9, -1], [-1, 9], [9, -1]]
    assert events(added(9, 9, 9, 9, of_each=one_more, worth=0.3), raised, 1.0) == [Event((0, 1, 2, 3))]


def test_flashes_on_another_sensor_hide_no_incident_however_strong_they_are():
    raised = np.ones(5, dtype=np.bool_)
    beside = [[2, -1], [2, 9], [2, 9], [2, -1], [2, -1]]
    assert events(added(2, 9, 9, 2, 2, of_each=beside, worth=0.3), raised, 1.0) == [Event((0, 1, 2, 3, 4))]
    [one] = parts_of(added(2, 9, 9, 2, 2, of_each=beside, worth=0.3))
    assert one.peak == 10.0, "of the five frames of the first, not of the two of the second"


def test_each_sensor_adds_what_its_own_score_says():
    scores, stamps = np.array([RAISED, RAISED, CLEAN]), stamps_at(10, 3)
    own, explained = np.array([[RAISED], [CLEAN], [CLEAN]]), np.zeros(3, dtype=np.bool_)
    found = of_sensors(evidence_of(scores, CHECKS, *pace(stamps)), own, explained, CHECKS)
    assert found.of_each[0] == found.added[0] > 0
    assert found.of_each[1] < 0 < found.added[1]
    assert found.unexplained.tolist() == found.of_each.tolist()


def test_what_a_fault_explains_adds_to_the_evidence_of_a_fault_only():
    scores, stamps = np.array([STRONG, STRONG, CLEAN]), stamps_at(10, 3)
    explained = np.array([True, False, False])
    whole = evidence_of(scores, CHECKS, *pace(stamps))
    found = of_sensors(whole, scores[:, None], explained, CHECKS)
    assert found.unexplained.ravel().tolist() == [0.0, *found.added[1:].tolist()]
    assert found.added.tolist() == whole.unexplained.ravel().tolist()


def test_an_incident_needs_findings_worth_most_of_an_independent_frame_and_two_at_least():
    strong = [9.0] * 4
    raised = np.array([True, True, True, False])
    assert peaks_of(added(*strong, worth=0.3), raised) == [36.0]
    assert peaks_of(added(*strong, worth=0.2), raised) == []
    assert peaks_of(added(*strong), raised & [True, False, False, False]) == []
    assert events(added(*strong, worth=0.3), raised, 1.0) == [Event((0, 1, 2, 3))]
    assert events(added(*strong, worth=0.2), raised, 1.0) == []


@pytest.mark.parametrize("hz", [0.5, 1, 2, 5, 10, 20])
@pytest.mark.parametrize("every", [3, 5])
def test_a_strobe_is_one_incident_at_any_rate(hz, every):
    scores = np.full(200, CLEAN)
    scores[50:150:every] = STRONG
    assert found(hz, scores) == [Event(tuple(range(50, 150, every)))]


@pytest.mark.parametrize("hz", [0.5, 1, 2, 5, 10, 20])
def test_one_strong_frame_is_told_and_is_no_incident(hz):
    scores = np.full(60, CLEAN)
    scores[30] = STRONG
    assert (found(hz, scores), strong(hz, scores)) == ([], [30])
    scores[30] = RAISED
    assert (found(hz, scores), strong(hz, scores)) == ([], [])


def test_parts_that_differ_by_frames_of_doubt_are_one_incident():
    scores = [CLEAN] * 10 + [STRONG] * 5 + [CLEAN] * 4 + [STRONG] * 5 + [CLEAN] * 10
    assert found(10, scores) == [Event((*range(10, 15), *range(19, 24)))]


def test_an_attack_that_follows_on_another_sensor_is_an_incident_of_its_own():
    def parts(*named, limit=2.5):
        return [one.frames for one in apart(Event(tuple(range(len(named)))), named, [1.0] * len(named), limit)]

    camera, lidar, both, nothing = (2,), (0,), (0, 2), ()
    followed = [camera, camera, nothing, camera, lidar, nothing, lidar, lidar]
    assert parts(*followed) == [(0, 1, 2, 3), (4, 5, 6, 7)]
    assert len(parts(*followed, limit=3.0)) == 1, "too little evidence for either"
    assert len(parts(camera, lidar, camera, lidar, camera, lidar)) == 1, "they alternate"
    assert len(parts(camera, camera, camera, both, both, both)) == 1, "a sensor more is the same attack"
    assert len(parts(camera, camera, camera, lidar, camera)) == 1, "a frame of doubt"


def test_a_ramp_is_one_incident_that_begins_before_its_first_raised_frame():
    scores = [CLEAN] * 20 + np.linspace(CLEAN, STRONG, 20).tolist() + [STRONG] * 10
    [event] = found(10, scores)
    first_raised = next(place for place, score in enumerate(scores) if score > LIMIT)
    assert first_raised - 3 <= event.frames[0] < first_raised
    assert event.frames[-1] == len(scores) - 1


def test_frames_that_are_no_findings_by_themselves_make_no_incident():
    scores = np.full(300, LIMIT - 0.05)
    assert max(one.peak for one in parts_of(evidence_at(10, scores))) > incident_limit()
    assert found(10, scores) == []
    scores[:3] = LIMIT + 0.05
    assert len(found(10, scores)) == 1


def test_the_fewer_false_incidents_are_allowed_the_higher_is_the_limit():
    limits = [incident_limit(per_hour) for per_hour in (1000, 10, 2, 1, 0.1, 0.01, 0)]
    assert limits == sorted(limits)
    assert limits[0] == INCIDENTS.peaks_from
    assert limits[-1] == limits[-2], "fewer than anybody could show are taken for so many"
    assert incident_limit() == incident_limit(INCIDENTS.per_hour)


def test_clean_peaks_raise_the_limit_and_clean_hours_lower_it():
    prior = incident_limit(1)
    assert incident_limit(1, hours=1.0) < prior
    assert incident_limit(1, [2.0] * 50, hours=1.0) > prior
    assert incident_limit(1, [0.1] * 50, hours=1.0) == incident_limit(1, hours=1.0), "small peaks say nothing"


def test_clean_frames_as_the_ratio_takes_them_have_no_more_incidents_than_allowed():
    """Independent frames at 1 Hz whose largest z has the tail that the ratio assumes."""
    hours = 60
    shares = np.random.default_rng(3).random(hours * 3600)
    scores = LIMIT - np.log(shares / INCIDENTS.tail_rate) / INCIDENTS.tail_slope
    for per_hour in (2, 0.5):
        count = len(found(1, scores, incident_limit(per_hour)))
        allowed = per_hour * hours
        assert count <= allowed + 2 * np.sqrt(allowed), count
