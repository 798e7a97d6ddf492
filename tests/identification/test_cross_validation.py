from dataclasses import replace
from decimal import Decimal

import numpy as np
import pytest

from auditor.errors import ThresholdsError
from auditor.identification.cross_validation import (
    clean_hours,
    hours_of,
    leave_one_out_paper,
    leave_one_out_robust,
    left_out_scores,
    robust_thresholds,
    score_threshold,
    wilson,
)
from auditor.identification.naming import System
from auditor.model.calibration import Calibration, CleanFrames
from auditor.model.checks import Check, pair_checks_of
from auditor.model.measurement import Procedure, Statistic
from auditor.model.rig import Triple, triples_of
from auditor.model.rig_kind import RigKind
from auditor.model.verdict import Cause

PAIRS = ((1, 3), (2, 3))
PAIR_CHECKS = pair_checks_of(3, PAIRS, PAIRS, (3,))
SYSTEM = System(PAIR_CHECKS, triples_of(3, lidar=True), (0, 1, 2, 3))
THREE = System(pair_checks_of(2, ((1, 2),), ((1, 2),), (2,)), triples_of(2, lidar=True), (0, 1, 2))
KIND = RigKind(lidar=True, sizes_px=((1242, 375),) * 3, focals_px=(721.5,) * 3, baselines_m=(0.07, 0.53))
R = Decimal("0.01")
PERIOD_NS = 100_000_000


def recording(name, frames=20, lidar_conflicts=(), late=(), E=0.1, system=SYSTEM):
    """Quiet frames, in some of which every pair has a LiDAR conflict and E is 0.3, or S_1 lags."""
    hit = np.isin(np.arange(frames), lidar_conflicts)
    return CleanFrames(
        name,
        np.arange(frames, dtype=np.int64) * PERIOD_NS,
        {(Statistic.GATED, t): np.where(hit, 0.3, E) for t in system.triples},
        {e: np.where(hit & (e.check is Check.LIDAR_CONFLICT), 0.9, 0.0) for e in system.pair_checks},
        {(Cause.LATE, 1): np.where(np.isin(np.arange(frames), late), 2.0, -5.0)},
    )


def calibration(*clean):
    return Calibration("c" * 32, KIND, Procedure("sgbm", "{}"), clean)


def counts(results):
    return [(one.recording, one.frames, one.findings, one.incidents) for one in results]


def test_each_recording_is_judged_by_the_others_alone():
    both = calibration(recording("easy"), recording("hard", 30, lidar_conflicts=(3, 4, 5, 6, 20)))
    assert counts(leave_one_out_robust(both, SYSTEM, R)) == [("easy", 20, 0, 0), ("hard", 30, 5, 1)]
    assert counts(leave_one_out_paper(both, Statistic.GATED, R)) == [("easy", 20, 0, 0), ("hard", 30, 5, 2)]
    # A ceiling keeps attacked frames among the clean ones from silencing a check; nothing does for E.
    twice = calibration(
        recording("hard", 30, lidar_conflicts=range(15)), recording("as hard", 30, lidar_conflicts=range(15))
    )
    assert [one.findings for one in leave_one_out_robust(twice, SYSTEM, R)] == [15, 15]
    assert [one.findings for one in leave_one_out_paper(twice, Statistic.GATED, R)] == [0, 0]


def test_a_fault_in_clean_frames_is_a_false_alarm_unless_others_show_it_too():
    hard, easy = recording("hard", late=range(5, 8)), recording("easy")
    assert counts(leave_one_out_robust(calibration(easy, hard), SYSTEM, R)) == [("easy", 20, 0, 0), ("hard", 20, 3, 1)]
    both = calibration(hard, recording("as hard", late=range(2)))
    assert [one.findings for one in leave_one_out_robust(both, SYSTEM, R)] == [0, 0]


def test_an_incident_may_begin_with_the_first_frame_and_lie_a_little_above_theta():
    barely = recording("barely", lidar_conflicts=(0, 1, 2, 10, 11, 12, 13, 14))
    barely = replace(barely, ratios={e: np.where(x > 0, 0.55, 0.0) for e, x in barely.ratios.items()})
    found = leave_one_out_robust(calibration(recording("easy"), barely), SYSTEM, R)
    assert counts(found) == [("easy", 20, 0, 0), ("barely", 20, 8, 2)]
    assert [one.hours for one in found] == pytest.approx([20 / 36_000] * 2)


def test_only_faults_are_false_alarms_by_themselves_and_only_from_their_threshold_on():
    easy = recording("easy")
    for cause, score, findings in ((Cause.LATE, 0.99, 0), (Cause.LATE, 1.0, 20), (Cause.DARK, 2.0, 0)):
        key = (cause, None if cause is Cause.DARK else 1)
        left_out = replace(recording("left out"), strengths={key: np.full(20, score)})
        other = replace(easy, strengths={key: np.zeros(20), (Cause.FROZEN, 2): np.zeros(20)})
        assert [one.findings for one in leave_one_out_robust(calibration(other, left_out), SYSTEM, R)] == [0, findings]


def test_left_out_scores_are_those_of_temporal_windows_recording_by_recording():
    hard = recording("hard", lidar_conflicts=(10,))
    scores = left_out_scores(calibration(recording("easy"), hard), SYSTEM, R)
    assert np.flatnonzero(scores == -np.inf).tolist() == [20, 41]
    assert (scores[:20] < 0).all()
    alone = left_out_scores(calibration(recording("easy"), recording("hard", lidar_conflicts=range(20))), SYSTEM, R)
    assert scores[21 + 10] < 0 < alone[21 + 10]
    assert left_out_scores(calibration(), SYSTEM, R).tolist() == [-np.inf]


def test_three_sensors_have_false_alarms_too():
    both = calibration(recording("easy", system=THREE), recording("hard", lidar_conflicts=range(4, 10), system=THREE))
    assert [one.findings for one in leave_one_out_robust(both, THREE, R)] == [0, 6]


def test_one_recording_alone_cannot_be_left_out():
    assert leave_one_out_robust(calibration(recording("only")), SYSTEM, R) == []
    twice = calibration(recording("only"), recording("only"))
    assert leave_one_out_paper(twice, Statistic.GATED, R) == []


def test_allowed_incidents_set_the_score_s_threshold():
    hard = recording("hard", 36_000, lidar_conflicts=range(100, 110))
    clean = calibration(recording("easy", 36_000), hard)
    assert robust_thresholds(clean, SYSTEM, R).score == 0.0
    assert robust_thresholds(clean, SYSTEM, R, incidents_per_hour=0.5).score == 0.0
    strict = robust_thresholds(clean, SYSTEM, R, incidents_per_hour=0)
    assert strict.score == pytest.approx(left_out_scores(clean, SYSTEM, R).max())
    assert strict.score > 1
    assert strict.incidents_per_hour == 0


def test_one_pair_check_with_too_few_samples_makes_a_rate_unresolvable():
    many = recording("many", 200)
    first, *others = PAIR_CHECKS
    few = {first: np.where(np.arange(200) < 50, 0.1, np.nan)} | {e: many.ratios[e] for e in others}
    assert robust_thresholds(calibration(many), SYSTEM, R).resolvable
    found = robust_thresholds(calibration(replace(many, ratios=few)), SYSTEM, R)
    assert not found.resolvable
    assert found.scales_of[first].samples == 50
    assert (found.r, found.transferred) == (R, False)


def test_what_no_clean_frame_has_measured_has_no_scale():
    quiet = recording("quiet")
    known = {PAIR_CHECKS[0]: quiet.ratios[PAIR_CHECKS[0]]}
    found = robust_thresholds(calibration(replace(quiet, ratios=known)), SYSTEM, R, transferred=True)
    assert set(found.scales_of) == {PAIR_CHECKS[0]}
    assert found.transferred
    with pytest.raises(ThresholdsError, match="no clean statistics"):
        robust_thresholds(calibration(replace(quiet, ratios={})), SYSTEM, R)


def test_the_hours_of_a_calibration_are_those_of_its_recordings():
    both = calibration(recording("a", 3600), recording("b", 1800))
    assert clean_hours(both) == pytest.approx(0.15)


def test_the_score_s_threshold_allows_so_many_incidents_and_no_more():
    scores = np.array([-1, 0.2, 0.3, -1, 0.5, -1, 0.1, 0.9, -1])
    assert score_threshold(scores, hours=1.0, incidents_per_hour=3) == 0.0
    assert score_threshold(scores, hours=1.0, incidents_per_hour=2) == 0.3
    assert score_threshold(scores, hours=0.5, incidents_per_hour=2) == 0.5
    assert score_threshold(scores, hours=1.0, incidents_per_hour=0) == 0.9


def test_a_longer_incident_counts_once_even_where_a_higher_threshold_splits_it():
    scores = np.array([0.5, 0.1, 0.5])
    assert score_threshold(scores, hours=1.0, incidents_per_hour=1) == 0.0


def test_frames_in_which_no_check_fires_need_no_threshold():
    assert score_threshold(np.full(5, -0.02), hours=1.0, incidents_per_hour=0) == 0.0


def test_frames_stand_for_their_number_times_the_usual_step():
    stamps = np.array([0, 1, 2, 3, 50], dtype=np.int64) * 3600 * 10**9
    assert hours_of(stamps) == 5.0
    assert hours_of(stamps[:1]) == 0.0


def test_wilsons_interval():
    assert wilson(3, 8) == pytest.approx((0.136844, 0.694257), abs=1e-6)
    assert wilson(0, 10) == pytest.approx((0, 0.277533), abs=1e-6)
    assert wilson(0, 0) == (0, 1)


def test_the_fallback_of_a_left_out_recording_counts_where_no_other_triple_was_measured():
    fallback = Triple(0, 1, 2)
    high = {(Statistic.GATED, fallback): np.full(20, 0.3)}
    easy, left_out = recording("easy"), recording("high")
    easy = replace(easy, errors={**easy.errors, (Statistic.GATED, fallback): np.full(20, 0.1)})
    measured = calibration(easy, replace(left_out, errors={**left_out.errors, **high}))
    assert counts(leave_one_out_paper(measured, Statistic.GATED, R)) == [("easy", 20, 0, 0), ("high", 20, 0, 0)]
    lost = {key: np.where(np.arange(20) < 15, E, np.nan) for key, E in left_out.errors.items()}
    in_five = calibration(easy, replace(left_out, errors={**high, **lost}))
    assert counts(leave_one_out_paper(in_five, Statistic.GATED, R)) == [("easy", 20, 0, 0), ("high", 20, 5, 1)]
