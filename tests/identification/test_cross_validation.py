from dataclasses import replace
from decimal import Decimal

import numpy as np
import pytest

from auditor.identification import cross_validation
from auditor.identification.cross_validation import (
    CleanErrors,
    ErrorsOfOthers,
    clean_hours,
    count_incidents,
    hours_of,
    left_out_peaks,
    robust_thresholds,
    wilson,
)
from auditor.identification.incidents.sequential import incident_limit
from auditor.identification.prior import prior_of_check, statistic_at
from auditor.identification.systems import System
from auditor.model.calibration import Calibration, CleanFrames
from auditor.model.checks import Check, sensor_checks_of
from auditor.model.measurement import Procedure, Statistic
from auditor.model.rig import Triple, triples_of
from auditor.model.rig_kind import RigKind
from auditor.model.verdict import Cause, Finding, VerdictKind
from tests.making import left_out
from tests.making.left_out import leave_one_out_paper, leave_one_out_robust

PAIRS = ((1, 2), (1, 3), (2, 3))
SENSOR_CHECKS = sensor_checks_of(PAIRS, PAIRS, (3,))
SYSTEM = System(SENSOR_CHECKS, triples_of(3, lidar=True), (0, 1, 2, 3))
THREE = System(sensor_checks_of(((1, 2),), ((1, 2),), (2,)), triples_of(2, lidar=True), (0, 1, 2))
KIND = RigKind(lidar=True, sizes_px=((1242, 375),) * 3, focals_px=(721.5,) * 3, baselines_m=(0.07, 0.53))
R = Decimal("0.01")
PERIOD_NS = 100_000_000


def recording(name, frames=20, lidar_conflicts=(), late=(), E=0.1, system=SYSTEM, conflict=0.9):
    """Frames as the prior expects them, in some of which the LiDAR is in conflict and E is 0.3, or S_1 lags."""
    hit = np.isin(np.arange(frames), lidar_conflicts)
    return CleanFrames(
        name,
        np.arange(frames, dtype=np.int64) * PERIOD_NS,
        {(Statistic.GATED, t): np.where(hit, 0.3, E) for t in system.triples},
        {
            one: np.where(hit & (one.check is Check.LIDAR_CONFLICT), conflict, statistic_at(prior_of_check(one).mean))
            for one in system.sensor_checks
        },
        {(Cause.LATE, 1): np.where(np.isin(np.arange(frames), late), 2.0, -6.0)},
    )


def calibration(*clean):
    return Calibration("c" * 32, KIND, Procedure("sgbm", "{}"), clean)


def counts(results):
    return [(one.recording, one.frames, one.findings, one.incidents) for one in results]


def test_each_recording_is_judged_by_the_others_alone():
    both = calibration(recording("easy"), recording("hard", 30, lidar_conflicts=(3, 4, 5, 6, 20)))
    assert counts(leave_one_out_robust(both, SYSTEM, R)) == [("easy", 20, 0, 0), ("hard", 30, 5, 1)]
    assert counts(leave_one_out_paper(both, Statistic.GATED, R)) == [("easy", 20, 0, 0), ("hard", 30, 5, 2)]


def test_errors_of_recordings_that_were_taken_apart_are_those_that_were_taken_together():
    together, first, second = (CleanErrors(Statistic.GATED, many=100) for _ in range(3))
    for place, name in enumerate("abcd"):
        one = recording(name, E=0.1 + 0.1 * place)
        together.add(one)
        (first if place < 2 else second).add(one)
    first.join(second)
    whole, joined = (ErrorsOfOthers(errors, R) for errors in (together, first))
    for name, theta in (("a", 0.4), ("d", 0.3)):
        assert joined.of(name) == whole.of(name) == dict.fromkeys(SYSTEM.triples, pytest.approx(theta))


def test_conflicts_in_a_fifth_of_the_other_recordings_frames_excuse_the_paper_s_and_not_the_robust_method_s():
    twice = calibration(
        recording("hard", 30, lidar_conflicts=range(6), conflict=0.99),
        recording("as hard", 30, lidar_conflicts=range(6), conflict=0.99),
    )
    assert [one.findings for one in leave_one_out_robust(twice, SYSTEM, R)] == [6, 6]
    assert [one.findings for one in leave_one_out_paper(twice, Statistic.GATED, R)] == [0, 0]


def test_a_fault_in_clean_frames_is_a_false_alarm():
    hard, easy = recording("hard", late=range(5, 15)), recording("easy")
    assert counts(leave_one_out_robust(calibration(easy, hard), SYSTEM, R)) == [("easy", 20, 0, 0), ("hard", 20, 10, 1)]


def test_an_incident_may_begin_with_the_first_frame():
    early = recording("early", 40, lidar_conflicts=(0, 1, 2, 3, 20, 21, 22, 23))
    found = leave_one_out_robust(calibration(recording("easy"), early), SYSTEM, R)
    assert counts(found) == [("easy", 20, 0, 0), ("early", 40, 8, 2)]
    assert [one.hours for one in found] == pytest.approx([20 / 36_000, 40 / 36_000])


def test_only_faults_are_false_alarms_by_themselves_and_only_from_their_threshold_on():
    easy = recording("easy")
    for cause, score, findings in ((Cause.LATE, 0.99, 0), (Cause.LATE, 1.0, 20), (Cause.DARK, 2.0, 0)):
        key = (cause, None if cause is Cause.DARK else 1)
        left_out = replace(recording("left out"), strengths={key: np.full(20, score)})
        other = replace(easy, strengths={key: np.full(20, -6.0), (Cause.FROZEN, 2): np.zeros(20)})
        found = [one.findings for one in leave_one_out_robust(calibration(other, left_out), SYSTEM, R)]
        assert found == [0, findings]


def test_left_out_peaks_are_those_of_each_recording_by_the_others():
    hard = recording("hard", lidar_conflicts=range(8, 14))
    assert left_out_peaks(calibration(recording("easy")), SYSTEM, R) == []
    [peak] = left_out_peaks(calibration(recording("easy"), hard), SYSTEM, R)
    assert peak > robust_thresholds(calibration(), SYSTEM, R).evidence_limit
    assert left_out_peaks(calibration(), SYSTEM, R) == []


def test_three_sensors_have_false_alarms_too():
    both = calibration(recording("easy", system=THREE), recording("hard", lidar_conflicts=range(4, 10), system=THREE))
    assert [one.findings for one in leave_one_out_robust(both, THREE, R)] == [0, 6]


def test_of_many_recordings_some_are_left_out_together_so_that_thresholds_are_made_seldom(monkeypatch):
    made = []

    class Counted(left_out.CleanDrives):
        def thresholds(self, *arguments, used=None, **more):
            made.append(used.tolist())
            return super().thresholds(*arguments, used=used, **more)

    hard = recording("d", lidar_conflicts=range(8, 14))
    drives = calibration(*map(recording, "abc"), hard)
    alone = counts(leave_one_out_robust(drives, SYSTEM, R))
    monkeypatch.setattr(left_out, "CleanDrives", Counted)
    monkeypatch.setattr(cross_validation, "MOST_GROUPS", 2)
    together = counts(leave_one_out_robust(drives, SYSTEM, R))
    assert made == [[False, False, True, True], [True, True, False, False]]
    assert together == alone == [*((name, 20, 0, 0) for name in "abc"), ("d", 20, 6, 1)]


def test_one_recording_alone_is_judged_by_the_prior():
    assert counts(leave_one_out_robust(calibration(recording("only")), SYSTEM, R)) == [("only", 20, 0, 0)]
    twice = calibration(recording("only"), recording("only"))
    assert leave_one_out_paper(twice, Statistic.GATED, R) == []


def test_allowed_incidents_and_clean_recordings_set_the_limit_of_incidents():
    hard = recording("hard", 3_600, lidar_conflicts=[*range(100, 110), *range(1000, 1010)])
    clean = calibration(recording("easy", 3_600), hard)
    usual = robust_thresholds(clean, SYSTEM, R)
    assert (usual.evidence_limit, usual.incidents_per_hour) == (incident_limit(), None)
    limits = [robust_thresholds(clean, SYSTEM, R, incidents_per_hour=rate) for rate in (10, 1, 0)]
    peaks = left_out_peaks(clean, SYSTEM, R)
    expected = [incident_limit(rate, peaks, clean_hours(clean)) for rate in (10, 1, 0)]
    assert [one.evidence_limit for one in limits] == expected
    assert usual.evidence_limit < limits[1].evidence_limit < limits[2].evidence_limit
    assert limits[2].incidents_per_hour == 0


def test_of_what_no_clean_frame_has_measured_the_prior_is_expected():
    quiet = recording("quiet")
    known = {SENSOR_CHECKS[0]: quiet.statistics[SENSOR_CHECKS[0]]}
    found = robust_thresholds(calibration(replace(quiet, statistics=known)), SYSTEM, R, transferred=True)
    assert set(found.expected) == set(SENSOR_CHECKS)
    assert [one.drives for one in found.expected.values()] == [1] + [0] * (len(SENSOR_CHECKS) - 1)
    assert (found.r, found.transferred, found.drives) == (R, True, 1)
    prior = robust_thresholds(calibration(), SYSTEM, R)
    assert (prior.drives, prior.limit) == (0, found.limit)


def test_the_hours_of_a_calibration_are_those_of_its_recordings():
    both = calibration(recording("a", 3600), recording("b", 1800))
    assert clean_hours(both) == pytest.approx(0.15)


def finding(event, attacked=(1,), *, alert=False):
    return Finding(VerdictKind.ATTACKED, attacked, event, alert)


def test_one_event_is_one_incident_and_an_alert_none():
    stamps = np.arange(8, dtype=np.int64) * 10**9
    findings = [finding(1), None, finding(1), finding(2), None, finding(3, alert=True), finding(4, (2,)), None]
    assert count_incidents(findings, stamps) == 3


def test_events_of_one_set_that_are_hardly_apart_are_one_incident():
    at = np.array([0, 100, 600, 700], dtype=np.int64) * 10**6
    assert count_incidents([finding(1), finding(1), finding(2), finding(2)], at) == 1
    assert count_incidents([finding(1), finding(1), finding(2, (2,)), finding(2, (2,))], at) == 2
    later = np.array([0, 0, 1, 1], dtype=np.int64)
    assert count_incidents([finding(1), finding(1), finding(2), finding(2)], at + 10**6 * later) == 2
    assert count_incidents([finding(1), finding(1), finding(2), finding(2)], at - 10**9 * later) == 2


def test_frames_stand_for_their_number_times_the_usual_step():
    stamps = np.array([0, 1, 2, 3, 50], dtype=np.int64) * 3600 * 10**9
    assert hours_of(stamps) == 5.0
    assert hours_of(stamps[:1]) == 0.0


def test_wilsons_interval():
    assert wilson(3, 8) == pytest.approx((0.136844, 0.694257), abs=1e-6)
    assert wilson(0, 10) == pytest.approx((0, 0.277533), abs=1e-6)
    assert all(wilson(0, n)[0] == 0 and wilson(n, n)[1] == 1 for n in range(1, 200))
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
