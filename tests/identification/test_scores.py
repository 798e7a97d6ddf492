from decimal import Decimal

import numpy as np
import pytest

from auditor.errors import ThresholdsError
from auditor.identification.scores import (
    CEILINGS,
    FLOORS,
    candidates,
    fault_scale,
    fault_scales,
    normalised_scores,
    scale_of,
    scales_of,
)
from auditor.model.calibration import Scale
from auditor.model.checks import Check, PairCheck
from auditor.model.verdict import Cause

R = Decimal("0.01")


def test_a_tenth_of_what_is_left_is_added_to_the_quantile():
    samples = sorted([*np.linspace(0, 0.3, 199).tolist(), 0.99])
    assert scale_of(Check.PHOTOMETRIC_INCONSISTENCY, samples, R).theta == pytest.approx(
        samples[197] + 0.1 * (1 - samples[197])
    )


def test_one_clean_window_at_one_does_not_silence_a_pair_check():
    for check in (Check.LIDAR_CONFLICT, Check.PHOTOMETRIC_INCONSISTENCY, Check.BRIGHTNESS_DIFFERENCE):
        found = scale_of(check, [0.0] * 9 + [1.0], Decimal(0))
        assert found.theta == CEILINGS[check] < 1


def test_point_dropout_does_not_fire_for_a_lidar_that_never_fills_the_view():
    found = scale_of(Check.POINT_DROPOUT, [1.0] * 50, R)
    assert normalised_scores(np.array([[1.0]]), [found])[0, 0] <= 0


@pytest.mark.parametrize(
    ("check", "floor", "ceiling"),
    [
        (Check.LIDAR_CONFLICT, 0.48, 0.6),
        (Check.PHOTOMETRIC_INCONSISTENCY, 0.25, 0.5),
        (Check.BRIGHTNESS_DIFFERENCE, 0.3, 0.5),
        (Check.POINT_DROPOUT, 0.85, 1.0),
        (Check.ISOLATED_POINTS, 0.4, 1.0),
    ],
)
def test_thresholds_lie_between_these_floors_and_ceilings(check, floor, ceiling):
    assert scale_of(check, [0.0] * 100, R).theta == floor
    assert scale_of(check, [1.0] * 100, R).theta == ceiling
    between = (floor + 0.01 - 0.1) / 0.9
    assert scale_of(check, [between] * 100, R).theta == pytest.approx(floor + 0.01)


def test_a_scale_of_nineteen_equal_samples_and_a_large_one_is_worked_out_by_hand():
    # theta: 0.3 and a tenth of 0.7; scale: the 95th percentile of the samples less their median.
    found = scale_of(Check.PHOTOMETRIC_INCONSISTENCY, [0.1] * 10 + [0.3] * 11, Decimal("0.1"))
    assert found.theta == pytest.approx(0.37)
    assert found.scale == pytest.approx(0.37 / 4)
    wide = scale_of(Check.PHOTOMETRIC_INCONSISTENCY, [0.0] * 15 + [0.02 * n for n in range(1, 7)], Decimal("0.3"))
    assert wide.theta == 0.25
    assert wide.scale == pytest.approx(0.1)
    assert wide.samples == 21


def test_the_scores_of_what_is_just_over_or_far_off_are_worked_out_by_hand():
    z = normalised_scores(np.array([[0.6], [0.61], [0.8], [0.81], [0.3], [0.29]]), [Scale(0.5, 0.1, 9)]).ravel()
    np.testing.assert_allclose(z, [1, 1.1, 3, 3, -2, -2])


@pytest.mark.parametrize(
    ("samples", "r", "theta"), [([0.2] * 100, 0, 1.0), ([0.8] * 100, 0, 1.0), ([1.0] * 100, 0, 1.25), ([2.0], 1, 2.5)]
)
def test_a_fault_s_threshold_is_a_quarter_more_than_clean_frames_show_and_one_at_least(samples, r, theta):
    assert fault_scale(samples, Decimal(r)) == Scale(theta, theta / 4, len(samples))


def test_a_fault_never_measured_has_no_threshold():
    samples = {(Cause.LATE, 1): [2.0], (Cause.LATE, 2): []}
    assert fault_scales(samples, R) == {(Cause.LATE, 1): Scale(2.5, 0.625, 1)}


@pytest.mark.parametrize("check", list(Check))
def test_easy_drives_do_not_set_the_threshold(check):
    assert scale_of(check, [0.0] * 100, R).theta == FLOORS[check]


def test_the_scale_is_the_clean_spread_but_no_less_than_a_quarter_of_theta():
    narrow = scale_of(Check.PHOTOMETRIC_INCONSISTENCY, [0.5] * 100, R)
    assert narrow.scale == pytest.approx(narrow.theta / 4)
    wide = sorted([0.0] * 90 + [0.9] * 10)
    assert scale_of(Check.PHOTOMETRIC_INCONSISTENCY, wide, R).scale == pytest.approx(0.9)


def test_scores_are_zero_at_theta_clipped_and_nan_where_unmeasured():
    scales = (Scale(0.5, 0.1, 9), Scale(0.3, 0.3, 9), None)
    z = normalised_scores(np.array([[0.5, np.nan, 0.9], [0.55, 0.0, 0.9], [1.0, 1.0, 0.9], [0.0, 0.3, 0.9]]), scales)
    np.testing.assert_allclose(z, [[0, np.nan, np.nan], [0.5, -1, np.nan], [3, 7 / 3, np.nan], [-2, 0, np.nan]])


def test_each_pair_check_has_the_scale_of_its_own_clean_frames():
    pair_checks = (
        PairCheck(Check.PHOTOMETRIC_INCONSISTENCY, 1, 3),
        PairCheck(Check.BRIGHTNESS_DIFFERENCE, 1, 2),
        PairCheck(Check.BRIGHTNESS_DIFFERENCE, 1, 3),
    )
    ratios = np.array([[0.1, np.nan, 0.4], [0.3, np.nan, np.nan]])
    photometric, unmeasured, brightness = scales_of(ratios, pair_checks, Decimal(0))
    assert photometric.theta == pytest.approx(0.37)
    assert unmeasured is None
    assert (brightness.theta, brightness.samples) == (pytest.approx(0.46), 1)


def test_no_samples_make_no_threshold():
    with pytest.raises(ThresholdsError):
        scale_of(Check.BRIGHTNESS_DIFFERENCE, [], R)


@pytest.mark.parametrize("share", [0.05, 0.1, 0.2])
@pytest.mark.parametrize("check", [Check.LIDAR_CONFLICT, Check.PHOTOMETRIC_INCONSISTENCY, Check.BRIGHTNESS_DIFFERENCE])
def test_attacked_frames_among_the_clean_ones_do_not_hide_the_next_attack(check, share):
    rng = np.random.default_rng(7)
    clean, attack = rng.uniform(0, 0.2, 400), rng.uniform(0.8, 0.95, 400)
    count = round(share * len(clean))
    mixed = np.sort(np.concatenate([clean[count:], attack[:count]]))
    scales = [scale_of(check, mixed.tolist(), R)]
    assert (normalised_scores(attack[count:, None], scales) > 0).all()
    assert (normalised_scores(clean[:, None], scales) <= 0).all()


def test_only_what_lies_above_its_floor_is_a_candidate():
    pair_checks = [
        PairCheck(check, 1, 3)
        for check in (
            Check.PHOTOMETRIC_INCONSISTENCY,
            Check.PHOTOMETRIC_INCONSISTENCY,
            Check.BRIGHTNESS_DIFFERENCE,
            Check.BRIGHTNESS_DIFFERENCE,
        )
    ]
    assert candidates(pair_checks, [0.25, 0.26, None, 0.31]) == [pair_checks[1], pair_checks[3]]
