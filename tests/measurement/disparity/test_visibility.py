from dataclasses import replace

import numpy as np
import pytest

from auditor.measurement.checks.point_distribution import isolated
from auditor.measurement.disparity.lidar import LidarView, RangeMask, lidar_view, out_of_range, visible_to_source
from auditor.model.frames import PointCloud
from tests.making.scenes import FOCAL, HEIGHT, WIDTH, WrittenDown, plane_cloud, plane_rig

MATCHER = RangeMask(115.2, 128)


def view_of(columns, rows, depths):
    """Points at given pixels and depths, as the leftmost camera at x = 0 sees them."""
    u, v, z = (np.array(values, dtype=np.float32) for values in (columns, rows, depths))
    column, row, nowhere = u.astype(np.int32), v.astype(np.int32), np.zeros((u.size, 3), np.float32)
    return LidarView(3, column, row, u, nowhere, u.size, plane_rig(), nowhere, (0, WIDTH), False, nowhere), (
        FOCAL * 0.6 / z
    ).astype(np.float32)


def test_a_point_behind_a_near_one_in_the_source_image_is_occluded():
    # In the source both fall into column 140: 150 - 10 and 200 - 60.
    view, d0 = view_of([150, 200], [60, 60], [18, 3])
    assert visible_to_source(view, plane_rig(), 1, d0).tolist() == [False, True]


def test_points_side_by_side_in_the_source_image_occlude_nothing():
    view, d0 = view_of([150, 230], [60, 60], [18, 3])
    assert visible_to_source(view, plane_rig(), 1, d0).all()


def test_a_slope_of_less_than_three_pixels_occludes_nothing():
    view, d0 = view_of([150, 152], [60, 60], [18, 15])
    assert visible_to_source(view, plane_rig(), 1, d0).all()


def test_a_point_outside_the_source_image_is_not_visible_to_it():
    view, d0 = view_of([5, 200], [60, 60], [9, 9])
    assert visible_to_source(view, plane_rig(), 1, d0).tolist() == [False, True]


def test_the_scale_is_that_of_a_baseline_of_sixty_centimetres():
    # At a baseline of 0.3 m the same two points differ by half as many pixels; what hides them does not change.
    view, d0 = view_of([145, 170], [60, 60], [18, 3])
    assert visible_to_source(view, plane_rig(), 2, d0 / 2).tolist() == [False, True]


def seen(u, rows, d0, rig=None):
    """Which of the points at these columns and rows of S_3 are visible to S_1, given their disparities."""
    view, _ = view_of(u, rows, np.ones(len(u)))
    view = replace(view, u_px=np.float32(u))
    return visible_to_source(view, rig or plane_rig(), 1, np.float32(d0)).tolist()


@pytest.mark.parametrize(
    ("right", "down", "visible"),
    [
        *((1, 0, False), (-1, 0, False), (0, 3, False), (0, -3, False), (1, 3, False)),
        *((2, 0, True), (-2, 0, True), (0, 4, True), (0, -4, True)),
    ],
)
def test_a_near_point_hides_what_is_within_one_column_and_three_rows_at_half_resolution(right, down, visible):
    assert seen([200, 150 + 2 * right], [60, 60 + 2 * down], [60, 10]) == [True, visible]


@pytest.mark.parametrize(("d0", "visible"), [(57.0, True), (56.5, False)])
def test_a_point_is_hidden_by_one_nearer_by_more_than_three_pixels(d0, visible):
    assert seen([200, 140 + d0], [60, 60], [60, d0]) == [True, visible]


@pytest.mark.parametrize(("column", "visible"), [(-1.1, False), (-0.9, True), (318.9, True), (319.0, False)])
def test_a_point_is_visible_as_far_as_the_source_s_half_resolution_image_goes(column, visible):
    assert seen([column + 4], [60], [4]) == [visible]


def test_points_in_the_outermost_columns_and_rows_stay_where_they_are():
    # Two columns or four rows from the near point nothing is hidden, at the edges of the image either.
    assert seen([60, 14], [60, 60], [60, 10]) == [True, True]
    assert seen([378, 324], [60, 60], [60, 10]) == [True, True]
    assert seen([200, 150], [118, 110], [60, 10]) == [True, True]


@pytest.mark.parametrize(("d0", "visible"), [(28.5, True), (28.25, False)])
def test_half_the_baseline_is_half_the_difference(d0, visible):
    view, _ = view_of([200, 200], [60, 60], [1, 1])
    view = replace(view, u_px=np.float32([200, 170 + d0]))
    assert visible_to_source(view, plane_rig(), 2, np.float32([30, d0])).tolist() == [True, visible]


def test_a_point_left_of_the_source_image_occludes_nothing():
    assert seen([50, 3], [60, 60], [60, 2]) == [False, True]


def test_rows_below_a_lower_source_count_as_its_last():
    rig = plane_rig()
    lower = replace(rig, cameras=(replace(rig.cameras[0], height_px=99), *rig.cameras[1:]))
    assert seen([200, 150, 150], [98, 119, 80], [60, 10, 10], lower) == [True, False, True]


def test_the_range_mask_is_that_worked_out_by_hand():
    # One point a little over the limit at row 30, column 100 of the half-resolution grid; the others are not.
    rows, columns = np.int32([60, 60, 100]), np.int32([200, 40, 100])
    points = np.zeros((3, 3), np.float32)
    d0 = np.float32([116, 115, 120])
    view = WrittenDown(
        3, columns, rows, np.float32(columns), points, 3, plane_rig(), points, (0, WIDTH), False, points, d0
    )
    mask = out_of_range(view, np.array([False, False, True]), 1, RangeMask(115.0, 20), (60, 160))
    expected = np.zeros((60, 160), dtype=np.bool_)
    expected[30 - 8 : 30 + 9, 100 - 8 - 9 : 100 + 9] = True
    np.testing.assert_array_equal(mask, expected)


def nothing(view):
    return np.zeros(view.row.size, dtype=np.bool_)


def test_what_is_out_of_range_and_what_it_occludes_to_its_left_is_masked():
    cloud = plane_cloud(1.5)  # 300 px 0.6 m / 1.5 m = 120 px
    right = cloud[:, 1] < -0.2
    view = lidar_view(PointCloud(0, cloud[right]), plane_rig(), 3)
    mask = out_of_range(view, nothing(view), 1, MATCHER, (HEIGHT // 2, WIDTH // 2))
    edge = int(view.column.min()) // 2
    assert mask[30, edge + 4 :].all()
    assert mask[30, edge - 60 : edge].all()
    assert not mask[:, : edge - 75].any()


def test_nothing_is_masked_where_everything_can_be_matched():
    view = lidar_view(PointCloud(0, plane_cloud(2.0)), plane_rig(), 3)  # 90 px
    assert not out_of_range(view, nothing(view), 1, MATCHER, (HEIGHT // 2, WIDTH // 2)).any()


def test_drops_that_stand_alone_occlude_nothing():
    view = lidar_view(PointCloud(0, plane_cloud(1.5)[::97]), plane_rig(), 3)
    alone = isolated(view, plane_rig().camera(3).focal_px)
    assert alone.any()
    size = HEIGHT // 2, WIDTH // 2
    assert out_of_range(view, nothing(view), 1, MATCHER, size).any()
    assert not out_of_range(view, alone, 1, MATCHER, size).any()
