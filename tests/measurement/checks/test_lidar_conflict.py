from dataclasses import replace

import numpy as np
import pytest

from auditor.measurement.checks import lidar_conflict
from auditor.measurement.checks.lidar_conflict import verify_conflicts
from auditor.measurement.checks.photometric_consistency import (
    Matches,
    PairConsistency,
    Patches,
    photometric_consistency,
)
from auditor.measurement.disparity.half_resolution import halve
from auditor.measurement.disparity.lidar import lidar_view
from auditor.measurement.disparity.matchers import SgbmMatcher
from auditor.measurement.disparity.stereo import StereoMap, stereo_map, textured
from auditor.measurement.parameters import COUNT_GRID
from auditor.measurement.point_parameters import FALSE_RANGES
from auditor.model.frames import PointCloud
from tests.making.scenes import FOCAL, HEIGHT, WIDTH, WrittenDown, plane_cloud, plane_images, plane_rig

DEPTH_M = 9.0
BORDER_PX = 4  # the last columns have nothing beside them to be matched by


def consistency(half_res, stereo):
    return photometric_consistency(Patches.of(half_res[0]), half_res[1], stereo)


def judged(cloud, images=None):
    """Verify conflicts of S_1 and S_3's images of a plane 9 m away with a cloud."""
    rig = plane_rig()
    images = images or plane_images(rig, DEPTH_M)
    half_res = halve(images[3]), halve(images[1])
    stereo = stereo_map(SgbmMatcher(), images[3], images[1], *(textured(half) for half in half_res))
    view = lidar_view(PointCloud(0, cloud), rig, 3)
    return verify_conflicts(view, stereo, consistency(half_res, stereo), rig, 1, half_res)


def consistency_of(ncc):
    """A consistency of which only the correlations count."""
    everywhere = np.ones(ncc.shape, dtype=np.bool_)
    return PairConsistency(ncc, everywhere, ~everywhere, Matches(np.zeros(ncc.shape, np.float32), everywhere))


def with_wall(cloud, depth_m=5.0):
    """Everything between two columns moved nearer along its ray."""
    inside = np.abs(cloud[:, 1]) < 1.0
    return np.where(inside[:, None], cloud * np.float32(depth_m / DEPTH_M), cloud)


def test_a_cloud_that_agrees_has_no_conflict():
    result = judged(plane_cloud(DEPTH_M))
    assert result.valid.sum() > 5000
    assert not result.lidar_conflicts[result.column < WIDTH - BORDER_PX].any()


def on_the_road(cloud, below_m):
    """What lies lower than a road is moved nearer along its ray, onto the road."""
    return cloud * np.minimum(1, below_m / np.maximum(-cloud[:, 2:], 1e-3)).astype(np.float32)


def test_what_wet_ground_mirrors_is_no_conflict():
    road = on_the_road(plane_cloud(DEPTH_M), 0.8)  # the cameras see the plane go on below it, as a mirror shows it
    mirrored = judged(road)
    low = mirrored.row > HEIGHT * 0.9
    assert low.sum() > 300
    assert not (mirrored.valid | mirrored.lidar_conflicts | mirrored.votes.contradicted)[low].any()


ROAD_M, FAR_M = 1.6, 18.0


def road_images(standing_m=FAR_M):
    """The plane behind a road, or before it what stands on it that far away, as each camera sees them."""
    rig, rows = plane_rig(), np.arange(HEIGHT)
    away_m = np.minimum(standing_m, ROAD_M * FOCAL / np.maximum(rows - HEIGHT / 2, 1))
    texture = np.random.default_rng(0).integers(0, 256, (HEIGHT, 3 * WIDTH)).astype(np.uint8)
    images = {}
    for camera in rig.cameras:
        first = WIDTH + np.rint(FOCAL * camera.centre_m[0] / away_m).astype(int)
        images[camera.number] = np.take_along_axis(texture, first[:, None] + np.arange(WIDTH), axis=1)
    return images


def returns_below_the_road(nearest_m):
    """The plane behind a road, of which beams to the right return from below it, from somewhere on."""
    cloud = on_the_road(plane_cloud(FAR_M), ROAD_M)
    moved = (cloud[:, 1] < -0.1) & (cloud[:, 2] < -1.4) & (cloud[:, 0] > nearest_m)
    cloud[moved] *= 1.7
    return cloud


def shares_below(nearest_m, standing_m=FAR_M):
    """Of points below the road those valid, in conflict, and clear."""
    found = judged(returns_below_the_road(nearest_m), road_images(standing_m))
    below = (found.row >= 86) & (found.row < 95) & (found.column > 185) & (found.column < WIDTH - 24)
    assert below.sum() > 100
    return [one[below].mean() for one in (found.valid, found.lidar_conflicts, found.votes.clear)]


def test_what_wet_ground_mirrors_to_the_lidar_is_no_conflict():
    valid, conflicts, clear = shares_below(nearest_m=12.0)
    assert valid == conflicts == 0
    assert clear > 0.9, "a sector that is shifted is told by its road as well"


def test_returns_from_below_the_road_are_in_conflict_with_what_stands_on_it():
    assert shares_below(nearest_m=12.0, standing_m=9.0)[1] > 0.9


def test_a_road_that_lies_lower_as_a_whole_is_shifted_and_in_conflict():
    assert shares_below(nearest_m=0.0)[1] > 0.9


def test_a_bogus_wall_is_in_conflict_where_it_stands_and_nowhere_else():
    result = judged(with_wall(plane_cloud(DEPTH_M)))
    inside = np.abs(result.column - WIDTH / 2) < 25
    assert result.lidar_conflicts[result.valid & inside].mean() > 0.9
    outside = (np.abs(result.column - WIDTH / 2) > 45) & (result.column < WIDTH - BORDER_PX)
    assert not result.lidar_conflicts[outside].any()


def test_a_facula_on_a_camera_causes_no_conflict():
    images = plane_images(plane_rig(), DEPTH_M)
    images[1] = images[1].copy()
    images[1][20:100, 100:220] = 255
    result = judged(plane_cloud(DEPTH_M), images)
    assert result.lidar_conflicts.sum() < 0.01 * result.valid.sum()


def test_points_moved_by_one_period_of_a_texture_are_in_conflict_only_with_a_pair_of_another_baseline():
    rig, period = plane_rig(), 24
    texture = np.tile(np.random.default_rng(0).integers(0, 256, (HEIGHT, period)), 40).astype(np.uint8)
    shifts = {1: 20, 2: 10, 3: 0}
    images = {n: np.ascontiguousarray(texture[:, WIDTH + s : 2 * WIDTH + s]) for n, s in shifts.items()}
    near_m = 300 * 0.6 / (20 + period)  # 44 px instead of 20 between S_1 and S_3, 22 instead of 10 between S_2 and S_3
    view = lidar_view(PointCloud(0, plane_cloud(near_m)), rig, 3)
    conflicts = {}
    for source in (1, 2):
        half_res = halve(images[3]), halve(images[source])
        stereo = stereo_map(SgbmMatcher(), images[3], images[source], *(textured(half) for half in half_res))
        found = verify_conflicts(view, stereo, consistency(half_res, stereo), rig, source, half_res)
        conflicts[source] = int(found.lidar_conflicts[found.column < WIDTH - period].sum())
    assert conflicts[2] > 3000
    assert conflicts[1] < conflicts[2] / 50


def test_only_points_that_the_images_can_verify_are_valid():
    images = {n: np.full_like(image, 128) for n, image in plane_images(plane_rig(), DEPTH_M).items()}
    for n, left in ((1, 100), (3, 120)):
        images[n][:, left : left + 100] = plane_images(plane_rig(), DEPTH_M)[3][:, 120:220]
    result = judged(plane_cloud(DEPTH_M), images)
    assert result.valid[(result.column > 130) & (result.column < 210)].mean() > 0.9
    assert not result.valid[result.column > 235].any()


def test_a_wall_nearer_than_the_matcher_searches_is_in_conflict():
    near = judged(plane_cloud(1.4))  # 300 px 0.6 m / 1.4 m = 129 px of 128
    seen = (near.column > 135) & (near.row < HEIGHT // 2)  # what is lower is taken for the road here
    assert near.lidar_conflicts[seen & (near.column < WIDTH - BORDER_PX)].mean() > 0.9
    assert not near.votes.clear.any()


def test_a_surface_that_is_nearer_than_the_matcher_searches_is_in_no_conflict():
    near = judged(plane_cloud(1.4), plane_images(plane_rig(), 1.4))
    assert near.row.size > 5000
    assert not near.valid.any()


def test_of_many_flagged_points_a_few_stand_for_all(monkeypatch):
    cloud = with_wall(plane_cloud(DEPTH_M))
    everything = judged(cloud).lidar_conflicts
    monkeypatch.setattr(lidar_conflict, "LIDAR_CONFLICT", replace(lidar_conflict.LIDAR_CONFLICT, most_verified=50))
    sizes = []
    original = lidar_conflict.ncc_at
    monkeypatch.setattr(lidar_conflict, "ncc_at", lambda *a: sizes.append(a[2].size) or original(*a))
    few = judged(cloud).lidar_conflicts
    assert sizes[0] <= 2 * 50, "by the conflicts' limits, and by those of false ranges"
    assert few.sum() == pytest.approx(everything.sum(), rel=0.1)


def test_a_surface_that_the_beam_passes_over_is_no_conflict():
    # Stereo sees a post 4.5 m away. The LiDAR stands 2 m higher and sees the plane behind the post's upper part.
    rig = plane_rig()
    up = np.eye(4)
    up[2, 3] = 2.0
    lifted = replace(rig, lidar=replace(rig.lidar, rig_SE3_lidar=rig.lidar.rig_SE3_lidar @ up))
    images = {n: image.copy() for n, image in plane_images(rig, DEPTH_M).items()}
    near = plane_images(rig, 4.5, seed=1)
    top = HEIGHT // 2
    for number, left in ((1, 140 - 40), (3, 140)):
        images[number][top:, left : left + 60] = near[number][top:, left : left + 60]
    half_res = halve(images[3]), halve(images[1])
    stereo = stereo_map(SgbmMatcher(), images[3], images[1], *(textured(half) for half in half_res))
    cloud = plane_cloud(DEPTH_M)
    cloud[:, 2] -= 2.0
    results = {}
    for name, vehicle in (("above", lifted), ("beside", rig)):
        points = cloud if name == "above" else plane_cloud(DEPTH_M)
        view = lidar_view(PointCloud(0, points), vehicle, 3)
        result = verify_conflicts(view, stereo, consistency(half_res, stereo), vehicle, 1, half_res)
        band = (result.row > top + 8) & (result.row < top + 20) & (result.column > 155) & (result.column < 190)
        results[name] = int(result.lidar_conflicts[band].sum())
    # The beam from the camera's own place would have to go through the post: there it is a conflict.
    assert results["beside"] > 50
    assert results["above"] < results["beside"] / 5


BASELINE_M = 0.6
FAIR = FALSE_RANGES.consistent
NO_IMAGES = (np.zeros((HEIGHT // 2, WIDTH // 2), np.uint8),) * 2


def lidar_at(x, y, z):
    """A rig of the plane whose LiDAR stands there in the reference's frame: right, down, ahead."""
    rig = plane_rig()
    placed = rig.lidar.rig_SE3_lidar.copy()
    placed[:3, 3] = x, y, z
    return replace(rig, lidar=replace(rig.lidar, rig_SE3_lidar=placed))


def seen_at(rig, row, column, u, d0):
    """A view with points at these pixels and of these disparities at S_1."""
    depth = FOCAL * BASELINE_M / d0
    x, y, z = (u - WIDTH / 2) / FOCAL * depth, (row - HEIGHT / 2) / FOCAL * depth, depth
    right, down, ahead = np.array([x, y, z]) - rig.lidar.rig_SE3_lidar[:3, 3:]
    points = np.stack([ahead, -right, -down], axis=1).astype(np.float32)
    return WrittenDown(
        3, column.astype(np.int32), row.astype(np.int32), np.float32(u), points, row.size, rig, points, (0, WIDTH),
        False, points, np.float32(d0),
    )  # fmt: skip


def passes_over(rig, row, u, d0, disparity):
    """Whether the beam to the point at (u, row) runs, at the depth that stereo sees there, through a clear pixel."""
    origin, depth = rig.lidar.rig_SE3_lidar[:3, 3], FOCAL * BASELINE_M / d0
    ds = disparity[row // 2, int(u) // 2]
    point = np.array([(u - WIDTH / 2) / FOCAL * depth, (row - HEIGHT / 2) / FOCAL * depth, depth])
    surface = FOCAL * BASELINE_M / ds
    if surface >= depth:
        return False
    x, y, z = origin + (point - origin) * (surface - origin[2]) / (point[2] - origin[2])
    column_there, row_there = round((WIDTH / 2 + FOCAL * x / z) / 2), round((HEIGHT / 2 + FOCAL * y / z) / 2)
    inside = 0 <= row_there < disparity.shape[0] and 0 <= column_there < disparity.shape[1]
    return bool(inside and disparity[row_there, column_there] < ds - 3)


def mirrored(view, n, row, ds):
    """Whether what stereo sees in a point's row lies a quarter of a metre below the road, and the point by it; or the
    point below it, and what stereo sees by it.

    Of such a point the road has to have more returns in its strip of directions than lie below it.
    """
    ahead, left, up = view.point_m.T
    steep = -up[-up > 0.1 * np.hypot(ahead, left)]
    road = np.median(steep) if steep.size else np.inf
    seen = (row - HEIGHT / 2) / FOCAL * FOCAL * BASELINE_M / ds - view.rig.lidar.rig_SE3_lidar[1, 3]
    strip = np.floor(np.arctan2(-left, ahead) / COUNT_GRID.lidar_cell)
    beside = -up[strip == strip[n]]
    shows = np.sum(np.abs(beside - road) < 0.25) > np.sum(beside > road + 0.25)
    of_images = -up[n] > road - 0.25 and seen > road + 0.25
    return bool(of_images), bool(shows and seen > road - 0.25 and -up[n] > road + 0.25)


@pytest.mark.parametrize("most", [1000, 5, 2])
@pytest.mark.parametrize("seed", range(12))
def test_each_point_is_judged_as_worked_out_one_by_one(monkeypatch, seed, most):
    rng = np.random.default_rng(seed)
    rig = lidar_at(*rng.choice([-0.7, -0.2, 0.0, 0.3, 0.8], 3))
    row = np.arange(1, HEIGHT, 8)  # so far apart that none hides another
    count = row.size
    u = rng.integers(0, WIDTH, count).astype(np.float64)
    column = u.astype(np.int64)
    grid = HEIGHT // 2, WIDTH // 2
    disparity = rng.choice([8.0, 15.0, 17.0, 20.0, 24.0], grid).astype(np.float32)
    valid, textured = rng.random(grid) < 0.9, rng.random(grid) < 0.9
    ncc = rng.choice([FAIR, 0.7, 0.71, 0.9, 1.0], grid, p=[0.05, 0.05, 0.3, 0.3, 0.3]).astype(np.float32)
    d0 = rng.choice([5.0, 12.0, 17.0, 20.0, 40.0, 125.0, 124.0], count)
    near_edge = rng.random(count) < 0.2
    d0[near_edge] = np.maximum(u[near_edge] - rng.choice([0.5, 1.0], near_edge.sum()), 1.0)
    ncc_stereo = ncc[row // 2, column // 2]
    n0 = ncc_stereo - rng.choice([0.0, 0.25, 0.3, 0.35, 0.9], count).astype(np.float32)
    n0_at = {(r, c): value for r, c, value in zip((row // 2).tolist(), (column // 2).tolist(), n0, strict=True)}
    monkeypatch.setattr(lidar_conflict, "LIDAR_CONFLICT", replace(lidar_conflict.LIDAR_CONFLICT, most_verified=most))
    monkeypatch.setattr(
        lidar_conflict,
        "ncc_at",
        lambda _, __, r, c, ___: np.array([n0_at[at] for at in zip(r.tolist(), c.tolist(), strict=True)], np.float32),
    )
    view = seen_at(rig, row, column, u, d0)
    found = verify_conflicts(
        view,
        StereoMap(disparity, valid, textured, 2, 128),
        consistency_of(ncc),
        rig,
        1,
        NO_IMAGES,
    )

    counted, clear, over, conflict = np.zeros((4, count), np.bool_)
    for n in range(count):
        cell = row[n] // 2, column[n] // 2
        ds = disparity[cell]
        inside = 0 <= round((u[n] - d0[n]) / 2) < grid[1]
        over[n] = abs(d0[n] - ds) > 3 and abs(d0[n] - ds) > 0.05 * min(d0[n], ds)
        by_images, by_lidar = (over[n] and one for one in mirrored(view, n, row[n], ds))
        clear[n] = valid[cell] and u[n] - d0[n] >= 1 and inside and not by_images
        counted[n] = clear[n] and textured[cell] and ncc[cell] > np.float32(0.7) and not by_lidar
        clear[n] &= ncc[cell] > np.float32(FAIR) and d0[n] < 125
        conflict[n] = n0[n] < ncc[cell] - np.float32(0.3) and not passes_over(rig, row[n], u[n], d0[n], disparity)
    flagged = np.flatnonzero(counted & over)
    stride = max(int(np.ceil(flagged.size / most)), 1)
    lidar_conflicts = np.zeros(count, np.bool_)
    for place, n in enumerate(flagged):
        lidar_conflicts[n] = conflict[flagged[place - place % stride]]
    np.testing.assert_array_equal(found.lidar_conflicts, lidar_conflicts)
    np.testing.assert_array_equal(found.valid, counted & (lidar_conflicts | ~over))
    np.testing.assert_array_equal(found.votes.clear, clear)
    np.testing.assert_array_equal(found.votes.confirmed, clear & ~over)


@pytest.mark.parametrize(
    ("lidar", "column", "row", "hidden"),
    [
        # 12.5 px beside the point at half of the resolution is 6 cells farther left or right, up or down.
        ((0, -0.5, 0), 160, 60, True),
        ((0, -0.5, 0), 160, 12, True),
        ((0, -0.5, 0), 160, 11, False),
        ((0, 0.5, 0), 160, 106, True),
        ((0, 0.5, 0), 160, 107, False),
        ((-0.5, 0, 0), 12, 60, True),
        ((-0.5, 0, 0), 11, 60, False),
        ((0.5, 0, 0), 306, 60, True),
        ((0.5, 0, 0), 307, 60, False),
        ((0, 0, 0), 160, 60, False),
    ],
)
def test_a_beam_passes_over_what_stereo_sees_only_inside_the_image(monkeypatch, lidar, column, row, hidden):
    # Where it is inside nothing else is farther, where it is not the whole border is.
    grid = HEIGHT // 2, WIDTH // 2
    right, down, _ = np.sign(lidar).astype(int)
    disparity = np.full(grid, 20.0 if hidden else 16.9, np.float32)
    disparity[row // 2 + 6 * down * hidden, column // 2 + 6 * right * hidden] = 16.9 if hidden else 20.0
    monkeypatch.setattr(lidar_conflict, "ncc_at", lambda *a: np.zeros(a[2].size, np.float32))
    rig, ones = lidar_at(*lidar), np.ones(grid, np.bool_)
    view = seen_at(rig, np.array([row]), np.array([column]), np.array([float(column)]), np.array([5.0]))
    found = verify_conflicts(
        view, StereoMap(disparity, ones, ones, 2, 128), consistency_of(ones * 1.0), rig, 1, NO_IMAGES
    )
    assert found.lidar_conflicts.tolist() == [not hidden]


@pytest.mark.parametrize(("beyond_px", "hidden"), [(17.0, False), (16.9, True)])
def test_a_beam_passes_where_stereo_sees_more_than_three_pixels_less(monkeypatch, beyond_px, hidden):
    grid = HEIGHT // 2, WIDTH // 2
    disparity = np.full(grid, beyond_px, np.float32)
    disparity[30, 80] = 20.0
    monkeypatch.setattr(lidar_conflict, "ncc_at", lambda *a: np.zeros(a[2].size, np.float32))
    rig, ones = lidar_at(0, -0.5, 0), np.ones(grid, np.bool_)
    view = seen_at(rig, np.array([60]), np.array([160]), np.array([160.0]), np.array([5.0]))
    found = verify_conflicts(
        view, StereoMap(disparity, ones, ones, 2, 128), consistency_of(ones * 1.0), rig, 1, NO_IMAGES
    )
    assert found.lidar_conflicts.tolist() == [not hidden]


@pytest.mark.parametrize(("flagged", "verified"), [(1000, 1000), (1001, 501), (2001, 667)])
def test_of_a_thousand_flagged_points_all_are_verified_and_of_more_every_so_many_th(monkeypatch, flagged, verified):
    grid = HEIGHT // 2, WIDTH // 2
    sizes = []

    def remembered(*arguments):
        sizes.append(arguments[2].size)
        return np.zeros(arguments[2].size, np.float32)

    monkeypatch.setattr(lidar_conflict, "ncc_at", remembered)
    row, column = (part[:flagged] for part in np.divmod(np.arange(HEIGHT * 200), 200))
    rig, ones = plane_rig(), np.ones(grid, np.bool_)
    view = seen_at(rig, row, column + 60, column + 60.0, np.full(flagged, 40.0))
    stereo = StereoMap(np.full(grid, 20.0, np.float32), ones, ones, 2, 128)
    found = verify_conflicts(view, stereo, consistency_of(ones * 1.0), rig, 1, NO_IMAGES)
    assert sizes == [verified], "once, where conflicts and false ranges ask for the same points"
    assert found.lidar_conflicts.sum() == flagged


def test_a_road_is_beside_what_lies_below_it_in_its_own_strip_of_directions_up_to_the_outermost():
    columns = COUNT_GRID.lidar_cells[1]
    strip = np.array([-2, 0, 0, 1, 1, 1, columns - 2, columns - 2, columns - 1, columns - 1, columns])
    below_m = np.array([2.5, 1.75, 2.5, 2.0, 1.75, 2.5, 1.75, 2.0, 2.5, 1.75, 1.5])
    right = (strip + 0.5 - columns // 2) * COUNT_GRID.lidar_cell
    points = np.stack([9 * np.cos(right), -9 * np.sin(right), -below_m], axis=1).astype(np.float32)
    view = replace(lidar_view(PointCloud(0, points[:1]), plane_rig(), 3), point_m=points)
    found = lidar_conflict._beside_road(view, 1.5, 2.0)
    assert found.tolist() == [False] * 3 + [True] * 5 + [False] * 3


@pytest.mark.parametrize(
    ("below_m", "times", "by_images", "by_lidar"),
    [
        (1.5, 2.0, True, False),
        (1.25, 2.0, False, False),
        (1.75, 1.0, False, False),
        (1.8125, 1.0, True, True),
        (2.5, 0.75, True, True),
        (2.5, 0.625, False, True),
        (2.5, 0.5, False, False),
    ],
)
def test_the_road_is_a_quarter_of_a_metre_thick_to_what_wet_ground_mirrors(below_m, times, by_images, by_lidar):
    """A point so far below the LiDAR, of which stereo sees something so many times as far; the road is at 1.5 m."""
    points = np.array([[9, 0, -below_m], *[[9, 0, -1.5]] * 4], dtype=np.float32)
    view = replace(lidar_view(PointCloud(0, points), plane_rig(), 3), point_m=points, in_view_m=points)
    d0 = np.full(5, 32.0, np.float32)
    found = lidar_conflict._mirrored(view, d0, d0 / np.array([times, 1, 1, 1, 1], np.float32))
    assert [bool(one[0]) for one in found] == [by_images, by_lidar]
