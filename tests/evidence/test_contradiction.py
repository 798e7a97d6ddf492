from dataclasses import replace

import numpy as np
import pytest

from auditor.evidence import contradiction
from auditor.evidence.contradiction import adjudicate
from auditor.evidence.lidar import lidar_view
from auditor.evidence.likeness import likeness
from auditor.evidence.matchers import SgbmMatcher
from auditor.evidence.reduction import halve
from auditor.evidence.stereo import stereo_map
from auditor.evidence.texture import textured
from auditor.frames import PointCloud
from tests.evidence.scenes import HEIGHT, WIDTH, plane_cloud, plane_images, plane_rig

DEPTH_M = 9.0
BORDER_PX = 4  # the last columns have nothing beside them to be matched by


def judged(cloud, images=None):
    """Adjudicate S_1 and S_3's pictures of a plane 9 m away against a cloud."""
    rig = plane_rig()
    images = images or plane_images(rig, DEPTH_M)
    halves = halve(images[3]), halve(images[1])
    stereo = stereo_map(SgbmMatcher(), images[3], images[1], *(textured(half) for half in halves))
    view = lidar_view(PointCloud(0, cloud), rig, 3)
    return adjudicate(view, stereo, likeness(*halves, stereo), rig, 1, halves)


def with_wall(cloud, depth_m=5.0):
    """Everything between two columns moved nearer along its ray."""
    inside = np.abs(cloud[:, 1]) < 1.0
    return np.where(inside[:, None], cloud * np.float32(depth_m / DEPTH_M), cloud)


def test_a_cloud_that_agrees_is_not_contradicted():
    result = judged(plane_cloud(DEPTH_M))
    assert result.valid.sum() > 5000
    assert not result.contradicted[result.column < WIDTH - BORDER_PX].any()


def test_a_bogus_wall_is_contradicted_where_it_stands_and_nowhere_else():
    result = judged(with_wall(plane_cloud(DEPTH_M)))
    inside = np.abs(result.column - WIDTH / 2) < 25
    assert result.contradicted[result.valid & inside].mean() > 0.9
    outside = (np.abs(result.column - WIDTH / 2) > 45) & (result.column < WIDTH - BORDER_PX)
    assert not result.contradicted[outside].any()


def test_a_facula_on_a_camera_contradicts_nothing():
    images = plane_images(plane_rig(), DEPTH_M)
    images[1] = images[1].copy()
    images[1][20:100, 100:220] = 255
    result = judged(plane_cloud(DEPTH_M), images)
    assert result.contradicted.sum() < 0.01 * result.valid.sum()


def test_points_moved_by_one_period_of_a_texture_are_denied_only_by_a_pair_of_another_baseline():
    rig, period = plane_rig(), 24
    texture = np.tile(np.random.default_rng(0).integers(0, 256, (HEIGHT, period)), 40).astype(np.uint8)
    shifts = {1: 20, 2: 10, 3: 0}
    images = {n: np.ascontiguousarray(texture[:, WIDTH + s : 2 * WIDTH + s]) for n, s in shifts.items()}
    near_m = 300 * 0.6 / (20 + period)  # 44 px instead of 20 between S_1 and S_3, 22 instead of 10 between S_2 and S_3
    view = lidar_view(PointCloud(0, plane_cloud(near_m)), rig, 3)
    denied = {}
    for witness in (1, 2):
        halves = halve(images[3]), halve(images[witness])
        stereo = stereo_map(SgbmMatcher(), images[3], images[witness], *(textured(half) for half in halves))
        found = adjudicate(view, stereo, likeness(*halves, stereo), rig, witness, halves)
        denied[witness] = int(found.contradicted[found.column < WIDTH - period].sum())
    assert denied[2] > 3000
    assert denied[1] < denied[2] / 50


def test_only_points_that_the_pictures_can_judge_are_valid():
    images = {n: np.full_like(image, 128) for n, image in plane_images(plane_rig(), DEPTH_M).items()}
    for n, left in ((1, 100), (3, 120)):
        images[n][:, left : left + 100] = plane_images(plane_rig(), DEPTH_M)[3][:, 120:220]
    result = judged(plane_cloud(DEPTH_M), images)
    assert result.valid[(result.column > 130) & (result.column < 210)].mean() > 0.9
    assert not result.valid[result.column > 235].any()


def test_points_beyond_the_matcher_s_range_are_not_valid():
    near = judged(plane_cloud(1.4))  # 300 px 0.6 m / 1.4 m = 129 px
    assert not near.valid.any()


def test_of_many_flagged_points_a_few_stand_for_all(monkeypatch):
    cloud = with_wall(plane_cloud(DEPTH_M))
    everything = judged(cloud).contradicted
    monkeypatch.setattr(contradiction, "LIDAR_CONFLICT", replace(contradiction.LIDAR_CONFLICT, most_verified=50))
    asked = []
    original = contradiction.likeness_at
    monkeypatch.setattr(contradiction, "likeness_at", lambda *a: asked.append(a[2].size) or original(*a))
    few = judged(cloud).contradicted
    assert asked[0] <= 50
    assert few.sum() == pytest.approx(everything.sum(), rel=0.1)


def test_a_surface_that_the_beam_passes_over_is_no_contradiction():
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
    halves = halve(images[3]), halve(images[1])
    stereo = stereo_map(SgbmMatcher(), images[3], images[1], *(textured(half) for half in halves))
    cloud = plane_cloud(DEPTH_M)
    cloud[:, 2] -= 2.0
    results = {}
    for name, vehicle in (("above", lifted), ("beside", rig)):
        points = cloud if name == "above" else plane_cloud(DEPTH_M)
        view = lidar_view(PointCloud(0, points), vehicle, 3)
        result = adjudicate(view, stereo, likeness(*halves, stereo), vehicle, 1, halves)
        band = (result.row > top + 8) & (result.row < top + 20) & (result.column > 155) & (result.column < 190)
        results[name] = int(result.contradicted[band].sum())
    # The beam from the camera's own place would have to go through the post: there it is a contradiction.
    assert results["beside"] > 50
    assert results["above"] < results["beside"] / 5
