import numpy as np
import pytest

from auditor.identification.statistics import Window, fitted, local_ratio, local_ratios
from auditor.model.checks import Element, Witness
from auditor.model.measurement import Cells


def by_hand(valid, against, window):
    best = None
    for r in range(valid.shape[0] - window.rows + 1):
        for c in range(valid.shape[1] - window.columns + 1):
            part = np.s_[r : r + window.rows, c : c + window.columns]
            N, B = int(valid[part].sum()), int(against[part].sum())
            if best is None or best[0] < B / (N + window.prior):
                best = (B / (N + window.prior), r, c)
    return best


@pytest.mark.parametrize("seed", range(20))
def test_the_summed_area_table_finds_the_window_that_trying_all_of_them_finds(seed):
    rng = np.random.default_rng(seed)
    valid = rng.integers(0, 17, (11, 17)).astype(np.uint8)
    against = np.minimum(valid, rng.integers(0, 17, (11, 17))).astype(np.uint8)
    window = Window(rows=int(rng.integers(1, 12)), columns=int(rng.integers(1, 18)), prior=20)
    found, expected = local_ratio(valid, against, window), by_hand(valid, against, window)
    assert (found and (found.ratio, found.row, found.column)) == expected


def test_a_full_window_does_not_overflow_the_counts_own_type():
    full = np.full((20, 20), 64, dtype=np.uint8)
    assert local_ratio(full, full, Window(10, 10, 6400)).ratio == 0.5


def test_few_pixels_prove_little_and_fewer_than_the_prior_nothing():
    valid = np.zeros((10, 10), np.uint8)
    valid[0, 0] = 9
    assert local_ratio(valid, valid, Window(2, 2, 10)) is None
    assert local_ratio(valid, valid, Window(2, 2, 9)).ratio == 0.5
    assert local_ratio(valid, valid, Window(2, 2, 3)).ratio == 0.75


def test_a_grid_smaller_than_the_window_has_no_local_ratio():
    small = np.full((3, 40), 16, dtype=np.uint8)
    assert local_ratio(small, small, Window(7, 13, 1)) is None
    assert local_ratio(np.full((40, 3), 16, np.uint8), small.T, Window(7, 13, 1)) is None


@pytest.mark.parametrize(("points", "prior"), [(5, 40), (2, 36), (1, 18), (0, 15)])
def test_fewer_beams_have_a_smaller_prior_but_never_a_larger_one_than_sixty_four(points, prior):
    grid = np.full((12, 12), points, dtype=np.uint8)
    assert fitted(Window(6, 6, 40), grid) == Window(6, 6, prior)


def test_windows_that_hold_no_points_do_not_make_it_easier():
    grid = np.zeros((30, 10), dtype=np.uint8)
    grid[:10] = 2
    # Windows of 200, 180, ... 20 points: the 90th percentile is 182.
    assert fitted(Window(10, 10, 120), grid).prior == 91


def test_each_element_gets_the_ratio_of_its_own_cells_or_the_share_that_came_ready():
    full, half, few = (np.full((12, 14), n, dtype=np.uint8) for n in (16, 8, 1))
    few[1:] = 0
    seen, blind, light, absent = (
        Element(witness, 1, 3) for witness in (Witness.UNLIKE, Witness.CONTRADICTED, Witness.LIGHT, Witness.EMPTY)
    )
    found = local_ratios((seen, blind, light, absent), {seen: Cells(full, half), blind: Cells(few, few)}, {light: 0.25})
    assert found == (pytest.approx(48 * 8 / (48 * 16 + 200)), None, 0.25, None)


def test_the_lidar_is_looked_at_in_windows_of_six_by_six_cells_to_which_forty_innocent_points_are_added():
    valid, against = np.full((14, 14), 4, dtype=np.uint8), np.zeros((14, 14), dtype=np.uint8)
    against[4:10, 5:11] = 4
    denied = Element(Witness.CONTRADICTED, 1, 3)
    assert local_ratios([denied], {denied: Cells(valid, against)}, {}) == (144 / (144 + 40),)


def test_cameras_are_compared_in_windows_of_six_by_eight_cells_to_which_two_hundred_innocent_pixels_are_added():
    valid, against = np.full((14, 14), 5, dtype=np.uint8), np.zeros((14, 14), dtype=np.uint8)
    against[4:10, 5:13] = 5
    unlike = Element(Witness.UNLIKE, 1, 3)
    assert local_ratios([unlike], {unlike: Cells(valid, against)}, {}) == (240 / (240 + 200),)


def test_the_lidar_s_prior_fits_its_beams():
    one = np.ones((12, 14), dtype=np.uint8)
    denied = Element(Witness.CONTRADICTED, 1, 3)
    assert local_ratios([denied], {denied: Cells(one, one)}, {}) == (36 / (36 + 18),)
