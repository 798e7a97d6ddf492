import numpy as np
import pytest

from auditor.measurement.disparity.disparity_error import compare_cameras, compare_with_lidar, inconsistent
from auditor.measurement.disparity.stereo import StereoMap
from auditor.model.measurement import Counts, Statistic
from tests.making.scenes import WrittenDown, plane_rig


def stereo(disparity: list[list[float]], textured: bool = True) -> StereoMap:
    values = np.array(disparity, dtype=np.float32)
    return StereoMap(values, ~np.isnan(values), np.full(values.shape, textured), 2, 128)


@pytest.mark.parametrize(
    ("d1", "d2", "expected"),
    [
        (10.0, 13.0, False),  # exactly 3 px is not more than 3 px
        (10.0, 13.01, True),
        (100.0, 104.9, False),  # 4.9 % of the smaller
        (100.0, 105.0, False),  # exactly 5 % is not more than 5 %
        (100.0, 105.1, True),
        (105.1, 100.0, True),
        (0.0, 3.5, True),  # a minimum of zero counts as over
        (-1.0, 2.5, True),
        (-1.0, 1.5, False),
        (float("nan"), 50.0, False),
    ],
)
def test_a_pixel_is_inconsistent_when_it_is_over_both_bounds_of_equation_2(
    d1: float, d2: float, expected: bool
) -> None:
    assert inconsistent(np.float32([d1]), np.float32([d2])).tolist() == [expected]


def test_maps_are_compared_at_the_smaller_baseline() -> None:
    # 60 px at 0.6 m and 6 px at 0.06 m are the same depth; 40 px off at 0.6 m is 4 px off at 0.06 m.
    wide, narrow = stereo([[60.0, 100.0, 60.0]]), stereo([[6.0, 6.0, 8.0]])
    assert compare_cameras(wide, narrow, 0.6, 0.06).counts.inconsistent_px == 1
    assert compare_cameras(narrow, wide, 0.06, 0.6).counts.inconsistent_px == 1


def test_pixels_whose_match_is_unknown_in_either_map_do_not_count() -> None:
    comparison = compare_cameras(stereo([[10, np.nan, 30, 10]]), stereo([[10, 10, np.nan, 20]]), 0.5, 0.5)
    assert (comparison.counts.valid_px, comparison.counts.inconsistent_px) == (2, 1)


def test_the_gate_opens_where_either_pair_has_texture() -> None:
    smooth = stereo([[10, 10]], textured=False)
    rough = StereoMap(np.float32([[20, 20]]), np.array([[True, True]]), np.array([[True, False]]), 2, 128)
    comparison = compare_cameras(smooth, rough, 0.5, 0.5)
    assert (comparison.counts.inconsistent_px, comparison.counts.gated_inconsistent_px) == (2, 1)
    assert (comparison.counts.gated_valid_px, comparison.column.tolist()) == (1, [0])


def test_lidar_points_are_counted_as_worked_out_by_hand() -> None:
    disparity = np.full((2, 5), 10, dtype=np.float32)
    valid, textured = np.ones((2, 5), np.bool_), np.ones((2, 5), np.bool_)
    valid[0, 1] = False
    textured[:, :2] = False
    stereo = StereoMap(disparity, valid, textured, 2, 16)  # beyond 13 px it is not to be trusted
    # row, column, exact column, disparity
    points = np.array(
        [
            (0, 0, 10.0, 10.0),  # valid, its match in column 0; no texture
            (0, 2, 30.0, 20.0),  # stereo has nothing there
            (1, 5, 20.0, 13.5),  # 3.5 px off, and out of range
            (3, 6, 9.0, 9.5),  # its match lies left of the source image
            (2, 9, 20.0, 13.0),  # 3 px off, and just in range
            (2, 0, 30.0, 6.0),  # 4 px off; no texture
        ]
    )
    row, column, u, d0 = points.T
    view = WrittenDown(
        3, column.astype(np.int32), row.astype(np.int32), u.astype(np.float32), np.zeros((6, 3), np.float32), 6,
        plane_rig(), np.zeros((6, 3), np.float32), (0, 320), False, np.zeros((6, 3), np.float32), d0.astype(np.float32),
    )  # fmt: skip
    comparison = compare_with_lidar(view, stereo, 1)
    assert comparison.counts == Counts(
        valid_px=4, inconsistent_px=2, gated_valid_px=2, gated_inconsistent_px=1, out_of_range_px=1
    )
    assert (comparison.row.tolist(), comparison.column.tolist(), comparison.step) == ([0], [2], 2)


def test_cameras_have_no_pixels_out_of_range() -> None:
    comparison = compare_cameras(stereo([[10, 20]]), stereo([[10, 10]]), 0.5, 0.5)
    assert comparison.counts == Counts(2, 1, 2, 1, out_of_range_px=0)


@pytest.mark.parametrize(("valid_px", "E"), [(199, None), (200, 0.25), (201, 50 / 201)])
def test_an_error_needs_two_hundred_valid_pixels(valid_px: int, E: float | None) -> None:
    for statistic, counts in (("plain", Counts(valid_px, 50, 0, 0, 0)), ("gated", Counts(999, 9, valid_px, 50, 0))):
        assert counts.disparity_error(Statistic(statistic)) == E
