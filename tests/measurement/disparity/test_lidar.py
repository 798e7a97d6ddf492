from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from auditor.measurement import CalibrationMonitor, FaultFeatures, localise, measure
from auditor.measurement.disparity import lidar
from auditor.measurement.disparity.lidar import lidar_view
from auditor.measurement.disparity.matchers.sgbm import SgbmMatcher
from auditor.measurement.parameters import COUNT_GRID
from auditor.model.frames import PointCloud
from tests.making.scenes import FOCAL, HEIGHT, WIDTH, plane_cloud, plane_frame, plane_rig


def cloud(*points: tuple[float, float, float]) -> PointCloud:
    return PointCloud(0, np.array(points, dtype=np.float32).reshape(-1, 3))


def at(u: float, v: float, depth_m: float) -> tuple[float, float, float]:
    """The point that camera 3 sees there."""
    return depth_m, -(u - WIDTH / 2) / FOCAL * depth_m, -(v - HEIGHT / 2) / FOCAL * depth_m


def test_disparities_at_a_source_camera_follow_equation_1_where_the_optical_axes_are_parallel() -> None:
    rig = plane_rig((0.6, 0.3, 0.0))
    view = lidar_view(PointCloud(0, plane_cloud(9.0)), rig, 3)
    assert view.row.size == (WIDTH // 2) * (HEIGHT // 2)
    np.testing.assert_allclose(view.disparity_px(1), FOCAL * 0.6 / 9.0, atol=1e-3)
    np.testing.assert_allclose(view.disparity_px(2), FOCAL * 0.3 / 9.0, atol=1e-3)


def test_of_two_points_in_one_pixel_the_nearer_is_kept() -> None:
    view = lidar_view(cloud((20.0, 0.0, 0.0), (8.0, 0.0, 0.0), (12.0, 0.0, 0.0)), plane_rig(), 3)
    assert view.point_m[:, 0].tolist() == [8.0]
    assert view.returns == 3


def test_of_points_equally_near_in_one_pixel_one_is_kept_and_all_others_stay_as_they_are() -> None:
    rig, others = plane_rig(), [at(u, 10.0, 9.0 + u / 100) for u in range(10, 60, 5)]
    alone = lidar_view(cloud(*others), rig, 3)
    view = lidar_view(cloud((8.0, 0.0, 0.0), *others, (20.0, 0.0, 0.0), (8.0, 0.001, 0.0)), rig, 3)
    assert [x for x, y, z in view.point_m.tolist() if z == 0] == [8.0]
    np.testing.assert_array_equal(view.point_m[view.point_m[:, 2] != 0], alone.point_m)


def test_a_point_that_a_nearer_neighbour_hides_is_dropped_and_a_distant_one_is_not() -> None:
    near, hidden, beside = (8.0, 0.0, 0.0), (40.0, 0.4, 0.0), (40.0, 4.0, 0.0)  # 0, 3 and 30 px to the left
    view = lidar_view(cloud(near, hidden, beside), plane_rig(), 3)
    assert sorted(view.point_m[:, 1].tolist()) == [0.0, 4.0]


def test_points_behind_the_camera_or_outside_its_image_are_not_in_view() -> None:
    view = lidar_view(cloud((-8.0, 0.0, 0.0), (8.0, 30.0, 0.0), (8.0, 0.0, 30.0)), plane_rig(), 3)
    assert (view.row.size, view.returns) == (0, 0)


def test_a_cloud_without_points_gives_a_view_without_points() -> None:
    view = lidar_view(PointCloud(0, np.empty((0, 3), np.float32)), plane_rig(), 3)
    assert view.disparity_px(1).shape == (0,)


def test_a_full_projection_matrix_moves_columns_that_the_simple_equation_would_not() -> None:
    rig = plane_rig((0.6, 0.0))
    moved = rig.cameras[0].projection.copy()
    moved[2, 3] = -0.02  # the source's optical centre 2 cm nearer to the scene
    tilted = type(rig)(rig.lidar, (type(rig.cameras[0])(1, "", "", WIDTH, HEIGHT, moved), rig.cameras[1]))
    points = cloud((10.0, -4.0, 0.0))
    simple = lidar_view(points, rig, 2).disparity_px(1)
    full = lidar_view(points, tilted, 2).disparity_px(1)
    assert full[0] == pytest.approx(
        simple[0] - 0.02 * (FOCAL * 3.4 + WIDTH / 2 * 10) / 10 / 9.98 + WIDTH / 2 * 0.02 / 9.98, abs=0.4
    )
    assert abs(full[0] - simple[0]) > 0.15


def test_a_point_is_in_view_up_to_half_a_pixel_beyond_the_outer_pixels() -> None:
    inside = [at(-0.4, 60, 9), at(319.4, 60, 9), at(160, -0.4, 9), at(160, 119.4, 9)]
    outside = [at(-0.6, 60, 9), at(319.6, 60, 9), at(160, -0.6, 9), at(160, 119.6, 9)]
    view = lidar_view(cloud(*inside, *outside), plane_rig(), 3)
    assert sorted(zip(view.column.tolist(), view.row.tolist(), strict=True)) == [
        (0, 60),
        (160, 0),
        (160, 119),
        (319, 60),
    ]
    assert view.returns == 4
    assert sorted(view.u_px.tolist()) == pytest.approx([-0.4, 160, 160, 319.4], abs=1e-3)


def test_nothing_a_metre_from_the_camera_or_nearer_is_seen_wherever_the_lidar_stands() -> None:
    view = lidar_view(cloud(at(100, 60, 0.9), at(160, 60, 1.0), at(220, 60, 1.25)), plane_rig(), 3)
    assert view.column.tolist() == [220]
    rig = plane_rig()
    behind = rig.lidar.rig_SE3_lidar.copy()
    behind[2, 3] = -0.5
    view = lidar_view(
        cloud((1.4, 0.0, 0.0), (1.75, 0.5, 0.0)), replace(rig, lidar=replace(rig.lidar, rig_SE3_lidar=behind)), 3
    )
    assert view.point_m[:, 0].tolist() == [1.75]


@pytest.mark.parametrize(
    ("right", "down", "hidden"),
    [
        (4, 0, True),
        (-4, 0, True),
        (0, 7, True),
        (0, -7, True),
        (4, 7, True),
        (5, 0, False),
        (-5, 0, False),
        (0, 8, False),
        (0, -8, False),
    ],
)
def test_a_near_point_hides_what_is_within_four_columns_and_seven_rows(right: int, down: int, hidden: bool) -> None:
    view = lidar_view(cloud(at(160, 60, 6.0), at(160 + right, 60 + down, 9.0)), plane_rig(), 3)
    assert view.row.size == 2 - hidden


@pytest.mark.parametrize(("depth_m", "kept"), [(12.0, 2), (12.2, 1)])
def test_a_point_is_hidden_by_one_nearer_by_more_than_three_pixels_at_sixty_centimetres(
    depth_m: float, kept: int
) -> None:
    # 300 px 0.6 m make 18 px at 10 m, 15 at 12 m and 14.75 at 12.2 m.
    view = lidar_view(cloud(at(160, 60, 10.0), at(161, 60, depth_m)), plane_rig(), 3)
    assert view.row.size == kept


def test_all_checks_of_a_frame_project_its_points_once_into_each_camera_of_a_view(monkeypatch) -> None:
    rig, projected, project = plane_rig((0.6, 0.3, 0.0)), [], lidar._project
    monkeypatch.setattr(lidar, "_project", lambda P, points: projected.append(P.tobytes()) or project(P, points))
    _, evidence = measure(plane_frame(rig), rig, SgbmMatcher())
    CalibrationMonitor().add(evidence, FaultFeatures().update(evidence))
    localise(evidence, rig.sensors, rig)
    assert sorted(evidence.lidar) == [2, 3]
    # In the view of S_3 into S_3, S_2 and S_1, in that of S_2 into S_2 and S_1.
    assert sorted(Counter(projected).values()) == [1, 2, 2]


@pytest.mark.parametrize(("beside", "looks_ahead"), [(1, True), (2, False)])
def test_a_lidar_looks_ahead_where_two_in_a_thousand_points_at_most_are_behind_the_camera(
    beside: int, looks_ahead: bool
) -> None:
    points = [(-8.0, 0.0, 0.0)] * beside + [(0.0, 8.0, 0.0)] * 10 + [(8.0, 0.0, 0.0)] * (490 - beside)
    assert lidar_view(cloud(*points), plane_rig(), 3).looks_ahead is looks_ahead, "beside it is not behind it"


def test_the_directions_of_points_are_cells_of_a_grid_straight_ahead_of_the_lidar() -> None:
    rows, columns = COUNT_GRID.lidar_cells
    row, column = np.array([-1, 0, rows - 1, rows, 0, 0, 0, 0]), np.array([0, 0, 0, 0, -1, 0, columns - 1, columns])
    down, right = ((place + 0.5 - n // 2) * COUNT_GRID.lidar_cell for place, n in ((row, rows), (column, columns)))
    points = np.stack([np.cos(right), -np.sin(right), -np.tan(down)], axis=1).astype(np.float32)
    view = replace(lidar_view(cloud(), plane_rig(), 3), point_m=9 * points)
    found = view.directions
    np.testing.assert_array_equal(found[:2], (row, column))
    assert found[2].tolist() == [False, True, True, False, False, True, True, False]
