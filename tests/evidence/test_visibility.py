import numpy as np

from auditor.evidence.lidar import LidarView
from auditor.evidence.visibility import visible_to_witness
from tests.evidence.scenes import FOCAL, plane_rig


def view_of(columns, rows, depths):
    """Points at given pixels and depths, as the leftmost camera at x = 0 sees them."""
    u, v, z = (np.array(values, dtype=np.float32) for values in (columns, rows, depths))
    return LidarView(3, u.astype(np.int32), v.astype(np.int32), u, np.zeros((u.size, 3), np.float32), u.size), (
        FOCAL * 0.6 / z
    ).astype(np.float32)


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
