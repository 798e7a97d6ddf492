"""How far the frames of the drive that is judged may say what is usual of it: never so far as an attack that lasts."""

from decimal import Decimal

import numpy as np
import pytest

from auditor.identification.drive_level import OwnLevel, for_drive, group_of, of_drive
from auditor.identification.evidence_parameters import DRIVE_LEVEL
from auditor.identification.prior import prior_of_check, statistic_at
from auditor.identification.scores import thresholds_from
from auditor.model.calibration import NullDistribution
from auditor.model.checks import Check, SensorCheck

USUAL = NullDistribution(-2.0, 0.6, 0.3, 3, 100, between=0.5)
LIGHT = [SensorCheck(Check.ADDED_LIGHT, s, tuple(t for t in (1, 2, 3, 4) if t != s)) for s in (1, 2, 3, 4)]
LIMIT = 3.5


def test_a_level_that_the_group_shares_is_the_drives_own():
    own = of_drive(USUAL, OwnLevel(-1.2, 20.0), LIMIT, group=0.7)
    assert own.mean == pytest.approx(-1.2, abs=0.1)


def test_a_level_far_above_the_group_is_that_of_the_group():
    own = of_drive(USUAL, OwnLevel(0.5, 20.0), LIMIT, group=-0.1)
    assert own.mean == pytest.approx(-2.1)
    assert own.deviation == pytest.approx(np.hypot(0.3, DRIVE_LEVEL.beside))


def test_a_level_as_far_above_the_group_as_clean_drives_go_is_believed():
    farthest = -2.0 + DRIVE_LEVEL.farthest * DRIVE_LEVEL.beside
    assert of_drive(USUAL, OwnLevel(farthest, 20.0, quarter=-3.0), LIMIT, group=0.0).mean > -1.5
    assert of_drive(USUAL, OwnLevel(farthest + 1e-9, 20.0, quarter=-3.0), LIMIT, group=0.0).mean < -2.5


def test_without_a_group_the_deviation_between_drives_without_its_tail_says_how_far_a_level_is_believed():
    farthest = -2.0 + DRIVE_LEVEL.farthest * USUAL.between / 2.0
    assert of_drive(USUAL, OwnLevel(farthest, 20.0), LIMIT, tail=2.0) != USUAL
    assert of_drive(USUAL, OwnLevel(farthest + 0.01, 20.0), LIMIT, tail=2.0) == USUAL


def test_where_half_of_a_drive_is_attacked_its_quietest_quarter_says_what_it_is_like():
    half = OwnLevel(-0.4, 20.0, quarter=-2.3)
    own = of_drive(USUAL, half, LIMIT, group=0.0)
    assert own.mean == pytest.approx(-2.3 + 0.67 * 0.3, abs=0.05)
    assert own.deviation < of_drive(USUAL, half._replace(quarter=0.2), LIMIT, group=0.0).deviation


def test_a_level_that_no_clean_drive_has_says_nothing_where_there_is_no_group():
    assert of_drive(USUAL, OwnLevel(0.5, 20.0), LIMIT) == USUAL


@pytest.mark.parametrize("level", [-1.9, -1.0, 0.0, 4.0])
@pytest.mark.parametrize("group", [None, 0.0, 1.5])
def test_no_level_makes_more_necessary_for_a_finding(level, group):
    own = of_drive(USUAL, OwnLevel(level, 20.0), LIMIT, group=group)
    assert own.mean + LIMIT * own.deviation <= USUAL.mean + LIMIT * USUAL.deviation + 1e-9


@pytest.mark.parametrize("attacked", [(1,), (3,), (1, 4)])
def test_attacked_cameras_do_not_move_what_the_group_shows_of_them(attacked):
    offsets = {check: 3.0 if check.sensor in attacked else 0.1 * check.sensor for check in LIGHT}
    groups = [group_of(check, offsets) for check in LIGHT if check.sensor in attacked]
    assert all(group <= 0.4 for group in groups)


def test_the_lidar_has_no_group_and_a_camera_none_of_unmeasured_ones():
    conflict = SensorCheck(Check.LIDAR_CONFLICT, 0, (1, 2, 3))
    assert group_of(conflict, {conflict: 1.0}) is None
    assert group_of(LIGHT[0], {LIGHT[0]: 1.0}) is None


def test_what_all_cameras_of_a_group_show_above_what_was_expected_is_the_drives_own():
    prior = thresholds_from((), LIGHT, 12, Decimal("0.01"))
    mean = prior.expected[LIGHT[1]].mean
    shown = np.tile([statistic_at(mean + above) for above in (1.0, 1.8, 1.0, 1.0)], (40, 1))
    own = for_drive(prior, LIGHT, shown, np.arange(40) * 10**8)
    assert own.expected[LIGHT[1]].mean > mean + 0.8
    shown[:, [0, 2, 3]] = statistic_at(mean)
    alone = for_drive(prior, LIGHT, shown, np.arange(40) * 10**8)
    assert alone.expected[LIGHT[1]].mean == pytest.approx(mean)


def test_light_in_all_frames_is_as_far_from_usual_as_in_one():
    prior = thresholds_from((), LIGHT, 12, Decimal("0.01"))
    clean = np.full((40, 4), statistic_at(-3.0))
    attacked = clean.copy()
    attacked[:, 1] = statistic_at(0.8)
    stamps = np.arange(40) * 10**8
    z = {}
    for name, statistics in (("one frame", clean), ("all frames", attacked)):
        usual = for_drive(prior, LIGHT, statistics, stamps).expected[LIGHT[1]]
        z[name] = (0.8 - usual.mean) / usual.deviation
    assert z["all frames"] > prior.limit
    assert z["one frame"] / z["all frames"] < 1.6
    assert prior_of_check(LIGHT[1]).tail > 1


def test_frames_in_which_the_lidar_lacks_points_say_no_level_of_what_it_has():
    of_lidar = [SensorCheck(Check.LIDAR_CONFLICT, 0, (1, 2, 3)), SensorCheck(Check.POINT_DROPOUT, 0, (3,))]
    prior = thresholds_from((), of_lidar, 12, Decimal("0.01"))
    conflict, dropout = (prior.expected[check] for check in of_lidar)
    shown = np.full((40, 2), [statistic_at(conflict.mean), statistic_at(dropout.mean)])
    full = for_drive(prior, of_lidar, shown, np.arange(40) * 10**8).expected[of_lidar[0]]
    shown[5:] = 0.0, statistic_at(dropout.mean + 1.01 * prior.limit * dropout.deviation)
    thinned = for_drive(prior, of_lidar, shown, np.arange(40) * 10**8).expected[of_lidar[0]]
    assert thinned.mean == pytest.approx(full.mean, abs=0.05)
    shown[5:, 1] = statistic_at(dropout.mean)
    assert for_drive(prior, of_lidar, shown, np.arange(40) * 10**8).expected[of_lidar[0]].mean < full.mean - 0.5
