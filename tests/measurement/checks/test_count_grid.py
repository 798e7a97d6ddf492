from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from auditor.measurement.checks.lidar_conflict import VerifiedConflicts, cells_of_points
from auditor.measurement.checks.photometric_consistency import Matches
from auditor.measurement.count_grid import (
    ImageGrid,
    opposite,
    places_of,
    sums_of_pair,
    sums_of_some,
)
from auditor.measurement.disparity.lidar import lidar_view
from auditor.model.frames import PointCloud
from auditor.model.measurement import LIGHT_STEPS
from tests.making.scenes import FOCAL, plane_cloud, plane_rig

ROWS, COLUMNS = 80, 160
CELL_RAD = 8 / 721


def matches(height, width, shift=0.0):
    column = np.broadcast_to(np.arange(width, dtype=np.float32) - np.float32(shift), (height, width)).copy()
    return Matches(column, np.ones((height, width), dtype=np.bool_))


def cells_of_pair(found, valid, amount, steps, grid):
    return sums_of_pair(places_of(found, grid), valid, [amount], steps)[0].cells


def by_hand(values, rows, columns):
    """The sums of each 4 x 4 half-resolution pixels."""
    return [[values[4 * r : 4 * r + 4, 4 * c : 4 * c + 4].sum() for c in range(columns)] for r in range(rows)]


@given(st.integers(1, 30), st.integers(1, 40), st.integers(0, 12), st.integers(0, 1000))
@settings(max_examples=40, deadline=None)
def test_each_valid_pixel_is_counted_once_in_each_image(height, width, shift, seed):
    rng = np.random.default_rng(seed)
    valid = (rng.random((height, width)) < 0.6) & (np.arange(width) >= shift)
    wrong = valid & (rng.random((height, width)) < 0.3)
    grid = ImageGrid.of(height, width)
    cells = cells_of_pair(
        matches(height, width, shift), valid, wrong if seed % 2 else wrong.astype(np.float32), 1, grid
    )
    shape = -(-height // 4), -(-width // 4)
    for image in (cells.source, cells.reference):
        assert image.valid.shape == image.total.shape == shape
        assert (image.valid.dtype, image.total.dtype) == (np.uint8, np.int8)
        assert image.valid.sum() == valid.sum()
        assert image.total.sum() == wrong.sum()
    assert cells.reference.valid.tolist() == by_hand(valid, *shape)
    assert cells.reference.total.tolist() == by_hand(wrong, *shape)
    there = np.roll(valid, -shift, axis=1)
    assert cells.source.valid.tolist() == by_hand(there, *shape)


def test_a_match_is_counted_in_the_source_s_nearest_pixel_and_beyond_its_edge_at_the_edge():
    valid = np.zeros((4, 16), dtype=np.bool_)
    valid[0, [4, 8, 12]] = True
    found = Matches(np.full((4, 16), -1, np.float32), valid.copy())
    found.column[0, [4, 8, 12]] = 3.4, 3.6, -0.4
    grid = ImageGrid.of(4, 16)
    assert cells_of_pair(found, valid, valid.astype(np.float32), 1, grid).source.valid.tolist() == [[2, 1, 0, 0]]


def test_sums_of_residuals_are_stored_in_steps_and_turned_round_in_the_source():
    residual = np.zeros((4, 16), dtype=np.float32)
    residual[:, 8:12] = 0.5
    valid = np.ones((4, 16), dtype=np.bool_)
    cells = opposite(cells_of_pair(matches(4, 16, 4), valid, residual, LIGHT_STEPS, ImageGrid.of(4, 16)))
    assert cells.reference.total.tolist() == [[0, 0, 8 * LIGHT_STEPS, 0]]
    assert cells.source.total.tolist() == [[0, -8 * LIGHT_STEPS, 0, 0]]
    assert cells.source.valid.tolist() == [[32, 16, 16, 0]]


def test_turning_round_changes_the_source_s_sums_alone():
    cells = cells_of_pair(matches(4, 8), np.ones((4, 8), np.bool_), np.ones((4, 8), np.float32), 1, ImageGrid.of(4, 8))
    turned = opposite(cells)
    assert turned.reference is cells.reference
    assert turned.source.valid.tolist() == cells.source.valid.tolist()
    assert turned.source.total.tolist() == [[-16, -16]]


@pytest.mark.parametrize(("amount", "stored"), [(1.0, 127), (-1.0, -127), (0.5, 64), (-0.5, -64)])
def test_a_stored_sum_stops_at_what_a_byte_holds(amount, stored):
    valid = np.ones((4, 4), dtype=np.bool_)
    amounts = np.full((4, 4), amount, dtype=np.float32)
    for image in (lambda cells: cells.reference, lambda cells: cells.source):
        cells = cells_of_pair(matches(4, 4), valid, amounts, 8, ImageGrid.of(4, 4))
        assert image(cells).total.tolist() == [[stored]]


def test_a_source_s_cell_that_many_matches_fall_into_stops_at_what_a_byte_holds():
    valid = np.ones((4, 200), dtype=np.bool_)
    everywhere = Matches(np.full((4, 200), 5, np.float32), valid)
    source = cells_of_pair(everywhere, valid, -valid.astype(np.float32), 1, ImageGrid.of(4, 200)).source
    assert source.valid[0, 1] == 127
    assert source.total[0, 1] == -127


def test_pairs_with_views_of_their_own_are_counted_in_their_cameras_images():
    # The pair's view is turned by half a turn: its first pixel is the image's last; and two columns lie outside.
    row, column = np.mgrid[:8, :12]
    grid = ImageGrid.elsewhere(8, 12, 7 - row, 11 - column - 2)
    assert (grid.rows, grid.columns) == (2, 3)
    valid = np.zeros((8, 12), dtype=np.bool_)
    valid[0, 0] = valid[1, 1] = valid[7, 9] = valid[7, 10] = True
    cells = cells_of_pair(matches(8, 12), valid, valid.astype(np.float32), 1, grid)
    for image in (cells.reference, cells.source):
        assert image.valid.tolist() == [[1, 0, 0], [0, 0, 2]]
        assert image.total.tolist() == [[1, 0, 0], [0, 0, 2]]


def test_a_view_that_is_the_image_itself_counts_the_same_either_way():
    rng = np.random.default_rng(4)
    row, column = np.mgrid[:13, :22]
    valid = rng.random((13, 22)) < 0.5
    amount = np.where(valid, rng.uniform(-1, 1, (13, 22)), 0).astype(np.float32)
    direct, looked_up = (
        cells_of_pair(matches(13, 22, 3), valid, amount, LIGHT_STEPS, grid)
        for grid in (ImageGrid.of(13, 22), ImageGrid.elsewhere(13, 22, row, column))
    )
    for image in ("source", "reference"):
        one, other = getattr(direct, image), getattr(looked_up, image)
        assert one.valid.tolist() == other.valid.tolist()
        assert one.total.tolist() == other.total.tolist()


@pytest.mark.parametrize("share", [0, 0.1, 0.9, 1])
@pytest.mark.parametrize("elsewhere", [False, True])
def test_what_is_left_without_some_pixels_is_counted_as_if_they_were_not_there(share, elsewhere):
    rng = np.random.default_rng(5)
    row, column = np.mgrid[:13, :22]
    grid = ImageGrid.elsewhere(13, 22, row - 2, column + 3) if elsewhere else ImageGrid.of(13, 22)
    places = places_of(matches(13, 22, 3), grid)
    valid, hidden = rng.random((13, 22)) < 0.7, rng.random((13, 22)) < share
    residual = np.where(valid, rng.uniform(-1, 1, (13, 22)), 0).astype(np.float32)
    for amounts, steps in (([valid & (residual > 0.5)], 1), ([residual, residual * (residual > 0.5)], LIGHT_STEPS)):
        some = sums_of_some(places, np.flatnonzero(hidden), valid, amounts, steps)
        whole = sums_of_pair(places, valid, amounts, steps)
        for amount, of_all, of_some in zip(amounts, whole, some, strict=True):
            left = of_all.without(of_some).cells
            shown = np.where(hidden, amount.dtype.type(0), amount)
            (expected,) = sums_of_pair(places, valid & ~hidden, [shown], steps)
            for image in ("source", "reference"):
                one, other = getattr(left, image), getattr(expected.cells, image)
                assert one.valid.tolist() == other.valid.tolist()
                assert one.total.tolist() == other.total.tolist()


def towards(rows_down, columns_right, range_m=10.0):
    """A point of the LiDAR in the middle of a cell so many rows below and columns right of the first ones ahead."""
    right, down = (columns_right + 0.5) * CELL_RAD, (rows_down + 0.5) * CELL_RAD
    x, z = np.sin(right), np.cos(right)
    return range_m * z, -range_m * x, -range_m * np.tan(down)


def conflicts_of(points, valid, conflicting, reference=3):
    rig = plane_rig()
    view = lidar_view(PointCloud(0, np.array(points, dtype=np.float32)), rig, reference)
    assert view.row.size == len(points)
    order = [int(np.argmin(np.abs(np.array(points) - point).sum(axis=1))) for point in view.point_m]
    at = VerifiedConflicts(view.row, view.column, np.array(valid)[order], np.array(conflicting)[order])
    return cells_of_points(at, view)


def test_points_are_counted_by_their_direction_from_the_lidar():
    points = [towards(0, 0), towards(1.7, 4.7), towards(2.3, 5.3), towards(-3, -20)]
    cells = conflicts_of(points, [True, True, True, True], [False, True, True, False])
    assert cells.valid.shape == (ROWS, COLUMNS)
    middle = ROWS // 2, COLUMNS // 2
    expected = {(0, 0): (1, 0), (2, 5): (2, 2), (-3, -20): (1, 0)}
    for (row, column), (valid, total) in expected.items():
        at = middle[0] + row, middle[1] + column
        assert (cells.valid[at], cells.total[at]) == (valid, total)
    assert cells.valid.sum() == 4
    assert cells.total.sum() == 2


def test_points_that_are_not_valid_are_not_counted():
    cells = conflicts_of([towards(0, 0), towards(0, 3)], [True, False], [True, False])
    assert cells.valid.sum() == cells.total.sum() == 1


def test_all_views_count_a_point_in_the_same_cell():
    points = [towards(0, 0, 6.0), towards(4, -12, 9.0), towards(-6, 15, 14.0)]
    first, second = (conflicts_of(points, [True] * 3, [True, False, True], k) for k in (2, 3))
    assert first.valid.tolist() == second.valid.tolist()
    assert first.total.tolist() == second.total.tolist()


def test_directions_beyond_the_grid_are_left_out():
    # Eighty columns are 51 degrees; the plane rig's image ends at 28. A wide camera sees further.
    far = (1.0, -2.0, 0.0)
    near = (10.0, 0.05, 0.05)
    rig = plane_rig((0.6, 0.0))
    wide = type(rig)(rig.lidar, tuple(type(c)(c.number, "", "", 2000, 120, c.projection) for c in rig.cameras))
    points = np.array([far, near], dtype=np.float32) * 4
    assert abs(far[1] / far[0]) * FOCAL < 2000
    view = lidar_view(PointCloud(0, points), wide, 2)
    assert view.row.size == 2
    flags = np.ones(2, dtype=np.bool_)
    cells = cells_of_points(VerifiedConflicts(view.row, view.column, flags, flags), view)
    assert cells.valid.sum() == cells.total.sum() == 1


def test_a_cell_of_very_many_points_stops_at_what_a_byte_holds():
    view = lidar_view(PointCloud(0, plane_cloud(9.0)), plane_rig(), 3)
    together = replace(view, point_m=np.tile(np.float32([9.0, 0.01, 0.01]), (view.row.size, 1)))
    flags = np.ones(view.row.size, dtype=np.bool_)
    cells = cells_of_points(VerifiedConflicts(view.row, view.column, flags, flags), together)
    assert view.row.size > 127
    assert cells.valid.max() == cells.total.max() == 127


def test_what_lies_just_outside_another_view_is_counted_in_no_cell_of_it():
    row, column = np.array([[0, 5, 0, -1, 6, 0, 0]]), np.array([[0, 9, 10, 0, 0, -1, 9]])
    grid = ImageGrid.elsewhere(6, 10, row, column)
    assert (grid.rows, grid.columns) == (2, 3)
    assert grid.place.tolist() == [0, 5, 6, 6, 6, 6, 2]


def test_a_match_in_another_view_is_counted_where_its_column_lies_in_the_camera_s_own_image():
    row, column = np.zeros((1, 4), np.intp), np.array([[3, 4, 8, 12]])
    grid = ImageGrid.elsewhere(4, 16, row, column)
    found = Matches(np.array([[-0.4, 1.4, 1.6, 9.0]], np.float32), np.ones((1, 4), dtype=np.bool_))
    assert places_of(found, grid).source.tolist() == [0, 1, 2, 3]
