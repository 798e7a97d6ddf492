from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from auditor.lab.attacks.spoofing import ChangedRanges, GhostCar
from auditor.measurement import measure
from auditor.measurement.checks.false_ranges import PairRanges, directed_points, false_ranges
from auditor.measurement.disparity.lidar import lidar_view
from auditor.measurement.disparity.matchers import SgbmMatcher
from auditor.model.checks import Check, SensorCheck
from auditor.model.frames import CameraImage, PointCloud
from tests.making.scenes import plane_frame, plane_rig

DEPTH_M = 18.0  # whole pixels of disparity: 10, 5
NEAR_M = 9.0
RIG = plane_rig()
ALL, SCATTERED = (SensorCheck(check, 0, (1, 2, 3)) for check in (Check.FALSE_RANGES, Check.SCATTERED_RANGES))


def said(cloud, depth_m=DEPTH_M, rig=RIG, changed=None, of=ALL):
    frame = plane_frame(rig, depth_m)
    images = {**frame.images, **(changed or {})}
    return measure(replace(frame, cloud=cloud, images=images), rig, SgbmMatcher())[0].shares.get(of)


def plane(depth_m=DEPTH_M):
    return plane_frame(RIG, depth_m).cloud


def some_nearer(chosen, cloud=None, near_m=NEAR_M):
    """The plane's cloud with the chosen points moved nearer along their beams."""
    xyz = (plane() if cloud is None else cloud).xyz_m.copy()
    xyz[chosen] *= np.float32(near_m / DEPTH_M)
    return PointCloud(0, xyz)


def near_the_middle(cloud, half_width_m=1.6, above_m=0.2):
    """The points within a part of the plane, above the horizon."""
    return np.flatnonzero((np.abs(cloud.xyz_m[:, 1]) < half_width_m) & (cloud.xyz_m[:, 2] > above_m))


def test_a_cloud_that_agrees_has_no_false_range():
    assert said(plane()) == pytest.approx(0, abs=0.02)


@pytest.mark.parametrize("points", [30, 60, 200])
def test_a_few_points_of_one_range_are_false_however_many_are_right(points):
    there = near_the_middle(plane())
    chosen = np.random.default_rng(points).choice(there, points, replace=False)
    assert len(plane().xyz_m) > 40 * 200
    assert said(some_nearer(chosen)) > 0.2


@pytest.mark.parametrize("beams", [16, 32])
def test_they_are_with_fewer_beams(beams):
    rows = np.unique(plane().xyz_m[:, 2])
    kept = plane().xyz_m[np.isin(plane().xyz_m[:, 2], rows[:: max(len(rows) // beams, 1)])]
    cloud = PointCloud(0, kept)
    assert said(cloud) == pytest.approx(0, abs=0.02)
    assert said(some_nearer(near_the_middle(cloud), cloud)) > 0.4


def test_points_spread_over_ranges_are_no_cluster():
    there = near_the_middle(plane(), half_width_m=5.0)
    rng = np.random.default_rng(0)
    chosen, xyz = rng.choice(there, 30, replace=False), plane().xyz_m.copy()
    xyz[chosen] *= rng.uniform(7, 12, (30, 1)).astype(np.float32) / DEPTH_M
    together = said(some_nearer(chosen[np.abs(plane().xyz_m[chosen, 1]) < 1.6]))
    assert said(PointCloud(0, xyz)) < 0.1 + together / 2


@pytest.mark.parametrize(("noise_m", "is_false"), [(0.05, True), (0.4, False)])
def test_what_ends_at_any_depth_scatters_as_dust_does_and_is_not_false(noise_m, is_false):
    chosen = np.random.default_rng(0).choice(near_the_middle(plane()), 120, replace=False)
    cloud = some_nearer(chosen)
    cloud.xyz_m[chosen] *= 1 + np.random.default_rng(1).normal(0, noise_m / NEAR_M, (120, 1)).astype(np.float32)
    of = {True: ALL, False: SCATTERED}
    assert said(cloud, of=of[is_false]) > 0.4
    assert said(cloud, of=of[not is_false]) == pytest.approx(0, abs=0.02)


def test_a_cluster_on_an_oblique_surface_is_false():
    chosen = near_the_middle(plane(), half_width_m=2.0)
    xyz = plane().xyz_m.copy()
    # A plane that recedes by a metre for each to the left.
    xyz[chosen] *= (NEAR_M / (DEPTH_M - xyz[chosen, 1]))[:, None].astype(np.float32)
    assert said(PointCloud(0, xyz)) > 0.4


def test_a_facula_on_a_camera_makes_no_range_false():
    pixels = plane_frame(RIG, DEPTH_M).images[1].pixels.copy()
    pixels[20:100, 100:220] = 255
    assert said(plane(), changed={1: CameraImage(1, 0, pixels)}) == pytest.approx(0, abs=0.05)


def test_points_that_no_camera_can_look_at_are_not_false():
    blank = {n: CameraImage(n, 0, np.full_like(one.pixels, 90)) for n, one in plane_frame(RIG).images.items()}
    assert said(some_nearer(near_the_middle(plane())), changed=blank) == 0


@pytest.mark.parametrize("shift_m", [1.2, -1.2])
def test_a_sector_that_is_shifted_is_false(shift_m):
    depth_m = 5.5  # nearby a metre is some pixels
    cloud = plane_frame(RIG, depth_m).cloud
    assert said(cloud, depth_m) == pytest.approx(0, abs=0.02)
    shifted = ChangedRanges(14.0, 10.0, shift_m=shift_m).apply(cloud, RIG)
    assert said(shifted, depth_m) > 0.3


def test_a_sector_of_which_half_is_moved_is_not_shifted():
    cloud = plane_frame(RIG, 9.0).cloud
    shifted = ChangedRanges(14.0, 10.0, shift_m=1.2).apply(cloud, RIG).xyz_m
    half = np.random.default_rng(0).random(len(shifted)) < 0.5
    assert said(PointCloud(0, np.where(half[:, None], shifted, cloud.xyz_m)), 9.0) < 0.2


def test_a_whole_cloud_that_is_shifted_is_no_sector():
    moved = ChangedRanges(360.0, 0.0, shift_m=0.5).apply(plane_frame(RIG, 9.0).cloud, RIG)
    assert said(moved, 9.0) == pytest.approx(0, abs=0.02)


def test_a_ghost_of_the_lab_is_found_by_two_pairs_or_more_and_by_none_alone():
    ghost = GhostCar(150, NEAR_M, 0.0).apply(plane(), RIG)
    measured = measure(replace(plane_frame(RIG, DEPTH_M), cloud=ghost), RIG, SgbmMatcher())[0]
    assert {one.others for one in measured.shares if one.check is ALL.check} == {(1, 2, 3)}
    assert measured.shares[ALL] > 0.2


@pytest.mark.parametrize("points", [np.zeros((0, 3)), np.full((5, 3), np.nan), np.array([[18.0, 0.0, 0.0]])])
def test_next_to_no_points_have_no_false_range(points):
    with np.errstate(all="ignore"):
        assert said(PointCloud(0, points.astype(np.float32))) == 0


def test_without_a_lidar_or_with_two_cameras_it_is_not_measured():
    assert said(None) is None
    two = plane_rig((0.6, 0.0))
    assert said(plane(), rig=two) is None


def test_points_are_in_order_from_left_to_right_and_upright_above_the_road():
    view = lidar_view(plane(), RIG, 3)
    points = directed_points(view, road_m=1.0)
    assert (np.diff(points.place[0]) >= 0).all()
    down_m = -view.point_m[points.upright, 2]
    assert down_m.max() < 0.75
    assert np.isin(np.flatnonzero(-view.point_m[:, 2] < 0.7), points.upright).all()
    np.testing.assert_allclose(np.exp(points.place[2]), view.range_m[points.upright], rtol=1e-5)


PATCH = 0.01


# What pairs say, written down: points at 15 m, spread over 2.3 degrees, and a patch of half a degree.
def pair(contradicted=0, confirmed=0, undecided=0, farther_m=(), beside_rad=0.0, low_rad=0.02):
    count = contradicted + confirmed + undecided
    place = np.zeros((3, count), np.float32)
    edges = np.cumsum([0, contradicted, confirmed, undecided])
    for first, end in pairwise(edges.tolist()):
        place[0, first:end] = np.linspace(-0.02, 0.02, end - first)
        place[1, first:end] = np.resize([-low_rad, low_rad, 0], end - first)
    place[0, contradicted:] += np.float32(beside_rad)
    place[2] = np.log(15.0)
    mask = np.arange(count) < contradicted
    against = np.where(mask, 0, np.where(np.arange(count) < contradicted + confirmed, 1, 0.07)).astype(np.float32)
    order = np.argsort(place[0], kind="stable")
    sectors = np.full(81, np.nan)
    sectors[: len(farther_m)] = farther_m
    return PairRanges(place[:, order], PATCH, mask[order], against[order], sectors)


def test_one_pair_alone_says_nothing():
    assert false_ranges({(1, 3): pair(40)}) == {}


def told(*pairs):
    names = [(1, 3), (2, 3)][: len(pairs)]
    cameras = tuple(sorted({c for name in names for c in name}))
    return false_ranges(dict(zip(names, pairs, strict=True)))[cameras].false


def test_of_a_surface_that_cameras_confirm_in_part_nothing_is_false():
    assert told(pair(40), pair(40)) > 0.4
    assert told(pair(40, confirmed=40), pair(40, confirmed=40)) == 0
    assert told(pair(40, confirmed=40, beside_rad=0.05), pair(40, confirmed=40, beside_rad=0.05)) == 0
    assert told(pair(40, confirmed=40, beside_rad=0.5), pair(40, confirmed=40, beside_rad=0.5)) > 0.4


@pytest.mark.parametrize(("low_rad", "false"), [(0.002, False), (0.02, True)])
def test_what_is_lower_than_a_patch_is_an_edge_and_no_cluster(low_rad, false):
    assert (told(pair(40, low_rad=low_rad), pair(40, low_rad=low_rad)) > 0) is false


def test_what_cannot_be_looked_at_counts_little_for_it():
    few, many = told(pair(40, undecided=40), pair(40, undecided=40)), told(pair(40, undecided=600), pair(40))
    assert told(pair(40), pair(40)) > few > 0.15
    assert many < few


def test_a_pair_that_sees_nothing_halves_what_the_other_says():
    assert told(pair(40), pair()) < told(pair(40), pair(40))
    assert told(pair(40), pair(confirmed=40)) == 0


def test_of_many_clusters_the_largest_has_to_be_larger():
    lonely = told(pair(12), pair(12))
    one = pair(12)
    spread = np.concatenate([one.place + np.float32([[0.3 * n], [0], [0]]) for n in range(5)], axis=1)
    of_many = PairRanges(spread, PATCH, np.ones(60, dtype=np.bool_), np.zeros(60, np.float32), one.farther_m)
    assert 0 < told(of_many, of_many) < lonely


def test_a_shift_is_what_all_pairs_say_of_a_sector_and_two_at_least():
    both = told(pair(farther_m=[0, 1.1]), pair(farther_m=[0, 0.9]))
    assert both == pytest.approx(0.3 / 0.6)
    assert told(pair(farther_m=[0, -1.1]), pair(farther_m=[0, -0.9])) == pytest.approx(both)
    assert told(pair(farther_m=[0, 1.1]), pair(farther_m=[0, -0.9])) == 0
    assert told(pair(farther_m=[0, 1.1]), pair(farther_m=[0])) == 0
    assert told(pair(farther_m=[0, 0.3]), pair(farther_m=[0, 0.3])) == 0
