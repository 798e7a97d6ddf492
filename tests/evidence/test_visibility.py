import numpy as np

from auditor.evidence.lidar import LidarView, lidar_view
from auditor.evidence.specks import isolated
from auditor.evidence.visibility import Reach, too_near, visible_to_witness
from auditor.frames import PointCloud
from tests.evidence.scenes import FOCAL, HEIGHT, WIDTH, plane_cloud, plane_rig

MATCHER = Reach(115.2, 128)


def view_of(columns, rows, depths):
    """Points at given pixels and depths, as the leftmost camera at x = 0 sees them."""
    u, v, z = (np.array(values, dtype=np.float32) for values in (columns, rows, depths))
    column, row, nowhere = u.astype(np.int32), v.astype(np.int32), np.zeros((u.size, 3), np.float32)
    return LidarView(3, column, row, u, nowhere, u.size, plane_rig()), (FOCAL * 0.6 / z).astype(np.float32)


def test_a_point_behind_a_near_one_in_the_witness_s_image_is_hidden_from_it():
    # In the witness both fall into column 140: 150 - 10 and 200 - 60.
    view, d0 = view_of([150, 200], [60, 60], [18, 3])
    assert visible_to_witness(view, plane_rig(), 1, d0).tolist() == [False, True]


def test_points_side_by_side_in_the_witness_s_image_hide_nothing():
    view, d0 = view_of([150, 230], [60, 60], [18, 3])
    assert visible_to_witness(view, plane_rig(), 1, d0).all()


def test_a_slope_of_less_than_three_pixels_hides_nothing():
    view, d0 = view_of([150, 152], [60, 60], [18, 15])
    assert visible_to_witness(view, plane_rig(), 1, d0).all()


def test_a_point_outside_the_witness_s_image_is_not_visible_to_it():
    view, d0 = view_of([5, 200], [60, 60], [9, 9])
    assert visible_to_witness(view, plane_rig(), 1, d0).tolist() == [False, True]


def test_the_scale_is_that_of_a_baseline_of_sixty_centimetres():
    # At a baseline of 0.3 m the same two points differ by half as many pixels; what hides them does not change.
    view, d0 = view_of([145, 170], [60, 60], [18, 3])
    assert visible_to_witness(view, plane_rig(), 2, d0 / 2).tolist() == [False, True]


def nothing(view):
    return np.zeros(view.row.size, dtype=np.bool_)


def test_what_is_too_near_to_be_matched_and_what_it_hides_to_its_left_is_masked():
    cloud = plane_cloud(1.5)  # 300 px 0.6 m / 1.5 m = 120 px
    right = cloud[:, 1] < -0.2
    view = lidar_view(PointCloud(0, cloud[right]), plane_rig(), 3)
    mask = too_near(view, nothing(view), 1, MATCHER, (HEIGHT // 2, WIDTH // 2))
    edge = int(view.column.min()) // 2
    assert mask[30, edge + 4 :].all()
    assert mask[30, edge - 60 : edge].all()
    assert not mask[:, : edge - 75].any()


def test_nothing_is_masked_where_everything_can_be_matched():
    view = lidar_view(PointCloud(0, plane_cloud(2.0)), plane_rig(), 3)  # 90 px
    assert not too_near(view, nothing(view), 1, MATCHER, (HEIGHT // 2, WIDTH // 2)).any()


def test_drops_that_stand_alone_hide_nothing():
    view = lidar_view(PointCloud(0, plane_cloud(1.5)[::97]), plane_rig(), 3)
    alone = isolated(view, plane_rig().camera(3).focal_px)
    assert alone.any()
    size = HEIGHT // 2, WIDTH // 2
    assert too_near(view, nothing(view), 1, MATCHER, size).any()
    assert not too_near(view, alone, 1, MATCHER, size).any()
