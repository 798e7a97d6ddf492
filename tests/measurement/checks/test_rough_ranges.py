import numpy as np
import pytest

from auditor.lab.attacks.spoofing import ChangedRanges
from auditor.measurement.checks.point_distribution import rough_ranges
from auditor.measurement.disparity.lidar import lidar_view
from auditor.model.frames import PointCloud
from tests.making.scenes import FOCAL, plane_cloud, plane_rig

RIG = plane_rig()
DEPTH_M = 9.0


def roughness(xyz):
    return rough_ranges(lidar_view(PointCloud(0, np.asarray(xyz, dtype=np.float32)), RIG, 3), FOCAL)


def jittered(xyz, noise_m, width_deg=10.0, azimuth_deg=5.0):
    attack = ChangedRanges(width_deg, azimuth_deg, noise_m=noise_m, seed=1)
    return attack.apply(PointCloud(0, np.asarray(xyz, dtype=np.float32)), RIG).xyz_m


def noisy(xyz, noise_m=0.02):
    """The ranges with the usual noise of a LiDAR."""
    return jittered(xyz, noise_m, width_deg=360.0)


def beams(xyz, count):
    rows = np.unique(xyz[:, 2])
    return xyz[np.isin(xyz[:, 2], rows[:: max(len(rows) // count, 1)])]


def test_a_smooth_cloud_is_not_rough_and_a_jittery_sector_is():
    cloud = noisy(plane_cloud(DEPTH_M))
    assert roughness(cloud) < 0.1
    assert roughness(jittered(cloud, 0.3)) > 0.4
    assert roughness(jittered(cloud, 1.0)) > roughness(jittered(cloud, 0.3))


@pytest.mark.parametrize("count", [16, 32, 60])
def test_it_is_with_fewer_beams(count):
    cloud = noisy(beams(plane_cloud(DEPTH_M), count))
    assert roughness(cloud) < 0.1
    assert roughness(jittered(cloud, 0.3)) > 0.4


def test_noise_all_around_is_less_rough_than_that_of_a_sector():
    cloud = plane_cloud(DEPTH_M)
    assert roughness(jittered(noisy(cloud), 0.3)) > 2 * roughness(noisy(cloud, 0.3))


def test_a_sector_of_which_few_points_are_left_is_rough_as_well_and_a_cloud_of_few_points_is_not_judged():
    cloud = noisy(plane_cloud(DEPTH_M))
    kept = np.random.default_rng(0).random(len(cloud)) < 0.3
    aside = np.abs(np.rad2deg(np.arctan2(-cloud[:, 1], cloud[:, 0])) - 5.0) > 5.0
    assert roughness(jittered(cloud, 1.0)[kept | aside]) > 0.6
    assert roughness(jittered(cloud, 1.0)[np.random.default_rng(0).random(len(cloud)) < 0.05]) is None


def test_leaves_in_half_of_a_sector_are_not_rough():
    cloud = noisy(plane_cloud(DEPTH_M))
    upper = cloud[:, 2] > 0
    leaves = np.where(upper[:, None], jittered(cloud, 1.0), cloud)
    assert roughness(leaves) < 0.1


def test_a_sector_that_is_shifted_as_a_whole_is_not_rough():
    cloud = noisy(plane_cloud(DEPTH_M))
    moved = ChangedRanges(10.0, 5.0, shift_m=1.0).apply(PointCloud(0, cloud), RIG).xyz_m
    assert roughness(moved) < 0.1


@pytest.mark.parametrize("points", [np.zeros((0, 3)), np.full((9, 3), np.nan), plane_cloud(DEPTH_M)[:50]])
def test_too_few_points_are_not_judged(points):
    with np.errstate(all="ignore"):
        assert roughness(points) is None


def test_what_is_far_away_does_not_count():
    far = noisy(plane_cloud(120.0))
    assert roughness(jittered(far, 1.0)) is None
