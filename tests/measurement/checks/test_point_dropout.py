import numpy as np
import pytest

from auditor.measurement.checks.point_distribution import point_dropout
from auditor.measurement.disparity.lidar import lidar_view
from auditor.model.frames import PointCloud
from tests.making.scenes import WIDTH, plane_cloud, plane_rig


def dropout_of(cloud):
    return point_dropout(lidar_view(PointCloud(0, cloud), plane_rig(), 3), WIDTH)


def test_an_even_cloud_lacks_nothing():
    assert dropout_of(plane_cloud(9.0)) == pytest.approx(0, abs=0.01)


def test_a_removed_sector_as_wide_as_a_strip_lacks_everything():
    cloud = plane_cloud(9.0)  # 120 px at 300 px and 9 m are 3.6 m
    assert dropout_of(cloud[np.abs(cloud[:, 1]) > 1.8]) == 1.0


def test_a_thinned_sector_lacks_some():
    cloud = plane_cloud(9.0)
    inside = cloud[:, 1] > 3.0  # the leftmost 60 px of 320
    assert dropout_of(cloud[~inside | (np.arange(len(cloud)) % 2 == 0)]) == pytest.approx(0.5 * 60 / 104, abs=0.02)


BEHIND = np.array([[-5.0, y, 0.0] for y in np.linspace(-9, 9, 500)], np.float32)


def test_beyond_the_field_of_a_lidar_that_looks_ahead_nothing_lacks():
    cloud = plane_cloud(9.0)
    ahead = cloud[np.abs(cloud[:, 1]) < 4.2]  # 280 of 320 px
    assert dropout_of(ahead) == pytest.approx(0, abs=0.01)
    assert dropout_of(ahead[np.abs(ahead[:, 1]) > 1.8]) == 1.0, "a hole within its field"


def test_where_a_lidar_looks_back_too_a_side_without_points_lacks_all():
    cloud = plane_cloud(9.0)
    assert dropout_of(np.concatenate([cloud[np.abs(cloud[:, 1]) < 4.2], BEHIND])) > 0.15


def test_a_handful_of_points_is_no_field():
    cloud = plane_cloud(9.0)
    assert dropout_of(cloud[np.abs(cloud[:, 1]) < 1.2]) == 1.0


def test_a_view_without_points_lacks_all():
    assert dropout_of(np.zeros((0, 3), np.float32)) == 1.0
