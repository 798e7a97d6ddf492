import numpy as np
import pytest

from auditor.identification.evidence_parameters import LIKELIHOOD
from auditor.identification.likelihood import attack_sets, log_likelihood_ratios, posteriors, suspects_of
from auditor.identification.parameters import SCORE_LIMITS
from auditor.identification.systems import System
from auditor.model.checks import sensor_checks_of
from auditor.model.rig import triples_of


def system_of(cameras):
    pairs = tuple((i, k) for k in range(2, cameras + 1) for i in range(1, k))
    checks = sensor_checks_of(pairs, pairs, (cameras,))
    return System(checks, triples_of(cameras, lidar=True), tuple(range(cameras + 1)), None)


FOUR, SEVEN = system_of(4), system_of(7)
SHOWN = (-2.5, -0.5, 0.5, 1.5, 2.5, 3.5, 4.5, 5.75, 7.25, 10.0)


@pytest.mark.parametrize(
    ("sensor", "ratios"),
    [
        (0, (-6.49, -4.83, -4.09, -3.17, -1.53, 1.86, 6.72, 13.16, 20.92, 35.16)),
        (1, (-9.73, -6.99, -5.58, -3.78, -1.17, 2.66, 6.95, 11.61, 16.84, 26.48)),
    ],
    ids=["a LiDAR", "a camera"],
)
def test_how_much_likelier_a_second_sensor_makes_what_a_frame_shows_at_each_score(sensor, ratios):
    z = np.full((len(SHOWN), len(FOUR.sensor_checks)), SCORE_LIMITS.lowest)
    of_sensors = [one.sensor for one in FOUR.sensor_checks]
    z[:, np.equal(of_sensors, 2)] = SCORE_LIMITS.highest
    z[:, np.equal(of_sensors, sensor)] = np.transpose([SHOWN])
    found = log_likelihood_ratios(z, FOUR, frozenset(), [(), (2,), tuple(sorted((2, sensor)))])
    np.testing.assert_allclose(found[:, 2] - found[:, 1], ratios, atol=0.006)


def test_a_sensor_of_which_nothing_was_measured_is_in_no_set_of_several_and_alone_only_unlikely():
    z = np.full((1, len(SEVEN.sensor_checks)), -1.0)
    of_sensors = np.array([one.sensor for one in SEVEN.sensor_checks])
    z[0, of_sensors == 1] = np.nan
    z[0, of_sensors == 2] = 9.0
    alone, other, both = log_likelihood_ratios(z, SEVEN, frozenset(), [(), (1,), (2,), (1, 2)])[0, 1:]
    assert -np.inf < alone < 0 < other
    assert both == -np.inf


def test_each_sensor_after_the_first_makes_a_set_less_likely_by_as_much():
    z = np.full((1, len(SEVEN.sensor_checks)), SCORE_LIMITS.lowest)
    z[0, [one.sensor in {1, 2, 3, 4} for one in SEVEN.sensor_checks]] = SCORE_LIMITS.highest
    two, three = log_likelihood_ratios(z, SEVEN, frozenset(), [(), (1, 2), (1, 2, 3)])[0, 1:]
    assert three - two == pytest.approx(LIKELIHOOD.of_camera[-1] + LIKELIHOOD.of_several)


def test_three_sensors_outside_a_set_of_several_must_be_left_and_none_has_more_than_three():
    of_three, of_two = (FOUR, {0, 1}, 1), (FOUR, {0, 1, 2}, 0)
    for system, absent, most in ((FOUR, set(), 2), (FOUR, {0}, 1), of_three, of_two, (SEVEN, set(), 3)):
        sets = attack_sets(system, frozenset(absent), [s for s in system.sensors if s not in absent])
        assert max(len(one) for one in sets) == most


def test_before_anything_is_seen_an_attack_has_even_odds_and_each_further_sensor_a_fifth_of_them():
    sets = [(), (1,), (2,), (3,), (1, 2), (1, 3), (2, 3)]
    (found,) = posteriors(np.zeros((1, 4)), sets[:4], 3)
    assert found.tolist() == pytest.approx([1 / 2, 1 / 6, 1 / 6, 1 / 6])
    (found,) = posteriors(np.zeros((1, 7)), sets, 3)
    assert found.tolist() == pytest.approx([1 / 2.2, *[1 / 6.6] * 3, *[1 / 33] * 3])


def test_sets_of_several_are_made_of_the_six_sensors_that_show_most():
    shown = np.array([2.0, 1.0, 0.5, 4.0, 3.0, -1.0, 2.5, 0.0])
    z = shown[[one.sensor for one in SEVEN.sensor_checks]]
    assert suspects_of(z, SEVEN, frozenset()) == (0, 1, 2, 3, 4, 6)
    assert suspects_of(z, SEVEN, frozenset({3})) == (0, 1, 2, 4, 6, 7)
    assert suspects_of(z, SEVEN, frozenset({3, 4})) == (0, 1, 2, 5, 6, 7), "of six all"
