"""What stands where the LiDAR's beams passed: what appears is found; what moves, comes up or was hidden is not."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from auditor.lab.attacks.paper import BogusWall
from auditor.lab.attacks.spoofing import GhostCar
from auditor.lab.simulation.drives import SyntheticDrive, make_drive
from auditor.measurement.checks.free_space_conflict import OwnScans, measure_free_space_conflict
from auditor.measurement.checks.scattered_returns import measure_scattered_returns, scattered
from auditor.measurement.disparity.matchers.sgbm import SgbmMatcher
from auditor.measurement.frame import measure_stream
from auditor.measurement.localisation.regions import localise
from auditor.model.arrays import Points
from auditor.model.checks import Check, SensorCheck
from auditor.model.frames import PointCloud

PERIOD_NS = 100_000_000
MATCHER = SgbmMatcher()


@cache
def drive() -> SyntheticDrive:
    """What a drive takes, the tests take, not their collection."""
    return make_drive(45003, 6, style="residential")


@cache
def drive_clouds() -> tuple[PointCloud, ...]:
    return tuple(drive().cloud(number) for number in range(6))


def conflicts(clouds: Sequence[PointCloud]) -> list[int | None]:
    """How many points conflict in each of these scans."""
    scans = OwnScans()
    return [
        None if found is None else len(found) for found in (scans.conflicts(cloud, drive().rig) for cloud in clouds)
    ]


def road(number: int, *things: Points) -> PointCloud:
    """A scan of a plain road, 1.7 m below, from a vehicle that stands, and of things on it."""
    return PointCloud(number * PERIOD_NS, np.concatenate([ROAD, *things]).astype(np.float32))


def thing(ahead_m: float, right_m: float, width_m: float = 1.8, height_m: float = 1.5, points: int = 200) -> Points:
    """Points of an upright surface in the LiDAR's frame: x ahead, y to the left, z up."""
    y, z = np.random.default_rng(1).uniform(0, 1, (2, points))
    return np.stack([np.full(points, ahead_m), -right_m + width_m * (y - 0.5), -1.7 + height_m * z], axis=1)


def beams() -> Points:
    """A road by 40 beams of 0.2 degrees, and a far hedge all around, at which the beams above it end."""
    azimuth = np.radians(np.arange(-180, 180, 0.2))
    below = np.radians(np.linspace(2.5, 30, 40))[:, None]
    reach = 1.7 / np.tan(below)
    ground = [reach * np.cos(azimuth), reach * np.sin(azimuth), np.full((40, azimuth.size), -1.7)]
    above = np.radians(np.linspace(-2.5, 3, 12))[:, None]
    hedge = [38 * np.cos(azimuth) + 0 * above, 38 * np.sin(azimuth) + 0 * above, 38 * np.tan(above) + 0 * azimuth]
    return np.concatenate([np.stack([axis.ravel() for axis in one], axis=1) for one in (ground, hedge)])


ROAD = beams()


def test_the_first_scan_and_one_behind_a_gap_are_compared_with_nothing() -> None:
    late = replace(drive_clouds()[2], stamp_ns=drive_clouds()[1].stamp_ns + 3 * PERIOD_NS)
    assert conflicts([drive_clouds()[0], late]) == [None, None]
    assert conflicts([drive_clouds()[0], drive_clouds()[1], drive_clouds()[1]])[2] is None, (
        "a repeated stamp is no moment ago"
    )


def test_scans_of_two_places_are_not_compared_and_those_behind_are() -> None:
    elsewhere = make_drive(45010, 3, style="city")
    later = [replace(elsewhere.cloud(n), stamp_ns=drive_clouds()[1].stamp_ns + (n + 1) * PERIOD_NS) for n in range(3)]
    assert conflicts([*drive_clouds()[:2], *later]) == [None, 0, None, 0, 0]


def test_without_a_cloud_nothing_is_compared_nor_kept() -> None:
    scans = OwnScans()
    assert scans.conflicts(drive_clouds()[0], drive().rig) is None
    assert scans.conflicts(None, drive().rig) is None
    assert scans.conflicts(drive_clouds()[1], drive().rig) is None


def test_a_clean_drive_with_traffic_has_none() -> None:
    assert conflicts(drive_clouds()) == [None, 0, 0, 0, 0, 0]


def from_turning(clouds: Sequence[PointCloud], degrees_s: float) -> list[PointCloud]:
    """The scans as a vehicle makes them that turns to the left: its LiDAR goes round in 0.1 s, as it turns."""
    turned = []
    for number, cloud in enumerate(clouds):
        ahead, left, up = cloud.xyz_m.T
        seconds = 0.1 * (number - np.arctan2(left, ahead) / (2 * np.pi))
        angle = np.radians(degrees_s) * seconds
        cos, sin = np.cos(angle), np.sin(angle)
        xyz = np.stack([cos * ahead + sin * left, cos * left - sin * ahead, up], axis=1).astype(np.float32)
        turned.append(replace(cloud, xyz_m=xyz))
    return turned


@pytest.mark.parametrize("degrees_s", [-70, -40, 20, 40, 70])
def test_a_vehicle_that_turns_meets_nothing_new_but_a_ghost_car(degrees_s: float) -> None:
    ghost = GhostCar(60, 8.0)
    clouds = drive_clouds()
    assert conflicts(from_turning(clouds, degrees_s)) == [None, 0, 0, 0, 0, 0]
    spoofed = [*clouds[:3], *(ghost.apply(cloud, drive().rig) for cloud in clouds[3:])]
    found = conflicts(from_turning(spoofed, degrees_s))
    assert found[:3] == [None, 0, 0]
    assert all(number is not None and number > 40 for number in found[3:])


def test_a_ghost_car_is_found_as_it_appears_and_as_long_as_it_stays() -> None:
    ghost = GhostCar(60, 8.0)
    found = conflicts([*drive_clouds()[:2], *(ghost.apply(cloud, drive().rig) for cloud in drive_clouds()[2:])])
    assert found[:2] == [None, 0]
    assert all(number is not None and number > 40 for number in found[2:])


def test_what_is_there_from_the_first_scan_on_is_not_found() -> None:
    assert conflicts([BogusWall(8.0, 0.0).apply(cloud, drive().rig) for cloud in drive_clouds()]) == [
        None,
        0,
        0,
        0,
        0,
        0,
    ]


@pytest.mark.parametrize("moved_m", [(0.0, 0.0), (3.0, 0.0), (-3.0, 0.0), (0.0, 3.0)])
def test_a_vehicle_that_was_near_a_moment_ago_has_moved(moved_m: tuple[float, float]) -> None:
    ahead_m, right_m = moved_m
    assert conflicts([road(1, thing(20, 0)), road(2, thing(20 + ahead_m, right_m))]) == [None, 0]


def test_no_vehicle_moves_so_far_in_a_moment() -> None:
    assert (conflicts([road(1, thing(20, 0)), road(2, thing(20, 6))])[1] or 0) > 100


def test_the_vehicle_itself_is_no_thing() -> None:
    assert conflicts([road(1), road(2, thing(2.5, 0, height_m=2.5))]) == [None, 0]


def test_the_share_that_is_asked_about_is_that_of_things_within_reach() -> None:
    scans = OwnScans()
    assert scans.asked_share == 0
    scans.conflicts(road(1), drive().rig)
    assert scans.asked_share == 0, "it was compared with nothing"
    now = road(2, thing(20, 0))
    scans.conflicts(now, drive().rig)
    assert scans.asked_share * len(now.xyz_m) == pytest.approx(200 * 1.0 / 1.5, abs=25), "half a metre above the road"


def test_a_thing_that_stands_where_beams_passed_is_found_by_all_its_points() -> None:
    assert conflicts([road(1), road(2, thing(20, 0))]) == [None, pytest.approx(200 * 1.2 / 1.5, abs=25)]


def test_what_was_hidden_behind_another_thing_is_not() -> None:
    hidden = thing(24, 0, width_m=1.0)
    lorry = thing(12, 0, width_m=3.0, height_m=3.0, points=4000)
    behind = np.hypot(*ROAD[:, :2].T) > 12
    shadow = behind & (np.abs(np.arctan2(ROAD[:, 1], ROAD[:, 0])) < np.arctan(1.5 / 12))
    before = PointCloud(PERIOD_NS, np.concatenate([ROAD[~shadow], lorry]).astype(np.float32))
    assert conflicts([before, road(2, hidden)]) == [None, 0]


def test_a_post_that_beams_missed_is_not() -> None:
    assert conflicts([road(1), road(2, thing(30, 2, width_m=0.1))]) == [None, 0]


def test_a_direction_that_was_not_scanned_says_nothing() -> None:
    ahead = np.abs(np.arctan2(ROAD[:, 1], ROAD[:, 0])) > np.radians(12)
    before = PointCloud(PERIOD_NS, ROAD[ahead].astype(np.float32))
    assert conflicts([before, road(2, thing(20, 0))]) == [None, 0]


def test_a_direction_from_which_nothing_returned_says_nothing() -> None:
    before = PointCloud(PERIOD_NS, ROAD[ROAD[:, 2] < -1.6].astype(np.float32))
    assert conflicts([before, road(2, thing(20, 0) + np.array([0, 0, 1.2]))]) == [None, 0]


@pytest.mark.parametrize("azimuth", [90.0, -135.0, 180.0])
def test_what_appears_is_found_all_around(azimuth: float) -> None:
    cos, sin = np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth))
    turned = thing(20, 0) @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
    assert conflicts([road(1), road(2, turned)]) == [None, pytest.approx(200 * 1.2 / 1.5, abs=30)]


def test_echoes_from_below_the_road_do_not_make_the_road_a_thing() -> None:
    echoes = np.column_stack([*np.random.default_rng(2).uniform(-20, 20, (2, 60)), np.full(60, -7.0)])
    assert conflicts([road(1, echoes), road(2, thing(20, 0))])[1] == conflicts([road(1), road(2, thing(20, 0))])[1]


def test_a_stream_of_frames_has_the_statistic_from_its_second_scan_on_and_says_where() -> None:
    frames = [drive().frame(number) for number in range(3)]
    assert frames[2].cloud is not None
    ghost = replace(frames[2], cloud=GhostCar(60, 8.0).apply(frames[2].cloud, drive().rig))
    measured = list(measure_stream([*frames[:2], ghost], drive().rig, MATCHER))
    of_views = [one[0].shares.get(SensorCheck(Check.FREE_SPACE_CONFLICT, 0, (3,))) for one in measured]
    assert of_views[:2] == [None, 0]
    assert of_views[2] is not None
    assert of_views[2] > 0.5
    [region] = localise(measured[2][1], [0], drive().rig)
    assert region.points is not None
    assert region.points > 40
    assert region.solid is not None
    assert np.linalg.norm(region.solid.centre_m) == pytest.approx(8, abs=0.8)


def test_the_statistic_grows_with_the_points_in_view_and_is_a_half_at_forty() -> None:
    there = (thing(20, 0, points=40) + np.array([0, 0, 1.0])).astype(np.float32)
    behind = there * np.array([-1, 1, 1], dtype=np.float32)
    assert measure_free_space_conflict(there, drive().rig, 3) == pytest.approx(0.5)
    assert measure_free_space_conflict(np.concatenate([there, behind]), drive().rig, 3) == pytest.approx(0.5)
    assert measure_free_space_conflict(behind, drive().rig, 3) == 0
    assert measure_free_space_conflict(there[:0], drive().rig, 3) == 0


@pytest.mark.parametrize(("depth_m", "scatters"), [(0.0, False), (0.1, False), (2.0, True)])
def test_what_ends_at_any_depth_scatters_and_is_no_conflict(depth_m: float, scatters: bool) -> None:
    there = thing(12, 0, points=60) + np.array([0, 0, 1.0])
    there[:, 0] += np.random.default_rng(3).uniform(-depth_m / 2, depth_m / 2, 60)
    found = measure_free_space_conflict(there, drive().rig, 3), measure_scattered_returns(there, drive().rig, 3)
    assert found == pytest.approx((0, 0.6) if scatters else (0.6, 0))


def test_dust_beside_a_ghost_hides_nothing_of_it() -> None:
    ghost, dust = (thing(12, right, points=60) + np.array([0, 0, 1.0]) for right in (-3, 3))
    dust[:, 0] += np.random.default_rng(3).uniform(-1, 1, 60)
    both = np.concatenate([ghost, dust])
    assert scattered(both, drive().rig).tolist() == [False] * 60 + [True] * 60


def test_the_side_of_a_thing_that_is_seen_from_its_corner_does_not_scatter() -> None:
    right, up = np.random.default_rng(4).uniform(0, 1, (2, 200))
    corner = np.column_stack([10 + 1.5 * np.abs(right - 0.5) * 2, 1.5 * (right - 0.5), up])
    assert not scattered(corner, drive().rig).any()


@pytest.mark.parametrize("points", [1, 3, 9])
def test_few_points_of_one_beam_do_not_scatter(points: int) -> None:
    beam = np.column_stack([np.full(points, 10.0), np.linspace(0, 1, points), np.zeros(points)])
    assert not scattered(beam, drive().rig).any()


@pytest.mark.parametrize("slope", [0.0, 0.1, -0.1])
def test_what_appears_on_a_road_that_is_cambered_is_found(slope: float) -> None:
    """What lies lower beside does not make an object of the road itself."""

    def cambered(number: int, *things: Points) -> PointCloud:
        cloud = road(number, *things)
        xyz = cloud.xyz_m.copy()
        xyz[:, 2] += np.float32(slope) * xyz[:, 1]
        return replace(cloud, xyz_m=xyz)

    ghost = thing(20, 0.5)
    _, appears, stays, gone = conflicts([cambered(0), cambered(1, ghost), cambered(2, ghost), cambered(3)])
    assert appears is not None
    assert appears == stays > 100
    assert gone == 0
