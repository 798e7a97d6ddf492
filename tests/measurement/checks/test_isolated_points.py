"""Isolated points are separated from those of objects, and drops from points at random ranges."""

from dataclasses import replace
from math import isnan

import numpy as np
import pytest

from auditor.lab.attacks.faults import HiddenSector, Rain
from auditor.lab.attacks.paper import BogusWall
from auditor.measurement import FaultFeatures, measure
from auditor.measurement.checks.point_distribution import isolated, isolated_ratio, isolated_shares
from auditor.measurement.disparity.lidar import lidar_view
from auditor.measurement.disparity.matchers import SgbmMatcher
from auditor.model.checks import Check, SensorCheck
from auditor.model.fault_features import IsolatedShares
from auditor.model.frames import PointCloud
from tests.making.scenes import FOCAL, HEIGHT, WIDTH, plane_cloud, plane_frame, plane_rig

RIG = plane_rig()
PLANE = PointCloud(0, plane_cloud(20.0))


def seen(cloud):
    view = lidar_view(cloud, RIG, 3)
    return isolated_shares(view, isolated(view, FOCAL), WIDTH)


def pulled(share, nearest_m, farthest_m, columns=slice(None)):
    """The plane, a share of its beams ending at chance ranges before it, in some columns of the view only."""
    rng = np.random.default_rng(1)
    xyz = PLANE.xyz_m.reshape(HEIGHT // 2, WIDTH // 2, 3).copy()
    part = xyz[:, columns]
    chosen = rng.random(part.shape[:2]) < share
    distance = np.linalg.norm(part, axis=2)
    scale = np.where(chosen, rng.uniform(nearest_m, farthest_m, distance.shape) / distance, 1)
    xyz[:, columns] = part * scale[:, :, None]
    return PointCloud(0, xyz.reshape(-1, 3).astype(np.float32))


def test_a_point_alone_at_its_range_is_isolated_and_a_surface_is_not():
    xyz = plane_cloud(20.0)
    place = (HEIGHT // 4) * (WIDTH // 2) + WIDTH // 4
    xyz[place] *= 0.2
    view = lidar_view(PointCloud(0, xyz), RIG, 3)
    alone = isolated(view, FOCAL)
    assert np.linalg.norm(view.point_m[alone], axis=1).round(1).tolist() == [4.0]


def test_a_dry_view_has_no_isolated_points():
    assert seen(PLANE) == (0, 0)


def test_drops_stand_alone_near_the_lidar_and_not_beyond():
    few, many = (seen(Rain(rate, seed=1).apply(PLANE, RIG)) for rate in (2, 25))
    assert 0.005 < few.isolated_near < many.isolated_near
    assert few.isolated_beyond < few.isolated_near / 10, "what drops leave of the plane is thin, but holds together"
    assert many.isolated_beyond < many.isolated_near / 10


def test_points_at_chance_ranges_stand_alone_beyond_as_well():
    near, beyond = seen(pulled(0.05, 4, 19))
    assert beyond > near / 2 > 0


def test_points_that_lie_together_as_those_of_dust_do_not_count():
    chosen = np.random.default_rng(1).choice(len(PLANE.xyz_m), 250, replace=False)

    def ending(nearest_m, farthest_m, some):
        xyz = PLANE.xyz_m.copy()
        range_m = np.random.default_rng(2).uniform(nearest_m, farthest_m, len(some))
        xyz[some] *= (range_m / np.linalg.norm(xyz[some], axis=1)).astype(np.float32)[:, None]
        return seen(PointCloud(0, xyz)).isolated_beyond * len(xyz)

    ahead = chosen[np.abs(PLANE.xyz_m[chosen, 1]) < 4]
    few, dust, spoofed = (ending(9, 11, ahead[:count]) for count in (14, 50, 130))
    assert few == pytest.approx(14, abs=2), "as many as clean frames have"
    assert dust < 20, "of some fifty"
    assert spoofed > 50, "more than dust isolates"
    assert ending(9, 19, chosen) > 50


ROAD_M = 1.0


def on_the_road(xyz):
    """What lies lower than a road is moved nearer along its ray, onto the road."""
    return xyz * np.minimum(1, ROAD_M / np.maximum(-xyz[:, 2:], 1e-3)).astype(np.float32)


ROAD = on_the_road(PLANE.xyz_m)
ON_ROAD = (-PLANE.xyz_m[:, 2] > ROAD_M) & (np.linalg.norm(ROAD, axis=1) > 10)


def ending(share, of, nearest, farthest):
    """By how much some of a cloud's beams end farther, those moved at chance, and 1 of the others."""
    rng = np.random.default_rng(5)
    moved = of & (rng.random(len(ROAD)) < share)
    return np.where(moved, rng.uniform(nearest, farthest, len(ROAD)), 1)


def alone_of(farther, left=0.02):
    """How many isolated points count where beams end that much farther, and so much of the road is left."""
    shown = ~ON_ROAD | (farther != 1) | (np.random.default_rng(3).random(len(ROAD)) < left)
    xyz = (ROAD * farther[:, None])[shown].astype(np.float32)
    return seen(PointCloud(0, xyz)).isolated_beyond * len(xyz)


def test_what_wet_ground_leaves_of_the_road_and_mirrors_below_it_does_not_count():
    assert alone_of(ending(0.02, ON_ROAD, 1.4, 2)) == 0
    assert alone_of(ending(0.02, PLANE.xyz_m[:, 2] > 0.5, 0.45, 0.9), left=1) > 20


def test_noise_counts_below_the_road_as_well_as_above():
    lower, higher = ending(0.02, ON_ROAD, 0.8, 2), ending(0.05, PLANE.xyz_m[:, 2] > 0.5, 0.4, 0.95)
    assert alone_of(lower) == 0
    assert alone_of(higher * lower) > alone_of(higher) + 50


def test_drops_in_one_part_of_the_view_are_no_rain():
    assert seen(pulled(0.05, 1.5, 6, slice(0, WIDTH // 4))).isolated_near == 0
    assert seen(pulled(0.05, 1.5, 6)).isolated_near > 0.01


def test_objects_real_or_bogus_and_a_hidden_strip_have_no_isolated_points():
    for attack in (BogusWall(8.0, 0.0), HiddenSector(10, 0)):
        assert seen(attack.apply(PLANE, RIG)).isolated_near == 0


def test_a_view_of_hardly_any_points_says_nothing():
    assert all(isnan(value) for value in seen(PointCloud(0, PLANE.xyz_m[:150])))


def test_they_are_fault_features_where_a_pair_can_check_the_lidar():
    frame = plane_frame(RIG)
    wet = replace(frame, cloud=Rain(25, seed=1).apply(frame.cloud, RIG))
    watch = FaultFeatures()
    for given, raining in ((frame, False), (wet, True)):
        found = watch.update(measure(given, RIG, SgbmMatcher())[1])
        assert found[2, 3].isolated_shares == found[1, 3].isolated_shares
        assert (found[1, 3].isolated_shares.isolated_near > 0.01) is raining
    rig = plane_rig(lidar=False)
    blind = FaultFeatures().update(measure(replace(plane_frame(rig), cloud=None), rig, SgbmMatcher())[1])
    assert isnan(blind[1, 3].isolated_shares.isolated_near)


def test_isolated_points_far_away_count_and_those_of_a_dry_view_do_not():
    assert isolated_ratio(seen(PLANE)) == 0
    assert isolated_ratio(seen(pulled(0.02, 4, 19))) > 0.6


def test_in_rain_they_say_nothing_and_not_that_the_drive_has_none():
    assert isolated_ratio(seen(Rain(25, seed=1).apply(PLANE, RIG))) is None
    assert isolated_ratio(IsolatedShares(0.002, 0.004)) > 0
    assert isolated_ratio(IsolatedShares()) is None


@pytest.mark.parametrize("xyz", [np.zeros((0, 3)), [[-5, 0, 0]], [[5, 0, 0]]], ids=["none", "behind", "one"])
def test_a_cloud_of_hardly_any_points_is_measured(xyz):
    frame = plane_frame(RIG)
    bare = replace(frame, cloud=PointCloud(0, np.asarray(xyz, dtype=np.float32)))
    measurement, _ = measure(bare, RIG, SgbmMatcher())
    assert measurement.shares[SensorCheck(Check.POINT_DROPOUT, 0, (3,))] == 1.0
    assert SensorCheck(Check.ISOLATED_POINTS, 0, (3,)) not in measurement.shares
