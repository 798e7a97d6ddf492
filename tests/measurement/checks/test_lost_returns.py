from dataclasses import replace

import numpy as np
import pytest

from auditor.measurement import measure
from auditor.measurement.disparity.matchers import SgbmMatcher
from auditor.model.checks import Check, CountedPair
from auditor.model.frames import PointCloud
from tests.making.scenes import FOCAL, WIDTH, plane_frame, plane_rig

CELL = 8 / 721
DEPTH_M = 10.0  # disparities of 18 and 9 px
REACH_M = (2.0, 200.0)


@pytest.fixture(scope="module")
def lost():
    """How many samples of surfaces, and which cells of the LiDAR's directions lack returns, in a cloud (N, 3).

    Of its directions some are `kept`, and return from so many `times` as far away. Its reach is `reach_m`.
    """
    rig = plane_rig()
    frame = plane_frame(rig, depth_m=DEPTH_M)

    def of(kept, times=lambda _left, up: np.ones_like(up), reach_m=REACH_M):
        xyz = frame.cloud.xyz_m
        left, up = xyz[:, 1] / xyz[:, 0], xyz[:, 2] / xyz[:, 0]
        moved = xyz * times(left, up).astype(np.float32)[:, None]
        cloud = PointCloud(frame.cloud.stamp_ns, reaching(moved[kept(left, up)], reach_m))
        cells = measure(replace(frame, cloud=cloud), rig, SgbmMatcher())[0].cells
        return [cells[CountedPair(Check.LOST_RETURNS, i, 3, 0)] for i in (1, 2)]

    return of


def reaching(xyz, reach_m):
    """Points (N, 3), and some behind the LiDAR, the nearest and the farthest of the cloud."""
    behind = np.float32([[-end_m, 0, 0] for end_m in reach_m])
    return np.concatenate([xyz, np.tile(behind, (len(xyz) // 20, 1))])


def outside(left, up, width_m, height_m):
    """(N,) whether directions pass beside a hole of that size in the plane, straight ahead."""
    return (np.abs(left) > width_m / 2 / DEPTH_M) | (np.abs(up) > height_m / 2 / DEPTH_M)


def test_an_even_cloud_has_lost_nothing(lost):
    for cells in lost(lambda left, up: np.ones(left.shape, dtype=bool)):
        assert cells.total.sum() == 0
        assert cells.valid.sum() > 1500
        assert cells.valid.max() == 4, "two samples a cell, across and down"


def test_a_hole_is_lost_below_the_horizon_but_for_a_patch_along_its_edge(lost):
    for cells in lost(lambda left, up: outside(left, up, 2.0, 1.6)):
        row, column = np.nonzero(cells.total)
        down, right = (row + 0.5 - 40) * CELL * DEPTH_M, (column + 0.5 - 80) * CELL * DEPTH_M
        assert cells.total.sum() > 150
        patch_m, near_m = 6 / FOCAL * DEPTH_M, 1.25 * CELL * DEPTH_M  # a cell's middle is not its sample's
        assert np.abs(right).max() == pytest.approx(1.0 - patch_m, abs=near_m)
        assert down.min() == pytest.approx(patch_m, abs=near_m)
        assert down.max() == pytest.approx(0.8 - patch_m, abs=near_m)
        assert (cells.total[row, column] <= cells.valid[row, column]).all()


@pytest.mark.parametrize(
    ("foot", "sky", "found"),
    [
        (1.0, False, True),
        (1.4, False, True),
        (1.7, False, False),
        (0.7, False, True),
        (0.9, True, True),
        (0.7, True, False),
    ],
)
def test_what_is_seen_stands_on_what_returns_next_below_it(lost, foot, sky, found):
    # Beside a facade the sky takes its disparity: below lies a field far behind, or a hedge before it.
    for cells in lost(
        lambda left, up: outside(left, up, 2.0, 1.6) & ((up < 0.8 / DEPTH_M) if sky else True),
        lambda _left, up: np.where(up < -0.8 / DEPTH_M, foot, 1),
    ):
        assert (cells.total.sum() > 150) == found
        assert (cells.total.sum() > 0) == found


def test_a_dark_car_that_returns_from_its_roof_is_not_lost(lost):
    def with_roof(times):
        """The samples that are lost where the roof is so many times as far away as the car's side."""
        cells = lost(
            lambda left, up: (np.abs(left) > 0.1) | (up > -0.03) | (up < -0.14),
            lambda _left, up: np.where(up > -0.05, times, 1),
        )
        return np.array([one.total.sum() for one in cells])

    assert (with_roof(1.5) > 100).all()
    assert (with_roof(0.8) == with_roof(1.5)).all()
    assert (with_roof(1.0) < 0.4 * with_roof(1.5)).all(), "disparities of 9 px are some per cent off"


def test_above_the_horizon_nothing_is_looked_at(lost):
    for cells in lost(lambda left, up: (np.abs(left) > 0.1) | (up < 0)):
        assert cells.total.sum() == 0
        assert not cells.valid[:40].any()


def test_the_road_is_not_looked_at(lost):
    # What returns steeply below is 1 to 2 m down: taken for a road, 1.5 m down.
    for cells in lost(lambda left, up: np.ones(left.shape, dtype=bool)):
        down_m = (np.nonzero(cells.valid)[0] - 40) * CELL * DEPTH_M
        assert down_m.max() == pytest.approx(1.5 - 0.25, abs=1.5 * CELL * DEPTH_M)


def test_some_returns_here_and_there_say_that_a_dark_surface_is_there(lost):
    # One point of eleven, as of black paint.
    for cells in lost(lambda left, up: outside(left, up, 2.0, 1.6) | (np.arange(left.size) % 11 == 0)):
        assert cells.total.sum() == 0


def test_a_hole_that_holds_no_disc_of_a_vehicle_is_not_lost(lost):
    for width_m, height_m, found in ((0.5, 2.0, False), (2.0, 1.0, False), (1.0, 2.0, True)):
        for cells in lost(lambda left, up, size=(width_m, height_m): outside(left, up, *size)):
            assert (cells.total.sum() > 20) == found
            assert (cells.total.sum() > 0) == found


def test_all_beams_of_a_sector_are_lost(lost):
    # The road in it as well: not only what stands 0.25 m above.
    for cells in lost(lambda left, up: np.abs(left) > 0.06):
        assert cells.total.sum() > 100
        down_m = (np.nonzero(cells.total)[0] - 40) * CELL * DEPTH_M
        assert down_m.max() > 1.5


def test_below_the_lowest_beam_nothing_is_expected(lost):
    for cells in lost(lambda left, up: up > -0.06):
        assert cells.total.sum() == 0
        assert not cells.valid[40 + int(0.06 / CELL) :].any()


def test_where_the_lidar_never_scans_nothing_is_expected(lost):
    for cells in lost(lambda left, up: up < 0.05):
        assert cells.total.sum() == 0
        assert not cells.valid[: 40 - int(0.05 / CELL)].any()


def test_beside_the_field_of_a_narrow_lidar_nothing_is_expected(lost):
    for cells in lost(lambda left, up: left > -0.1):
        assert cells.total.sum() == 0
        assert not cells.valid[:, 80 + int(0.12 / CELL) :].any()


def test_between_the_beams_of_a_lidar_of_few_nothing_is_lost(lost):
    # A beam every 2 degrees: 16 of them.
    for cells in lost(lambda left, up: np.abs(np.arctan(up) / np.deg2rad(2) % 1 - 0.5) < 0.1):
        assert cells.total.sum() == 0
        assert cells.valid.sum() > 1000


def test_beyond_the_reach_of_a_cropped_cloud_nothing_is_expected(lost):
    # What returns is 7 m away, but for a hole, in which the cameras see the plane 10 m away.
    for cells in lost(
        lambda left, up: outside(left, up, 2.0, 1.6), lambda _left, up: np.full_like(up, 0.7), reach_m=(2.0, 7.0)
    ):
        assert cells.total.sum() == 0


@pytest.mark.parametrize("reach_m", [30.0, 50.0])
def test_of_a_beam_that_meets_the_road_beyond_the_reach_of_a_cropped_cloud_nothing_is_expected(lost, reach_m):
    # The road is 1.5 m down: leaves, fences and panes of what stands on it may let such a beam through.
    for cells in lost(lambda left, up: outside(left, up, 2.0, 1.6), reach_m=(2.0, reach_m)):
        down = (np.nonzero(cells.total)[0] + 0.5 - 40) * CELL
        assert down.min() == pytest.approx(1.5 / reach_m, abs=CELL)
        assert cells.total.sum() > 50


def test_nearer_than_a_cloud_begins_nothing_is_expected(lost):
    # Whatever was nearer than 11 m was taken out, and with it what the cameras see 10 m away.
    for cells in lost(
        lambda left, up: outside(left, up, 2.0, 1.6), lambda _left, up: np.full_like(up, 1.3), reach_m=(11.0, 200.0)
    ):
        assert cells.total.sum() == 0


def beams(up, degrees):
    """(N,) which directions lie on beams so many degrees apart."""
    return np.abs(np.arctan(up) / np.deg2rad(degrees) % 1 - 0.5) < 0.2


def test_one_beam_of_few_that_does_not_return_says_nothing(lost):
    # A hole 0.7 m high, as a vehicle's side, is one beam of a LiDAR whose beams are 2 degrees apart.
    for cells in lost(lambda left, up: outside(left, up + 0.04, 2.0, 0.5) & beams(up, 2)):
        assert cells.total.sum() == 0
        assert cells.valid.sum() > 1000


@pytest.mark.parametrize(("degrees", "height_m", "found"), [(0.5, 0.8, True), (2, 0.8, False), (1, 1.6, True)])
def test_a_hole_is_lost_where_it_is_several_beams_high(lost, degrees, height_m, found):
    for cells in lost(lambda left, up: outside(left, up + 0.08, 2.0, height_m) & beams(up, degrees)):
        assert (cells.total.sum() > 20) == found
        assert (cells.total.sum() > 0) == found


def test_level_stripes_could_be_sky():
    # Along rows they hardly differ: they match themselves at any disparity, and at that of the sky.
    rig = plane_rig()
    frame = plane_frame(rig, depth_m=DEPTH_M)
    level = np.repeat(np.random.default_rng(1).integers(30, 220, frame.images[1].pixels.shape[0] // 2), 2)[:, None]
    striped = {n: replace(one, pixels=(level + one.pixels // 6).astype(np.uint8)) for n, one in frame.images.items()}
    xyz = frame.cloud.xyz_m
    holed = PointCloud(0, reaching(xyz[outside(xyz[:, 1] / xyz[:, 0], xyz[:, 2] / xyz[:, 0], 2.0, 1.6)], REACH_M))
    for images, lost in ((frame.images, True), (striped, False)):
        cells = measure(replace(frame, images=images, cloud=holed), rig, SgbmMatcher())[0].cells
        for i in (1, 2):
            counted = cells[CountedPair(Check.LOST_RETURNS, i, 3, 0)]
            assert counted.valid.sum() > 1000
            assert (counted.total.sum() > 150) == lost


def test_surfaces_far_away_are_not_looked_at():
    rig = plane_rig()
    far = plane_frame(rig, depth_m=45.0)
    nothing = replace(far, cloud=PointCloud(far.cloud.stamp_ns, far.cloud.xyz_m[::2]))
    cells = measure(nothing, rig, SgbmMatcher())[0].cells
    assert cells[CountedPair(Check.LOST_RETURNS, 1, 3, 0)].valid.sum() < 20
    assert FOCAL * 0.6 / 45.0 == 4.0
    assert WIDTH == 320


def test_beams_that_hardly_cross_the_horizon_have_lost_nothing(lost):
    # The lower of two beams returns just below the rows that are looked at: no column has a return there.
    for cells in lost(lambda _left, up: np.isin(np.round(-up * FOCAL), (-12, 6))):
        assert cells.total.sum() == 0
