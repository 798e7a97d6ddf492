import math
from statistics import NormalDist

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from auditor.identification.drive_level import of_drive, own_level
from auditor.identification.parameters import HIERARCHY, JOINT_TAIL
from auditor.identification.prior import (
    SMALLEST_R,
    Prior,
    effective_size,
    expected,
    joint_limit,
    log_odds,
    prior_of_cause,
    prior_of_check,
    statistic_at,
)
from auditor.identification.statistics import stretch_medians
from auditor.model.checks import Check, SensorCheck, sensor_checks_of
from auditor.model.verdict import Cause

PRIOR = Prior(-2.0, 0.3, 0.4, 1.2)
NAN = math.nan


def drive(mean, frames=400, within=0.3, seed=0):
    """Independent frames of one drive."""
    noise = np.random.default_rng(seed).normal(0, within, frames)
    return mean + noise - noise.mean()


def deviation_of(within, between, drives):
    """What the module's docstring says, by the prior's own numbers."""
    return PRIOR.tail * math.sqrt(within**2 + between**2 * (1 + 1 / (HIERARCHY.rig_kind + drives)))


def test_without_drives_the_prior_is_expected():
    found = expected(PRIOR, [])
    assert found.mean == PRIOR.mean
    assert found.deviation == pytest.approx(deviation_of(PRIOR.within, PRIOR.between, 0))
    assert (found.drives, found.samples) == (0, 0)


def test_a_drive_of_which_nothing_was_measured_tells_nothing():
    assert expected(PRIOR, [np.full(50, NAN), np.zeros(0)]) == expected(PRIOR, [])


def test_a_drive_as_the_prior_expects_it_leaves_the_mean_and_narrows_what_drives_differ_by():
    found = expected(PRIOR, [drive(-2.0, within=0.3)])
    assert found.mean == pytest.approx(-2.0, abs=0.01)
    between = deviation_of(0.0, 0.4 * math.sqrt(4 / 5), 1)
    assert found.between == pytest.approx(between, rel=0.03)
    assert found.between < expected(PRIOR, []).between
    assert (found.drives, found.samples) == (1, 400)


@given(st.floats(-3.0, -1.0), st.integers(1, 600))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_one_drive_moves_the_mean_towards_its_own_and_by_its_weight_at_most(mean, frames):
    found = expected(PRIOR, [drive(mean, frames)])
    most = 1 / (1 + HIERARCHY.rig_kind)
    assert min(PRIOR.mean, mean) - 0.01 <= found.mean <= max(PRIOR.mean, mean) + 0.01
    assert abs(found.mean - PRIOR.mean) <= most * abs(mean - PRIOR.mean) + 0.01


def test_a_few_attacked_frames_of_a_drive_count_as_the_oddest_clean_ones():
    clean = drive(-2.0, within=0.3)
    attacked = clean.copy()
    attacked[::5] = 3.0
    learnt, spoilt = (expected(PRIOR, [values]) for values in (clean, attacked))
    assert spoilt.mean - learnt.mean < 0.2
    assert spoilt.deviation < 1.3 * learnt.deviation


def test_more_frames_of_one_drive_are_no_second_drive():
    short, long, two = (
        expected(PRIOR, drives).mean - PRIOR.mean
        for drives in ([drive(-1.2, 200)], [drive(-1.2, 20_000)], [drive(-1.2, 200), drive(-1.2, 200, seed=1)])
    )
    assert long == pytest.approx(short, rel=0.02)
    assert two > 1.1 * long


def test_many_drives_are_believed():
    rng = np.random.default_rng(3)
    means = rng.normal(-1.3, 0.6, 200)
    found = expected(PRIOR, [drive(mean, within=0.27, seed=n) for n, mean in enumerate(means)])
    assert found.mean == pytest.approx(means.mean(), abs=0.02)
    assert found.deviation == pytest.approx(PRIOR.tail * math.hypot(0.27, 0.6), rel=0.1)
    assert found.between == pytest.approx(PRIOR.tail * 0.6, rel=0.1)
    assert found.drives == 200


def test_drives_that_are_all_alike_narrow_what_is_expected_of_any_drive_to_so_much_at_most():
    found = expected(PRIOR, [drive(-2.0, seed=n) for n in range(200)])
    assert found.between < 0.2 * PRIOR.tail * PRIOR.between
    assert found.deviation > math.hypot(found.within, found.between)
    assert found.deviation == pytest.approx(HIERARCHY.narrowest * expected(PRIOR, []).deviation, rel=0.01)
    believed = expected(PRIOR, [drive(-2.0, seed=n) for n in range(200)], believed=True)
    assert believed.deviation < 0.8 * found.deviation, "of faults there is no such bound"


def test_a_drive_narrows_what_is_expected_of_any_other_not_at_all_and_each_further_one_somewhat():
    of_prior = expected(PRIOR, []).deviation
    one, two, four, many = (expected(PRIOR, [drive(-2.0, seed=n) for n in range(D)]).deviation for D in (1, 2, 4, 200))
    assert one == pytest.approx(of_prior), "thresholds of one drive raised clean frames of others"
    assert many < four < two < one


def test_frames_that_are_all_the_same_narrow_the_deviation_within_to_so_much_at_most():
    found = expected(PRIOR, [drive(-2.0, within=0.0)] * 50)
    assert found.within == pytest.approx(PRIOR.tail * HIERARCHY.narrowest * PRIOR.within)
    believed = expected(PRIOR, [drive(-2.0, within=0.0)] * 50, believed=True)
    assert believed.within < 0.8 * found.within, "of faults there is no such bound"


def test_drives_that_differ_more_than_the_prior_knows_widen_the_deviation():
    alike, apart = (
        expected(PRIOR, [drive(-2.0 + at * step, seed=n) for n, at in enumerate((-1, 1, -1, 1))])
        for step in (0.05, 1.0)
    )
    assert apart.deviation > 1.3 * alike.deviation
    assert apart.mean == pytest.approx(alike.mean, abs=1e-9)


@pytest.mark.parametrize("absurd", [3.9, -50.0, 50.0])
def test_a_drive_of_absurd_values_is_bounded(absurd):
    found = expected(PRIOR, [drive(absurd)])
    reach = HIERARCHY.farthest * math.sqrt(PRIOR.within**2 + PRIOR.between**2 * (1 + 1 / HIERARCHY.rig_kind))
    assert abs(found.mean - PRIOR.mean) <= reach / (1 + HIERARCHY.rig_kind) + 1e-9
    assert found.mean == pytest.approx(expected(PRIOR, [drive(absurd * 2)]).mean), "farther off it counts no more"


def test_frames_under_attack_in_a_calibration_widen_the_deviation_within_to_so_much_at_most():
    half = np.tile([-2.0, 3.9], 200)
    found = expected(PRIOR, [half] * 50)
    assert found.deviation < PRIOR.tail * math.sqrt((HIERARCHY.widest_values * PRIOR.within) ** 2 + 0.5) + 0.1
    # A strong attack still stands out of what such a calibration expects.
    assert (log_odds(np.array(0.95)) - expected(PRIOR, [half]).mean) / expected(PRIOR, [half]).deviation > 2


@given(
    st.lists(st.lists(st.one_of(st.floats(-4, 4), st.just(NAN)), max_size=12), max_size=5),
)
@settings(max_examples=40, deadline=None, derandomize=True)
def test_what_is_expected_is_finite_and_never_certain(drives):
    found = expected(PRIOR, [np.array(values, dtype=np.float64) for values in drives])
    assert math.isfinite(found.mean)
    assert 0.05 < found.deviation < 10
    assert found.drives == sum(any(not math.isnan(value) for value in values) for values in drives)
    assert found.samples == sum(not math.isnan(value) for values in drives for value in values)


def test_the_order_of_drives_does_not_matter():
    drives = [drive(-1.5), drive(-2.5, seed=1), drive(-2.0, 30, seed=2)]
    one, other = expected(PRIOR, drives), expected(PRIOR, drives[::-1])
    assert (one.mean, one.deviation) == pytest.approx((other.mean, other.deviation))


def test_independent_frames_are_worth_their_number():
    noise = np.random.default_rng(0).normal(size=1000)
    assert 700 < effective_size(noise) <= 1000


def test_frames_that_hardly_change_are_worth_few():
    walk = np.cumsum(np.random.default_rng(0).normal(size=1000))
    assert effective_size(walk) < 50
    in_tens = np.repeat(np.random.default_rng(1).normal(size=100), 10)
    assert 50 < effective_size(in_tens) < 150


@pytest.mark.parametrize("values", [np.full(500, 0.3), np.array([1.0, 2.0, 3.0]), np.array([7.0])])
def test_constant_frames_and_hardly_any_are_worth_one(values):
    assert effective_size(values) == 1.0


@given(st.lists(st.floats(-5, 5, allow_subnormal=False), min_size=4, max_size=60))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_frames_are_worth_one_at_least_and_their_number_at_most(values):
    assert 1 <= effective_size(np.array(values)) <= len(values)


@given(st.floats(1e-5, 0.99), st.floats(1e-5, 0.99), st.integers(1, 200), st.integers(1, 200))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_the_limit_falls_with_r_and_rises_with_the_checks(r, other, checks, more):
    assert joint_limit(min(r, other), checks) >= joint_limit(max(r, other), checks)
    assert joint_limit(r, min(checks, more)) <= joint_limit(r, max(checks, more))


def test_one_check_alone_has_the_limit_of_the_normal_distribution():
    assert joint_limit(0.01, 1) == pytest.approx(JOINT_TAIL.stretch * 2.3263, abs=1e-4)
    assert joint_limit(0.5, 1) == pytest.approx((1 - JOINT_TAIL.fall) * JOINT_TAIL.stretch * 2.3263, abs=1e-4)


def test_many_checks_are_worth_fewer_independent_ones():
    alone = NormalDist().inv_cdf(0.99 ** (1 / 20))
    assert joint_limit(0.01, 20) < JOINT_TAIL.stretch * alone
    assert joint_limit(0.01, 20) > joint_limit(0.01, 10)


def test_at_r_of_one_everything_is_a_finding_and_the_smallest_rates_are_taken_for_one():
    assert joint_limit(1.0, 10) == -math.inf
    assert joint_limit(0.0, 10) == joint_limit(SMALLEST_R, 10) < math.inf


@given(st.floats(0, 1))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_log_odds_rise_and_can_be_turned_back(statistic):
    odds = float(log_odds(np.array(statistic)))
    assert -4 < odds < 4
    assert statistic_at(odds) == pytest.approx(statistic, abs=1e-9)
    assert odds < float(log_odds(np.array(statistic + 0.01)))
    assert float(log_odds(np.array(1 - statistic))) == pytest.approx(-odds)


def test_what_was_not_measured_has_no_log_odds():
    assert np.isnan(log_odds(np.array([NAN]))).all()


def test_fewer_voters_are_expected_to_say_more():
    for check in (Check.ADDED_LIGHT, Check.REMOVED_LIGHT, Check.PHOTOMETRIC_INCONSISTENCY):
        three, two, one = (prior_of_check(SensorCheck(check, 1, others)) for others in ((2, 3, 4), (2, 3), (2,)))
        assert three.mean <= two.mean <= one.mean
        assert three.between <= one.between + 0.1


def test_every_check_and_every_cause_has_a_prior():
    pairs = tuple((i, k) for k in (2, 3, 4, 5) for i in range(1, k))
    for check in sensor_checks_of(pairs, pairs, (5, 4)):
        prior = prior_of_check(check)
        assert min(prior.within, prior.between) > 0
        assert prior.tail >= 1
    for cause in Cause:
        for sensor in (None, 0, 1):
            assert min(prior_of_cause((cause, sensor))[1:]) > 0


EXPECTED = expected(PRIOR, [drive(-2.1), drive(-1.8, seed=1)])


def threshold_of(one, limit=3.5):
    return one.mean + limit * one.deviation


def level_of(values):
    """The level of a drive at 10 Hz."""
    [medians] = stretch_medians([values], np.arange(len(values)) * 10**8)
    return own_level(values, medians)


def test_a_quiet_drive_has_a_mean_of_its_own_and_lower_thresholds():
    own = of_drive(EXPECTED, level_of(drive(-2.6)), 3.5)
    assert own.mean == pytest.approx(-2.6, abs=0.1)
    assert EXPECTED.within < own.deviation < EXPECTED.deviation
    assert threshold_of(own) < threshold_of(EXPECTED) - 0.5


@pytest.mark.parametrize("mean", [-0.5, 0.0, 3.0])
def test_no_drive_raises_a_threshold_by_its_own_frames(mean):
    assert threshold_of(of_drive(EXPECTED, level_of(drive(mean)), 3.5)) <= threshold_of(EXPECTED) + 1e-9


def test_a_few_attacked_frames_hardly_move_what_is_expected_of_their_drive():
    frames = drive(-2.6)
    attacked = np.where(np.arange(400) % 5 == 0, 4.0, frames)
    assert of_drive(EXPECTED, level_of(attacked), 3.5).mean == pytest.approx(
        of_drive(EXPECTED, level_of(frames), 3.5).mean, abs=0.15
    )


def test_more_frames_say_more_of_a_drive_and_none_say_all():
    deviations = [of_drive(EXPECTED, level_of(drive(-2.6, n)), 3.5).deviation for n in (1, 4, 40, 4000)]
    assert deviations == sorted(deviations, reverse=True)
    assert deviations[-1] ** 2 > EXPECTED.within**2 + (1 - HIERARCHY.most_learnt) * EXPECTED.between**2


def test_a_drive_without_measured_frames_and_a_rate_without_limit_expect_what_they_did():
    assert of_drive(EXPECTED, level_of(np.full(5, NAN)), 3.5) == EXPECTED
    assert of_drive(EXPECTED, level_of(np.zeros(0)), 3.5) == EXPECTED
    assert of_drive(EXPECTED, level_of(drive(-2.6)), -math.inf) == EXPECTED


def test_the_level_of_a_drive_is_that_of_its_busier_stretches_of_road():
    frames = drive(-2.6, 600)
    busy = frames + np.where(np.arange(600) // 100 % 3 == 1, 0.5, 0.0)  # ten seconds of thirty beside leaves
    assert np.median(busy) == pytest.approx(-2.5, abs=0.06)
    assert level_of(busy).level == pytest.approx(-2.1, abs=0.06)
    assert level_of(busy[:30]).level == np.median(busy[:30]), "a drive shorter than a stretch is one"


def test_what_lasts_for_a_small_share_of_a_drive_leaves_its_level():
    frames = drive(-2.6, 600)
    attacked = frames + np.where(np.arange(600) < 60, 4.0, 0.0)
    assert level_of(attacked).level == pytest.approx(level_of(frames).level, abs=0.1)
