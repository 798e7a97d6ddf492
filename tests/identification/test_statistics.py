import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from auditor.identification.statistics import (
    CAMERA_WINDOW,
    CONFLICT_WINDOW,
    Window,
    fitted,
    sensor_statistics,
    stretch_medians,
    window_means_of,
    window_sums,
)
from auditor.model.arrays import median_of, quantile_of
from auditor.model.checks import CAMERA_CHECKS, Check, CountedPair, SensorCheck, sensor_checks_of
from auditor.model.measurement import LIGHT_STEPS, Cells

ROWS, COLUMNS = 12, 16
FULL = 16
"""Half-resolution pixels of a cell."""


@given(st.integers(1, 9), st.integers(1, 9), st.integers(1, 10), st.integers(1, 10), st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_the_sums_of_windows_are_those_of_trying_all_of_them(height, width, rows, columns, seed):
    grids = np.random.default_rng(seed).integers(-127, 128, (2, height, width)).astype(np.int8)
    found = window_sums(grids, Window(rows, columns, 0, 0))
    assert found.shape == (2, max(height - rows + 1, 0), max(width - columns + 1, 0))
    for (grid, r, c), total in np.ndenumerate(found):
        assert total == grids[grid, r : r + rows, c : c + columns].astype(int).sum()


def cells(valid, total):
    """Cells of one number each, or of the grids given."""
    shape = ROWS, COLUMNS
    return Cells(
        np.broadcast_to(np.asarray(valid, np.uint8), shape).copy(),
        np.broadcast_to(np.asarray(total, np.int8), shape).copy(),
    )


def patch(value, rows=slice(2, 8), columns=slice(4, 12), elsewhere=0):
    grid = np.full((ROWS, COLUMNS), elsewhere)
    grid[rows, columns] = value
    return grid


def of(check, i, k, sensor):
    return CountedPair(check, i, k, sensor)


def means_of(counted, grid):
    """The means of the windows of one grid, NaN where they are not known."""
    found = window_means_of([counted], {counted: grid})
    return np.where(found.known[0], found.means[0], np.nan)


INCONSISTENT = of(Check.PHOTOMETRIC_INCONSISTENCY, 1, 2, 1)
LIT = of(Check.ADDED_LIGHT, 1, 2, 1)
CONFLICT = of(Check.LIDAR_CONFLICT, 1, 2, 0)
LOST = of(Check.LOST_RETURNS, 1, 2, 0)


def test_inconsistencies_are_counted_in_windows_of_six_by_eight_cells_with_a_pseudo_count_of_two_hundred():
    means = means_of(INCONSISTENT, cells(5, patch(5)))
    assert means.shape == (ROWS - 5, COLUMNS - 7)
    assert means.max() == means[2, 4] == pytest.approx(240 / (240 + 200))


def test_conflicts_are_counted_in_windows_of_six_by_six_cells_with_a_pseudo_count_of_forty():
    means = means_of(CONFLICT, cells(4, patch(4, columns=slice(5, 11))))
    assert means.shape == (ROWS - 5, COLUMNS - 5)
    assert means.max() == pytest.approx(144 / (144 + 40))


def test_light_is_the_sum_of_residuals_and_darkness_is_below_zero():
    means = means_of(LIT, cells(FULL, patch(LIGHT_STEPS * 8)))
    assert means.max() == pytest.approx(48 * 8 / (48 * 16 + 200))
    assert means_of(LIT, cells(FULL, patch(-LIGHT_STEPS * 8))).min() == -means.max()


def test_a_window_of_fewer_pixels_than_needed_has_no_mean():
    few = patch(5, elsewhere=0)
    assert means_of(INCONSISTENT, cells(few, few))[2, 4] == pytest.approx(240 / 440)
    few[2, 4:12] = 0
    assert means_of(INCONSISTENT, cells(few, few))[2, 4] == pytest.approx(200 / 400)
    few[3, 4] = 4
    means = means_of(INCONSISTENT, cells(few, few))
    assert np.isnan(means[2, 4])
    assert np.isnan(means_of(INCONSISTENT, cells(0, 0))).all()


def test_surfaces_are_counted_in_windows_of_six_by_six_cells_from_eighteen_samples_on_with_thirty_six_added():
    samples = patch(1, slice(0, 3), slice(0, 6))
    means = means_of(LOST, cells(samples, samples))
    assert means.shape == (ROWS - 5, COLUMNS - 5)
    assert np.nanmax(means) == means[0, 0] == pytest.approx(18 / (18 + 36))
    samples[0, 0] = 0
    assert np.isnan(means_of(LOST, cells(samples, samples))).all()


def test_a_grid_smaller_than_a_window_has_no_means():
    small = Cells(np.full((5, 40), FULL, np.uint8), np.zeros((5, 40), np.int8))
    assert means_of(INCONSISTENT, small).size == 0
    assert sensor_statistics([SensorCheck(INCONSISTENT.check, 1, (2,))], {INCONSISTENT: small}, {}) == (None,)


@pytest.mark.parametrize(("points", "pseudo_count", "fewest"), [(5, 40, 20), (2, 36, 18), (1, 18, 9), (0, 15, 7)])
def test_fewer_beams_have_a_smaller_pseudo_count_but_never_a_larger_one_than_sixty_four(points, pseudo_count, fewest):
    grid = np.full((12, 12), points, dtype=np.uint8)
    assert fitted(CONFLICT_WINDOW, window_sums(grid, CONFLICT_WINDOW)) == Window(6, 6, pseudo_count, fewest)


def test_windows_that_hold_no_points_do_not_make_it_easier():
    grid = np.zeros((30, 10), dtype=np.uint8)
    grid[:10] = 2
    # Windows of 200, 180, ... 20 points: the 90th percentile is 182.
    window = Window(10, 10, 120, 60)
    assert fitted(window, window_sums(grid, window)).pseudo_count == 91


def voted(check, *means, fewest=FULL):
    """The statistic of S_1's check by as many cameras as there are numbers, its mean of a window by each."""
    lit = Check.ADDED_LIGHT if check is Check.REMOVED_LIGHT else check
    steps = LIGHT_STEPS if lit is Check.ADDED_LIGHT else 1
    others = tuple(range(2, 2 + len(means)))
    counted = {}
    for other, mean in zip(others, means, strict=True):
        total = mean if isinstance(mean, np.ndarray) else patch(mean)
        counted[of(lit, 1, other, 1)] = cells(fewest, total * steps)
    return sensor_statistics([SensorCheck(check, 1, others)], counted, {})[0]


def mean(value, valid=FULL):
    return 48 * value / (48 * valid + 200)


@pytest.mark.parametrize("check", CAMERA_CHECKS)
def test_one_voter_alone_says_what_it_says(check):
    sign = -1 if check is Check.REMOVED_LIGHT else 1
    assert voted(check, sign * 12) == pytest.approx(mean(12))
    assert voted(check, -sign * 12) == 0


def test_added_light_of_two_voters_is_their_mean():
    assert voted(Check.ADDED_LIGHT, 12, 4) == pytest.approx(mean(8))
    assert voted(Check.ADDED_LIGHT, 12, -4) == pytest.approx(mean(4))
    assert voted(Check.ADDED_LIGHT, 4, -12) == 0


def test_added_light_of_three_voters_is_the_geometric_mean_of_their_mean_and_the_smallest():
    assert voted(Check.ADDED_LIGHT, 12, 8, 4) == pytest.approx(np.sqrt(mean(8) * mean(4)))
    assert voted(Check.ADDED_LIGHT, 12, 12, 0) == 0
    assert voted(Check.ADDED_LIGHT, 12, 12, -4) == 0


@pytest.mark.parametrize(("check", "sign"), [(Check.REMOVED_LIGHT, -1), (Check.PHOTOMETRIC_INCONSISTENCY, 1)])
def test_what_an_attacked_voter_shows_as_well_is_the_least_that_any_voter_says(check, sign):
    assert voted(check, sign * 12, sign * 4) == pytest.approx(mean(4))
    assert voted(check, sign * 12, sign * 8, sign * 2) == pytest.approx(mean(2))
    assert voted(check, sign * 12, sign * 8, 0) == 0


def test_voters_must_agree_at_one_place():
    apart = [patch(12, columns=columns) for columns in (slice(0, 4), slice(12, 16))]
    assert voted(Check.PHOTOMETRIC_INCONSISTENCY, *apart) == 0
    assert voted(Check.PHOTOMETRIC_INCONSISTENCY, apart[0], apart[0]) == pytest.approx(24 * 12 / (48 * 16 + 200))


def by_three(valid, total=12):
    counted = {
        of(Check.PHOTOMETRIC_INCONSISTENCY, 1, other, 1): cells(seen, patch(total) * (np.asarray(seen) > 0))
        for other, seen in zip((2, 3, 4), valid, strict=True)
    }
    return sensor_statistics([SensorCheck(Check.PHOTOMETRIC_INCONSISTENCY, 1, (2, 3, 4))], counted, {})[0]


def test_two_voters_must_have_compared_a_window_and_the_others_need_not():
    assert by_three((FULL, FULL, FULL)) == pytest.approx(mean(12))
    assert by_three((FULL, FULL, 0)) == pytest.approx(mean(12))
    assert by_three((FULL, 0, 0)) is None
    assert by_three((0, 0, 0)) is None


def beside_colours(others, seen_by_grey):
    """Of grey S_1 by grey S_3 and by S_2 and S_4, which have colours; S_3 compares the patch as far as told."""
    counted = {
        of(Check.PHOTOMETRIC_INCONSISTENCY, 1, other, 1): cells(
            seen, patch(12, columns=slice(0, 8)) * (np.asarray(seen) > 0)
        )
        for other, seen in ((2, FULL), (3, seen_by_grey), (4, FULL))
    }
    counted[of(Check.COLOURED_LIGHT, 2, 4, 2)] = cells(FULL, 0)
    return sensor_statistics([SensorCheck(Check.PHOTOMETRIC_INCONSISTENCY, 1, others)], counted, {})[0]


def test_of_voters_of_both_kinds_one_of_the_sensors_own_must_have_compared_a_window():
    elsewhere = patch(FULL, rows=slice(0, 12), columns=slice(13, 16))
    assert beside_colours((2, 3, 4), FULL) == pytest.approx(mean(12))
    assert beside_colours((2, 3, 4), elsewhere) == 0, "plants differ to both cameras with colours"
    assert beside_colours((2, 3, 4), 0) is None
    assert beside_colours((2, 4), 0) == pytest.approx(mean(12)), "no other grey camera votes"


def test_a_check_is_measured_only_where_all_its_voters_were_there():
    counted = {of(Check.PHOTOMETRIC_INCONSISTENCY, 1, 2, 1): cells(FULL, patch(12))}
    checks = [SensorCheck(Check.PHOTOMETRIC_INCONSISTENCY, 1, others) for others in ((2, 3), (2,), (3,))]
    assert sensor_statistics(checks, counted, {}) == (None, pytest.approx(mean(12)), None)


def test_each_camera_is_judged_by_the_counts_in_its_own_image():
    counted = {
        of(Check.ADDED_LIGHT, 1, 2, 1): cells(FULL, patch(12 * LIGHT_STEPS // 2)),
        of(Check.ADDED_LIGHT, 1, 2, 2): cells(FULL, -patch(4 * LIGHT_STEPS // 2)),
    }
    checks = [
        SensorCheck(check, camera, (3 - camera,))
        for check in (Check.ADDED_LIGHT, Check.REMOVED_LIGHT)
        for camera in (1, 2)
    ]
    found = sensor_statistics(checks, counted, {})
    assert found == (pytest.approx(mean(6)), 0, 0, pytest.approx(mean(2)))


def coloured(others, *totals):
    """Of S_1 by these cameras; S_2, S_3 ... have colours as far as there are totals."""
    counted = {
        of(Check.COLOURED_LIGHT, 1, other, 1): cells(FULL, patch(total * LIGHT_STEPS // 2))
        for other, total in enumerate(totals, start=2)
    }
    return sensor_statistics([SensorCheck(Check.COLOURED_LIGHT, 1, others)], counted, {})[0]


def test_light_of_one_colour_is_the_mean_of_the_voters_that_have_colours():
    assert coloured((2, 3, 4), 12) == pytest.approx(mean(6))
    assert coloured((2, 3, 4), 12, 4) == pytest.approx(mean(4))
    assert coloured((2, 3, 4), 12, 4, -4) == pytest.approx(mean(2))
    assert coloured((3, 4), 12) is None, "neither of them has colours"
    assert coloured((2, 3, 4), -12) == 0, "S_2 has it"


def test_light_in_rows_is_the_least_of_what_its_voters_say():
    shares = {SensorCheck(Check.STRIPED_LIGHT, 1, (other,)): share for other, share in ((2, 0.4), (3, 0.1))}
    checks = [SensorCheck(Check.STRIPED_LIGHT, 1, others) for others in ((2, 3), (2,), (2, 4))]
    assert sensor_statistics(checks, {}, shares) == (0.1, 0.4, None)
    assert checks[1].nameable == (1, 2), "which of two cameras has light in half of its rows nobody knows"


def test_light_of_one_colour_names_its_camera_by_one_voter():
    assert SensorCheck(Check.COLOURED_LIGHT, 1, (2,)).nameable == (1,)


def conflict(others, **of_pairs):
    """The LiDAR's statistic by these cameras; pairs are called as p13."""
    counted = {of(Check.LIDAR_CONFLICT, int(name[1]), int(name[2]), 0): one for name, one in of_pairs.items()}
    return sensor_statistics([SensorCheck(Check.LIDAR_CONFLICT, 0, others)], counted, {})[0]


def test_conflicts_are_the_mean_of_the_pairs_of_the_voters_in_one_direction():
    strong, weak, none = (cells(4, patch(value, columns=slice(5, 11))) for value in (4, 2, 0))
    full = 144 / 184
    assert conflict((1, 2, 3), p13=strong, p23=weak) == pytest.approx(0.75 * full)
    assert conflict((1, 2, 3), p13=strong, p23=none) == pytest.approx(0.5 * full)
    assert conflict((1, 3), p13=strong, p23=none) == pytest.approx(full), "the pairs of other cameras do not count"
    assert conflict((1, 2), p13=strong, p23=strong) is None


def test_two_pairs_must_have_compared_a_direction_where_there_are_two():
    strong, nothing = cells(4, patch(4, columns=slice(5, 11))), cells(0, 0)
    assert conflict((1, 2, 3), p13=strong, p23=nothing) is None
    half = cells(patch(4, slice(0, ROWS), slice(0, 8)), 0)
    assert conflict((1, 2, 3), p13=cells(4, patch(4, columns=slice(0, 6))), p23=half) == pytest.approx(0.5 * 144 / 184)


def test_the_pseudo_count_of_conflicts_fits_the_beams():
    assert conflict((1, 2), p12=cells(1, 1)) == pytest.approx(36 / (36 + 18))


def test_statistics_that_need_no_grid_are_the_shares_that_came_ready():
    checks = [SensorCheck(check, 0, (3,)) for check in (Check.POINT_DROPOUT, Check.ISOLATED_POINTS)]
    assert sensor_statistics(checks, {}, {checks[0]: 0.25}) == (0.25, None)


@given(st.integers(0, 2**32 - 1), st.integers(2, 5))
@settings(max_examples=30, deadline=None, derandomize=True)
def test_statistics_are_between_0_and_1(seed, cameras):
    rng = np.random.default_rng(seed)
    pairs = [(i, k) for k in range(2, cameras + 1) for i in range(1, k)]
    counted = {}
    for i, k in pairs:
        for check in (Check.ADDED_LIGHT, Check.PHOTOMETRIC_INCONSISTENCY):
            for sensor in (i, k):
                valid = rng.integers(0, 17, (ROWS, COLUMNS)) * (rng.random((ROWS, COLUMNS)) < 0.8)
                lowest, steps = (-1, LIGHT_STEPS) if check is Check.ADDED_LIGHT else (0, 1)
                total = np.clip(np.rint(rng.uniform(lowest, 1) * valid * steps), -127, 127)
                counted[of(check, i, k, sensor)] = cells(valid, total)
        valid = rng.integers(0, 6, (ROWS, COLUMNS))
        counted[of(Check.LIDAR_CONFLICT, i, k, 0)] = cells(valid, rng.integers(0, valid + 1))
    checks = sensor_checks_of(tuple(pairs), tuple(pairs), ())
    found = dict(zip(checks, sensor_statistics(checks, counted, {}), strict=True))
    assert all(value is None or 0 <= value <= 1 for value in found.values())


@pytest.mark.parametrize(("check", "sign"), [(Check.REMOVED_LIGHT, -1), (Check.PHOTOMETRIC_INCONSISTENCY, 1)])
@given(st.lists(st.integers(0, 12), min_size=2, max_size=6))
@settings(max_examples=20, deadline=None, derandomize=True)
def test_one_more_voter_never_raises_what_the_others_say(check, sign, said):
    assert voted(check, *(sign * value for value in said)) <= voted(check, *(sign * value for value in said[:-1]))


def test_windows_are_those_of_the_parameters():
    assert (Window(6, 8, 200, 200), Window(6, 6, 40, 20)) == (CAMERA_WINDOW, CONFLICT_WINDOW)


def medians_of(values, stamp_ns):
    """Those of one column."""
    [found] = stretch_medians([values], stamp_ns)
    return found


def test_stretches_have_the_frames_of_their_seconds_at_any_rate():
    values = np.arange(400.0)
    for period_ns, frames in ((10**8, 50), (5 * 10**7, 100), (10**9, 9), (10**10, 9)):
        found = medians_of(values, np.arange(400) * period_ns)
        assert (found[0], found[-1]) == ((frames - 1) / 2, 399 - (frames - 1) / 2)
        assert (np.diff(found) <= max(0.2 * frames, 2)).all(), "each begins within the one before"


def test_an_hour_has_all_its_stretches_and_several_columns_have_their_own():
    values, stamps_ns = np.arange(36_000.0), np.arange(36_000) * 10**8
    found = list(stretch_medians([values, -values], stamps_ns))
    assert [one.size for one in found] == [3596, 3596]
    assert (found[0] == -found[1]).all()
    short = list(stretch_medians([values[:200], -values[:200], values[:200]], stamps_ns[:200]))
    assert [one[0] for one in short] == [24.5, -24.5, 24.5]


@pytest.mark.parametrize(
    ("values", "median"), [([1.0, np.nan, 3.0, 5.0], [3.0]), ([5.0, 1.0, 2.0, 9.0], [3.5]), ([np.nan] * 4, [])]
)
def test_a_stretch_is_the_median_of_what_was_measured_in_it(values, median):
    assert medians_of(np.array(values), np.arange(4) * 10**8).tolist() == median


def test_stretches_in_which_nothing_was_measured_have_no_median():
    values = np.full(200, np.nan)
    values[:10] = 2.0
    assert medians_of(values, np.arange(200) * 10**8).tolist() == [2.0]


@given(st.lists(st.floats(-30, 30), min_size=1, max_size=40), st.floats(0, 1))
def test_quantiles_and_medians_are_numpys_to_the_last_bit(values, share):
    for dtype in (np.float64, np.float32, np.int64):
        of_type = np.array(values).astype(dtype)
        assert quantile_of(np.sort(of_type), share) == np.quantile(of_type, share)
        assert median_of(np.sort(of_type)) == np.median(of_type)
    levels = np.abs(values).astype(np.uint8)
    assert quantile_of(np.sort(levels), share) == np.quantile(levels, share)


def test_a_drive_without_a_clock_is_one_stretch_and_none_has_none():
    assert medians_of(np.arange(60.0), np.zeros(60, dtype=np.int64)).tolist() == [29.5]
    assert medians_of(np.zeros(0), np.zeros(0, dtype=np.int64)).size == 0
