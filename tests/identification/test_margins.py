from decimal import Decimal

import numpy as np
import pytest

from auditor.elements import Element, Witness
from auditor.errors import ThresholdsError
from auditor.identification.margins import CEILINGS, FLOORS, Yardstick, margins, yardstick, yardsticks

R = Decimal("0.01")


def test_a_tenth_of_what_is_left_is_added_to_the_quantile():
    samples = sorted([*np.linspace(0, 0.3, 199).tolist(), 0.99])
    assert yardstick(Witness.UNLIKE, samples, R).theta == pytest.approx(samples[197] + 0.1 * (1 - samples[197]))


def test_one_clean_window_at_one_does_not_silence_an_element():
    for witness in (Witness.CONTRADICTED, Witness.UNLIKE, Witness.LIGHT):
        found = yardstick(witness, [0.0] * 9 + [1.0], Decimal(0))
        assert found.theta == CEILINGS[witness] < 1


def test_a_lidar_that_never_fills_the_view_is_not_raised_for_it():
    found = yardstick(Witness.EMPTY, [1.0] * 50, R)
    assert margins(np.array([[1.0]]), [found])[0, 0] <= 0


@pytest.mark.parametrize("witness", list(Witness))
def test_easy_drives_do_not_set_the_threshold(witness):
    assert yardstick(witness, [0.0] * 100, R).theta == FLOORS[witness]


def test_the_scale_is_the_clean_spread_but_no_less_than_a_quarter_of_theta():
    narrow = yardstick(Witness.UNLIKE, [0.5] * 100, R)
    assert narrow.scale == pytest.approx(narrow.theta / 4)
    wide = sorted([0.0] * 90 + [0.9] * 10)
    assert yardstick(Witness.UNLIKE, wide, R).scale == pytest.approx(0.9)


def test_margins_are_zero_at_theta_clipped_and_nan_where_unmeasured():
    scales = (Yardstick(0.5, 0.1, 9), Yardstick(0.3, 0.3, 9), None)
    z = margins(np.array([[0.5, np.nan, 0.9], [0.55, 0.0, 0.9], [1.0, 1.0, 0.9], [0.0, 0.3, 0.9]]), scales)
    np.testing.assert_allclose(z, [[0, np.nan, np.nan], [0.5, -1, np.nan], [3, 7 / 3, np.nan], [-2, 0, np.nan]])


def test_each_element_is_measured_by_its_own_clean_frames():
    elements = (Element(Witness.UNLIKE, 1, 3), Element(Witness.LIGHT, 1, 2), Element(Witness.LIGHT, 1, 3))
    ratios = np.array([[0.1, np.nan, 0.4], [0.3, np.nan, np.nan]])
    unlike, silent, light = yardsticks(ratios, elements, Decimal(0))
    assert unlike.theta == pytest.approx(0.37)
    assert silent is None
    assert (light.theta, light.samples) == (pytest.approx(0.46), 1)


def test_no_samples_make_no_threshold():
    with pytest.raises(ThresholdsError):
        yardstick(Witness.LIGHT, [], R)


@pytest.mark.parametrize("share", [0.05, 0.1, 0.2])
@pytest.mark.parametrize("witness", [Witness.CONTRADICTED, Witness.UNLIKE, Witness.LIGHT])
def test_attacked_frames_among_the_clean_ones_do_not_hide_the_next_attack(witness, share):
    rng = np.random.default_rng(7)
    clean, attack = rng.uniform(0, 0.2, 400), rng.uniform(0.8, 0.95, 400)
    count = round(share * len(clean))
    mixed = np.sort(np.concatenate([clean[count:], attack[:count]]))
    scales = [yardstick(witness, mixed.tolist(), R)]
    assert (margins(attack[count:, None], scales) > 0).all()
    assert (margins(clean[:, None], scales) <= 0).all()
