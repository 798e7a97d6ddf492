from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from auditor.errors import SettingError
from auditor.identification import scores
from auditor.identification.drive_level import for_drive
from auditor.identification.incidents.sequential import incident_limit
from auditor.identification.parameters import FAULT_SCALE, StandsOut
from auditor.identification.prior import expected, joint_limit, log_odds, prior_of_cause, prior_of_check, statistic_at
from auditor.identification.scores import (
    CleanDrives,
    DriveSums,
    fault_scale,
    normalised_scores,
    standing_out,
    thresholds_from,
)
from auditor.model.calibration import CleanFrames, NullDistribution, ThetaScale
from auditor.model.checks import Check, SensorCheck, sensor_checks_of
from auditor.model.verdict import Cause

R = Decimal("0.01")
PAIRS = ((1, 2), (1, 3), (2, 3))
CHECKS = sensor_checks_of(PAIRS, PAIRS, (3,))
LIT = SensorCheck(Check.ADDED_LIGHT, 1, (2, 3))
FRAMES = 60


def clean(recording="a", statistics=None, strengths=None):
    """Clean frames with a constant value of each statistic and fault score."""
    return CleanFrames(
        recording,
        np.arange(FRAMES, dtype=np.int64) * 100_000_000,
        {},
        {check: np.full(FRAMES, value) for check, value in (statistics or {}).items()},
        {cause: np.full(FRAMES, value) for cause, value in (strengths or {}).items()},
    )


def test_without_clean_frames_every_check_has_the_prior():
    found = thresholds_from([], CHECKS, 11, R, "prior")
    assert set(found.expected) == set(CHECKS)
    assert all(found.expected[check] == expected(prior_of_check(check), []) for check in CHECKS)
    assert (found.calibration_id, found.r, found.drives, found.evidence_limit) == ("prior", R, 0, incident_limit())
    assert found.limit == joint_limit(0.01, 11)


def test_clean_recordings_are_drives():
    two = [clean("a", {LIT: 0.1}), clean("b", {LIT: 0.2})]
    found = thresholds_from(two, CHECKS, 11, R)
    assert found.drives == 2
    assert found.expected[LIT] == expected(prior_of_check(LIT), [log_odds(one.statistics[LIT]) for one in two])
    assert (found.expected[LIT].drives, found.expected[LIT].samples) == (2, 2 * FRAMES)
    other = CHECKS[0]
    assert found.expected[other] == expected(prior_of_check(other), []), "of others nothing is known"


def test_thresholds_without_a_recording_are_those_of_all_others_to_the_last_digit():
    draw, causes = np.random.default_rng(5), [(Cause.DARK, None), (Cause.EXPOSURE, 2), (Cause.LATE, 1)]

    def drawn(recording, checks):
        found = clean(recording, dict.fromkeys(checks, 0.1), dict.fromkeys(causes, 0.2))
        for values in (*found.statistics.values(), *found.strengths.values()):
            values[:] = draw.beta(2, 9, FRAMES)
            values[draw.random(FRAMES) < 0.1] = np.nan
        return found

    drives = [drawn(name, CHECKS[: 3 + place]) for place, name in enumerate("abcca")]
    for learnt in (CleanDrives.of(drives, CHECKS), CleanDrives.of(drives, CHECKS, groups={})):
        for name in "abc":
            alone = CleanDrives.of([one for one in drives if one.recording_id != name], CHECKS)
            assert learnt.thresholds(11, R, used=learnt.others(name)) == alone.thresholds(11, R)


def test_two_measurements_of_one_recording_are_one_drive_in_what_is_said():
    assert thresholds_from([clean("a", {LIT: 0.1}), clean("a", {LIT: 0.1})], CHECKS, 11, R).drives == 1


def test_a_recording_is_a_drive_as_long_as_one_of_its_measurements_is_used():
    twice = CleanDrives.of([clean("a", {LIT: 0.1}), clean("a", {LIT: 0.1}), clean("b", {LIT: 0.1})], CHECKS)
    for used, drives in (([True, False, True], 2), ([False, False, True], 1), ([True, True, False], 1)):
        assert twice.thresholds(11, R, used=np.array(used)).drives == drives


def test_drives_that_were_taken_apart_are_those_that_were_taken_together():
    drives = [clean(name, {LIT: 0.1 * n}, {(Cause.DARK, None): 0.4 * n}) for n, name in enumerate("abcd", start=1)]
    together, first, second = (DriveSums([LIT], many=100) for _ in range(3))
    for n, one in enumerate(drives):
        together.add(one)
        (first if n < 2 else second).add(one)
    first.join(second)
    whole, joined = (CleanDrives(one) for one in (together, first))
    for name in "abd":
        assert joined.thresholds(1, R, used=joined.others(name)) == whole.thresholds(1, R, used=whole.others(name))


def test_drives_narrow_nothing_of_a_fault_that_is_a_finding():
    tilted = Cause.DISPLACED, 0
    learnt = thresholds_from([clean(name, strengths={tilted: 0.5}) for name in "abcdefghijkl"], CHECKS, 11, R)
    assert learnt.causes[tilted].theta > learnt.limit * expected(prior_of_cause(tilted), ()).deviation


@pytest.mark.parametrize("r", ["-0.1", "1.1", "NaN"])
def test_a_rate_that_is_none_is_refused(r):
    with pytest.raises(SettingError):
        thresholds_from([], CHECKS, 11, Decimal(r))


@given(st.decimals("0", "1", places=4), st.decimals("0", "1", places=4))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_a_smaller_rate_never_has_a_smaller_limit_and_expects_the_same(r, other):
    one, two = (thresholds_from([clean("a", {LIT: 0.1})], CHECKS, 11, rate) for rate in sorted((r, other)))
    assert one.limit >= two.limit
    assert one.expected == two.expected


def test_a_score_is_how_many_deviations_the_log_odds_lie_above_the_mean():
    expects = [NullDistribution(-2.0, 0.5, 0.5, 1, 10, 0.0), NullDistribution(-1.0, 0.25, 0.25, 1, 10, 0.0), None]
    statistics = np.array([[statistic_at(odds) for odds in row] for row in ([-2.0, -1.0, 0.0], [-1.0, -1.5, 0.0])])
    np.testing.assert_allclose(normalised_scores(statistics, expects), [[0, 0, np.nan], [2, -2, np.nan]], atol=1e-9)


def test_scores_stay_between_two_limits_and_what_was_not_measured_has_none():
    z = normalised_scores(np.array([[1.0], [0.0], [np.nan]]), [NullDistribution(-2.0, 0.1, 0.1, 1, 10, 0.0)])
    assert z[:2].ravel().tolist() == [12, -4]
    assert np.isnan(z[2, 0])


@given(st.floats(0, 1), st.floats(0, 1))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_a_larger_statistic_never_has_a_smaller_score(value, other):
    expects = [thresholds_from([], [LIT], 1, R).expected[LIT]]
    low, high = (normalised_scores(np.array([[one]]), expects)[0, 0] for one in sorted((value, other)))
    assert low <= high


def test_by_the_prior_alone_what_is_nearly_one_exceeds_every_usual_limit_and_what_is_usual_none():
    for check in CHECKS:
        expects = [thresholds_from([], [check], 1, R).expected[check]]
        usual = statistic_at(prior_of_check(check).mean)
        high, low = normalised_scores(np.array([[0.98], [usual]]), expects).ravel()
        assert low == pytest.approx(0, abs=1e-9), check
        assert high > joint_limit(0.01, 11), check


@pytest.mark.parametrize("check", [LIT, CHECKS[0]], ids=str)
@pytest.mark.parametrize("share", [0.05, 0.1, 0.2])
def test_attacked_frames_among_the_clean_ones_do_not_hide_the_next_attack(check, share):
    values = np.random.default_rng(7).uniform(0.05, 0.2, FRAMES)
    values[: round(share * FRAMES)] = 0.95
    mixed = CleanFrames("a", np.arange(FRAMES, dtype=np.int64), {}, {check: values}, {})
    found = thresholds_from([mixed] * 3, CHECKS, 11, R)
    assert normalised_scores(np.array([[0.95]]), [found.expected[check]])[0, 0] > found.limit


def test_a_fault_s_theta_is_what_clean_frames_exceed_as_seldom_and_one_at_least():
    quiet = fault_scale(Cause.LATE, NullDistribution(-2.0, 0.3, 0.3, 4, 10, 0.0), 3.0)
    assert quiet == ThetaScale(1.0, FAULT_SCALE.scale, 4)
    always = fault_scale(Cause.LATE, NullDistribution(2.0, 0.5, 0.5, 4, 10, 0.0), 3.0)
    assert always == ThetaScale(3.5, FAULT_SCALE.scale * 3.5, 4)
    below_zero = fault_scale(Cause.LATE, NullDistribution(2.0, 0.5, 0.5, 4, 10, 0.0), -9.0)
    assert below_zero.theta == 2.0, "such a limit lowers no theta"


def test_what_is_usual_of_a_fault_that_goes_either_way_is_no_part_of_its_theta():
    found = fault_scale(Cause.EXPOSURE, NullDistribution(5.0, 0.5, 0.5, 4, 10, 0.0), 3.0)
    assert found == ThetaScale(1.5, FAULT_SCALE.scale * 1.5, 4, usual=5.0)


@pytest.mark.parametrize(
    ("cause", "mean", "deviation"),
    [
        ((Cause.LATE, 1), -6.5, 1.114),
        ((Cause.LATE, 0), -2.1, 0.755),
        ((Cause.DISPLACED, 1), 0.0, 0.2),
        ((Cause.DISPLACED, 0), -2.0, 1.037),
        ((Cause.EXPOSURE, 1), 0.0, 0.377),
        ((Cause.WHITE_BALANCE, 1), 0.0, 0.541),
        ((Cause.DARK, None), -0.3, 0.557),
        ((Cause.RAIN, 0), -0.3, 0.557),
    ],
)
def test_what_the_prior_expects_of_a_fault_of_a_drive_that_nobody_has_seen(cause, mean, deviation):
    found = expected(prior_of_cause(cause), ())
    assert (found.mean, found.deviation) == pytest.approx((mean, deviation), abs=6e-4)


def test_faults_have_the_prior_s_scale_where_no_clean_frame_is_known_but_what_is_usual_only_drives_say():
    found = thresholds_from([], CHECKS, 11, R)
    late = expected(prior_of_cause((Cause.LATE, 1)), [])
    assert found.causes[Cause.LATE, 1] == fault_scale(Cause.LATE, late, found.limit)
    assert {(Cause.DISPLACED, 0), (Cause.RAIN, 0), (Cause.DARK, None)} <= set(found.causes)
    assert not [cause for cause, _ in found.causes if cause is Cause.EXPOSURE]
    learnt = thresholds_from([clean("a", strengths={(Cause.EXPOSURE, 2): 1.4})], CHECKS, 11, R)
    assert learnt.causes[Cause.EXPOSURE, 2].usual == pytest.approx(1.4)
    assert 1.0 <= learnt.causes[Cause.EXPOSURE, 2].theta < 3.0


def test_one_odd_drive_moves_what_is_usual_of_tones_less_than_its_share():
    exposure = Cause.EXPOSURE, 2
    alike = thresholds_from([clean(name, strengths={exposure: 1.0}) for name in "abcd"], CHECKS, 11, R)
    drives = [clean(name, strengths={exposure: 1.0}) for name in "abcd"] + [clean("e", strengths={exposure: 6.0})]
    with_odd = thresholds_from(drives, CHECKS, 11, R)
    moved = with_odd.causes[exposure].usual - alike.causes[exposure].usual
    assert 0 <= moved < (6.0 - 1.0) / 5


def test_a_drive_that_does_not_know_its_tones_says_nothing_of_what_is_usual_and_one_frame_says_it():
    exposure = Cause.EXPOSURE, 2
    one_frame = clean("b", strengths={exposure: np.nan})
    one_frame.strengths[exposure][7] = 1.0
    learnt = thresholds_from([clean("a", strengths={exposure: np.nan}), one_frame], CHECKS, 11, R)
    assert learnt.causes[exposure].usual == pytest.approx(1.0)


def test_what_a_rig_always_shows_raises_its_fault_s_theta():
    dark = Cause.DARK, None
    usual, always = (
        thresholds_from([clean(name, strengths={dark: score}) for name in "abcdef"], CHECKS, 11, R)
        for score in (-0.3, 1.2)
    )
    assert always.causes[dark].theta > 1.2 > usual.causes[dark].theta == 1.0


def test_sensors_stand_out_whose_statistics_the_prior_does_not_expect():
    checks = [LIT, SensorCheck(Check.LIDAR_CONFLICT, 0, (1, 2, 3)), SensorCheck(Check.POINT_DROPOUT, 0, (3,))]
    expected_of = [expected(prior_of_check(one), ()) for one in checks]

    def at(*z):
        return [statistic_at(one.mean + far * one.deviation) for one, far in zip(expected_of, z, strict=True)]

    assert standing_out(checks, at(1.9, 1.9, 1.9)) == (frozenset(), False)
    assert standing_out(checks, at(2.1, 1.9, 1.9)) == (frozenset({LIT.sensor}), False)
    assert standing_out(checks, [None, *at(0.0, 1.9, 3.1)[1:]]) == (frozenset({0}), True)
    assert standing_out(checks, [None, None, None]) == (frozenset(), False)


def test_what_is_just_as_much_as_the_limit_does_not_stand_out(monkeypatch):
    (z,) = normalised_scores(np.array([[0.3]]), [expected(prior_of_check(LIT), ())])[0]
    for limits, found in ((z, (frozenset(), False)), (np.nextafter(z, 0), (frozenset({1}), True))):
        monkeypatch.setattr(scores, "STANDS_OUT", StandsOut(localised=limits, cells=limits))
        assert standing_out([LIT], [0.3]) == found


def test_a_drive_s_own_statistics_change_what_is_expected_of_its_checks_and_no_cause():
    thresholds = thresholds_from([clean("a", {LIT: 0.1}), clean("b", {LIT: 0.12})], CHECKS, 11, R)
    own = for_drive(thresholds, [LIT], np.full((30, 1), 0.02), np.arange(30) * 10**8)
    assert own.expected[LIT].mean < thresholds.expected[LIT].mean
    assert {check: one for check, one in own.expected.items() if check != LIT} == {
        check: one for check, one in thresholds.expected.items() if check != LIT
    }
    assert (own.limit, own.causes, own.drives) == (thresholds.limit, thresholds.causes, thresholds.drives)
