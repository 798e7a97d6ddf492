import numpy as np
import pytest

from auditor.identification.statistics import Window, fitted, windowed_ratio, windowed_ratios
from auditor.model.checks import Check, PairCheck
from auditor.model.measurement import Cells


def by_hand(valid, inconsistent, window):
    best = None
    for r in range(valid.shape[0] - window.rows + 1):
        for c in range(valid.shape[1] - window.columns + 1):
            part = np.s_[r : r + window.rows, c : c + window.columns]
            N, B = int(valid[part].sum()), int(inconsistent[part].sum())
            if best is None or best[0] < B / (N + window.pseudo_count):
                best = (B / (N + window.pseudo_count), r, c)
    return best


@pytest.mark.parametrize("seed", range(20))
def test_the_summed_area_table_finds_the_window_that_trying_all_of_them_finds(seed):
    rng = np.random.default_rng(seed)
    valid = rng.integers(0, 17, (11, 17)).astype(np.uint8)
    inconsistent = np.minimum(valid, rng.integers(0, 17, (11, 17))).astype(np.uint8)
    window = Window(rows=int(rng.integers(1, 12)), columns=int(rng.integers(1, 18)), pseudo_count=20)
    found, expected = windowed_ratio(valid, inconsistent, window), by_hand(valid, inconsistent, window)
    assert (found and (found.ratio, found.row, found.column)) == expected


def test_a_full_window_does_not_overflow_the_counts_own_type():
    full = np.full((20, 20), 64, dtype=np.uint8)
    assert windowed_ratio(full, full, Window(10, 10, 6400)).ratio == 0.5


def test_few_pixels_have_a_small_ratio_and_fewer_than_the_pseudo_count_none():
    valid = np.zeros((10, 10), np.uint8)
    valid[0, 0] = 9
    assert windowed_ratio(valid, valid, Window(2, 2, 10)) is None
    assert windowed_ratio(valid, valid, Window(2, 2, 9)).ratio == 0.5
    assert windowed_ratio(valid, valid, Window(2, 2, 3)).ratio == 0.75


def test_a_grid_smaller_than_the_window_has_no_windowed_ratio():
    small = np.full((3, 40), 16, dtype=np.uint8)
    assert windowed_ratio(small, small, Window(7, 13, 1)) is None
    assert windowed_ratio(np.full((40, 3), 16, np.uint8), small.T, Window(7, 13, 1)) is None


@pytest.mark.parametrize(("points", "pseudo_count"), [(5, 40), (2, 36), (1, 18), (0, 15)])
def test_fewer_beams_have_a_smaller_pseudo_count_but_never_a_larger_one_than_sixty_four(points, pseudo_count):
    grid = np.full((12, 12), points, dtype=np.uint8)
    assert fitted(Window(6, 6, 40), grid) == Window(6, 6, pseudo_count)


def test_windows_that_hold_no_points_do_not_make_it_easier():
    grid = np.zeros((30, 10), dtype=np.uint8)
    grid[:10] = 2
    # Windows of 200, 180, ... 20 points: the 90th percentile is 182.
    assert fitted(Window(10, 10, 120), grid).pseudo_count == 91


def test_each_pair_check_gets_the_ratio_of_its_own_cells_or_the_share_that_came_ready():
    full, half, few = (np.full((12, 14), n, dtype=np.uint8) for n in (16, 8, 1))
    few[1:] = 0
    photometric, conflict, brightness, dropout = (
        PairCheck(check, 1, 3)
        for check in (
            Check.PHOTOMETRIC_INCONSISTENCY,
            Check.LIDAR_CONFLICT,
            Check.BRIGHTNESS_DIFFERENCE,
            Check.POINT_DROPOUT,
        )
    )
    found = windowed_ratios(
        (photometric, conflict, brightness, dropout),
        {photometric: Cells(full, half), conflict: Cells(few, few)},
        {brightness: 0.25},
    )
    assert found == (pytest.approx(48 * 8 / (48 * 16 + 200)), None, 0.25, None)


def test_lidar_conflicts_are_counted_in_windows_of_six_by_six_cells_with_a_pseudo_count_of_forty():
    valid, inconsistent = np.full((14, 14), 4, dtype=np.uint8), np.zeros((14, 14), dtype=np.uint8)
    inconsistent[4:10, 5:11] = 4
    conflict = PairCheck(Check.LIDAR_CONFLICT, 1, 3)
    assert windowed_ratios([conflict], {conflict: Cells(valid, inconsistent)}, {}) == (144 / (144 + 40),)


def test_photometric_inconsistencies_are_counted_in_windows_of_six_by_eight_cells_with_a_pseudo_count_of_two_hundred():
    valid, inconsistent = np.full((14, 14), 5, dtype=np.uint8), np.zeros((14, 14), dtype=np.uint8)
    inconsistent[4:10, 5:13] = 5
    photometric = PairCheck(Check.PHOTOMETRIC_INCONSISTENCY, 1, 3)
    assert windowed_ratios([photometric], {photometric: Cells(valid, inconsistent)}, {}) == (240 / (240 + 200),)


def test_the_pseudo_count_of_lidar_conflicts_fits_the_beams():
    one = np.ones((12, 14), dtype=np.uint8)
    conflict = PairCheck(Check.LIDAR_CONFLICT, 1, 3)
    assert windowed_ratios([conflict], {conflict: Cells(one, one)}, {}) == (36 / (36 + 18),)
