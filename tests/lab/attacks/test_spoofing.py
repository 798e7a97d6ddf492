from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from auditor.errors import SettingError
from auditor.lab.attacks.paper import BogusWall
from auditor.lab.attacks.spoofing import ChangedRanges, GhostCar, RandomRanges, RemovedObject, find_object
from auditor.measurement import measure
from auditor.measurement.disparity.matchers import SgbmMatcher
from auditor.model.checks import Check, CountedPair
from auditor.model.frames import PointCloud
from tests.benchmarks.lidar_kinds import copied_wall
from tests.making.scenes import plane_frame, plane_rig

Street = tuple[PointCloud, NDArray[np.bool_]]

ROAD_M = 1.7
RIG = plane_rig()


@pytest.fixture(scope="module")
def street() -> Street:
    """A road, a facade 40 m ahead, and a car whose back is 20 m ahead, 2 m to the left; x forward, y left, z up."""
    azimuth, elevation = np.meshgrid(np.deg2rad(np.arange(-40, 40, 0.2)), np.deg2rad(np.arange(-24, 2, 0.4)))
    left, up = np.tan(azimuth), np.tan(elevation)
    forward = np.where(up < 0, np.minimum(-ROAD_M / np.minimum(up, -1e-9), 40.0), 40.0)
    on_car = (np.abs(left * 20 - 2) < 0.9) & (up * 20 > 0.3 - ROAD_M) & (up * 20 < 1.5 - ROAD_M)
    forward = np.where(on_car, 20.0, forward)
    xyz = np.stack([np.ones_like(left), left, up], axis=-1) * forward[..., None]
    return PointCloud(7, xyz.reshape(-1, 3).astype(np.float32)), on_car.ravel()


def test_a_car_is_found_where_it_stands_and_nowhere_else(street: Street) -> None:
    cloud, on_car = street
    points = cloud.xyz_m[:, [1, 2, 0]] * np.array([-1, -1, 1], np.float32)
    spot = find_object(points, 20.0)
    assert spot.is_car
    assert spot.right_m == pytest.approx(-2, abs=0.5)
    assert abs(spot.ahead_m - 20) < 2.3
    assert not find_object(points[~on_car], 20.0).is_car
    assert not find_object(points, 30.0).is_car


def test_a_removed_object_is_gone_and_nothing_else_is(street: Street) -> None:
    cloud, on_car = street
    left = RemovedObject(20.0).apply(cloud, RIG).xyz_m
    gone = ~np.isin(cloud.xyz_m[:, 1], left[:, 1]) & on_car
    assert gone.sum() == on_car.sum()
    assert len(cloud.xyz_m) - len(left) < 1.1 * on_car.sum()


def test_an_object_that_is_seen_through_returns_from_behind_it(street: Street) -> None:
    cloud, on_car = street
    seen = RemovedObject(20.0, returned_at_m=60.0).apply(cloud, RIG).xyz_m
    assert np.linalg.norm(seen[on_car], axis=1) == pytest.approx(60.0, rel=1e-4)
    far = cloud.xyz_m[:, 0] > 30
    np.testing.assert_array_equal(seen[far], cloud.xyz_m[far])


def test_noise_stays_in_its_sector_and_on_its_beams(street: Street) -> None:
    cloud, _ = street
    noisy = RandomRanges(10.0, 0.0, lost=0.0, farthest_m=100.0).apply(cloud, RIG).xyz_m
    aside = np.abs(np.rad2deg(np.arctan2(cloud.xyz_m[:, 1], cloud.xyz_m[:, 0])))
    np.testing.assert_array_equal(noisy[aside > 5.01], cloud.xyz_m[aside > 5.01])
    beam, noise = (xyz / np.linalg.norm(xyz, axis=1, keepdims=True) for xyz in (cloud.xyz_m, noisy))
    np.testing.assert_allclose(beam, noise, atol=1e-4)
    ranges = np.linalg.norm(noisy[aside < 5], axis=1)
    assert 45 < np.median(ranges) < 55
    assert ranges.max() < 101


def test_a_saturated_sector_loses_its_share_of_points(street: Street) -> None:
    cloud, _ = street
    left = RandomRanges(10.0, 0.0, lost=0.7, farthest_m=100.0, seed=3).apply(cloud, RIG).xyz_m
    inside = np.abs(np.rad2deg(np.arctan2(cloud.xyz_m[:, 1], cloud.xyz_m[:, 0]))) <= 5
    assert len(cloud.xyz_m) - len(left) == pytest.approx(0.7 * inside.sum(), rel=0.05)


def test_they_need_a_lidar(street: Street) -> None:
    cloud, _ = street
    with pytest.raises(SettingError, match="no"):
        RemovedObject(20.0).apply(cloud, plane_rig(lidar=False))
    with pytest.raises(SettingError, match="no"):
        RandomRanges(10.0, 0.0, 0.0, 100.0).apply(cloud, plane_rig(lidar=False))


def test_a_copied_wall_has_one_camera_agree_with_the_lidar_and_the_other_pair_disagree() -> None:
    frame = plane_frame(RIG, depth_m=18.0)
    wall = BogusWall(9.0, 0.0, width_m=2.5, height_m=1.5)
    changed = copied_wall(frame, RIG, wall, 1, 3)
    assert (changed.images[1].pixels != frame.images[1].pixels).any()
    assert changed.images[2] is frame.images[2]
    cells = measure(changed, RIG, SgbmMatcher())[0].cells
    only_lidar = measure(replace(changed, images=frame.images), RIG, SgbmMatcher())[0].cells
    conflict = CountedPair(Check.LIDAR_CONFLICT, 1, 3, 0)
    assert cells[conflict].total.sum() < 0.3 * only_lidar[conflict].total.sum()
    other = CountedPair(Check.LIDAR_CONFLICT, 2, 3, 0)
    assert cells[other].total.sum() > 0.9 * only_lidar[other].total.sum()


@pytest.mark.parametrize("points", [20, 60])
def test_a_ghost_car_has_its_points_at_its_range_and_no_shadow(street: Street, points: int) -> None:
    cloud, _ = street
    xyz = GhostCar(points, 8.0, -1.0).apply(cloud, RIG).xyz_m
    kept = len(cloud.xyz_m)
    moved = np.flatnonzero((xyz[:kept] != cloud.xyz_m).any(axis=1))
    ghost = np.concatenate([xyz[moved], xyz[kept:]])
    assert len(ghost) == points
    np.testing.assert_allclose(ghost[:, 0], 8.0, atol=0.15)
    assert np.abs(ghost[:, 1] - 1.0).max() < 0.95  # a metre to the left
    assert ghost[:, 2].max() < 1.6 - ROAD_M
    behind = (np.abs(xyz[:, 1] / xyz[:, 0] - 0.125) < 0.08) & (xyz[:, 0] > 10)
    assert behind.sum() > 100


def test_a_ghost_car_has_no_more_points_than_beams_meet_its_back(street: Street) -> None:
    cloud, _ = street
    beams = len(GhostCar(10**6, 30.0).apply(cloud, RIG).xyz_m)
    changed = (GhostCar(10**6, 30.0).apply(cloud, RIG).xyz_m[: len(cloud.xyz_m)] != cloud.xyz_m).any(axis=1)
    assert 10 < changed.sum() < 400
    assert beams < len(cloud.xyz_m) + 400


@pytest.mark.parametrize(("shift_m", "noise_m"), [(1.0, 0.0), (-1.0, 0.0), (0.0, 0.3)])
def test_changed_ranges_are_those_of_a_sector_and_stay_on_their_beams(
    street: Street, shift_m: float, noise_m: float
) -> None:
    cloud, _ = street
    xyz = ChangedRanges(10.0, 0.0, shift_m, noise_m, seed=2).apply(cloud, RIG).xyz_m
    aside = np.abs(np.rad2deg(np.arctan2(cloud.xyz_m[:, 1], cloud.xyz_m[:, 0])))
    np.testing.assert_array_equal(xyz[aside > 5.01], cloud.xyz_m[aside > 5.01])
    before, after = (np.linalg.norm(points, axis=1) for points in (cloud.xyz_m, xyz))
    np.testing.assert_allclose(xyz / after[:, None], cloud.xyz_m / before[:, None], atol=1e-5)
    change = (after - before)[aside < 4.99]
    assert change.mean() == pytest.approx(shift_m, abs=0.03)
    assert change.std() == pytest.approx(noise_m, abs=0.03)
