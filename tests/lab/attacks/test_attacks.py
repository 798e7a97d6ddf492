from dataclasses import replace

import numpy as np
import pytest

from auditor.errors import SettingError
from auditor.lab.attacks.catalogue import ON_CAMERA, ON_LIDAR
from auditor.lab.attacks.paper import STRENGTHS, BogusWall, Facula, draw_facula, draw_wall
from auditor.lab.attacks.schedule import Attacker, AttackPlan
from auditor.model.frames import CameraImage, PointCloud
from auditor.model.rig import Camera, Lidar, Rig

WIDTH, HEIGHT = 300, 200
ROAD_M = 1.7
RIG_SE3_LIDAR = np.array([[0, -1, 0, 0.1], [0, 0, -1, -0.2], [1, 0, 0, -0.3], [0, 0, 0, 1]], dtype=np.float64)


def rig(lidar: bool = True) -> Rig:
    cameras = tuple(
        Camera(
            n,
            f"camera {n}",
            f"/camera_{n}",
            WIDTH,
            HEIGHT,
            np.array([[200, 0, 150, -200 * x], [0, 200, 100, 0], [0, 0, 1, 0]], float),
        )
        for n, x in enumerate((0.6, 0.3, 0.0), start=1)
    )
    return Rig(Lidar("lidar", "/points", RIG_SE3_LIDAR) if lidar else None, cameras)


def image(level: int = 100) -> CameraImage:
    return CameraImage(1, 7, np.full((HEIGHT, WIDTH), level, np.uint8))


def road_and_far_wall() -> PointCloud:
    """Beams that meet the road, or a facade 30 m ahead; LiDAR frame x forward, y left, z up."""
    azimuth, elevation = np.meshgrid(np.deg2rad(np.arange(-40, 40, 0.2)), np.deg2rad(np.arange(-24, 2, 0.4)))
    forward = np.ones_like(azimuth)
    left, up = np.tan(azimuth), np.tan(elevation)
    distance = np.where(up < 0, np.minimum(-ROAD_M / np.minimum(up, -1e-9), 30.0), 30.0)
    xyz = np.stack([forward, left, up], axis=-1) * distance[..., None]
    return PointCloud(7, xyz.reshape(-1, 3).astype(np.float32))


def test_a_facula_adds_its_gaussian_and_clips() -> None:
    facula = Facula(amplitude=400, radius_px=60, u_px=150, v_px=100)
    pixels = facula.apply(image()).pixels
    rho2 = (np.arange(WIDTH) - 150.0) ** 2
    expected = np.clip(np.rint(100 + 400 * np.exp(-rho2 / (2 * 30.0**2))), 0, 255)
    np.testing.assert_array_equal(pixels[100], expected)
    assert pixels[100, 150] == 255
    assert pixels[100, 0] == 100


def test_an_opaque_facula_blinds_about_its_radius_and_a_mild_one_only_its_centre() -> None:
    blind = {s: (Facula(A, 60, 150, 100).apply(image(0)).pixels == 255).sum() for s, A in STRENGTHS.items()}
    assert blind["opaque"] == pytest.approx(np.pi * 60**2, rel=0.05)
    assert blind["mild"] < 10 < blind["strong"] < blind["opaque"]


def test_a_facula_outside_the_image_leaves_it_alone_and_never_touches_the_original() -> None:
    original = image()
    assert (Facula(2000, 20, -500, -500).apply(original).pixels == 100).all()
    Facula(2000, 60, 10, 10).apply(original)
    assert (original.pixels == 100).all()


def test_a_facula_brightens_all_colours_alike() -> None:
    colour = CameraImage(1, 0, np.dstack([image(10).pixels, image(20).pixels, image(30).pixels]))
    pixels = Facula(100, 60, 150, 100).apply(colour).pixels
    assert pixels[100, 150].tolist() == [110, 120, 130]


def test_a_wall_stands_where_it_should_and_nothing_is_left_behind_it() -> None:
    wall = BogusWall(range_m=8, lateral_m=1, bottom_m=0.3)
    cloud = road_and_far_wall()
    attacked = wall.apply(cloud, rig()).xyz_m
    inside = (np.abs(-attacked[:, 1] / attacked[:, 0] * 8 - 1) < 1.2) & (attacked[:, 0] > 0)
    height = attacked[:, 2] / attacked[:, 0] * 8 + ROAD_M
    inside &= (height > 0.35) & (height < 1.75)
    assert inside.sum() > 200
    np.testing.assert_allclose(attacked[inside, 0], 8, atol=0.1)
    assert np.std(attacked[inside, 0]) == pytest.approx(0.02, rel=0.2)


def test_a_wall_leaves_what_stands_in_front_of_it_and_beside_it() -> None:
    cloud = road_and_far_wall()
    wall = BogusWall(range_m=8, lateral_m=0)
    attacked = wall.apply(cloud, rig()).xyz_m
    near = cloud.xyz_m[cloud.xyz_m[:, 0] < 7.9]
    assert {*map(tuple, near.tolist())} <= {*map(tuple, attacked.tolist())}
    assert abs(len(attacked) - len(cloud.xyz_m)) < 0.02 * len(cloud.xyz_m)


def test_a_wall_appears_even_where_no_beam_had_returned() -> None:
    cloud = road_and_far_wall()
    without_sky = PointCloud(0, cloud.xyz_m[cloud.xyz_m[:, 2] < -0.2])
    attacked = BogusWall(range_m=8, lateral_m=0, bottom_m=0.6, height_m=2.0).apply(without_sky, rig()).xyz_m
    assert ((attacked[:, 2] > 0) & (np.abs(attacked[:, 0] - 8) < 0.2)).sum() > 50


def test_a_wall_needs_a_lidar() -> None:
    with pytest.raises(SettingError, match="no"):
        BogusWall(8, 0).apply(road_and_far_wall(), rig(lidar=False))


def test_draws_follow_their_seed_and_the_papers_sizes() -> None:
    faculas = [draw_facula(np.random.default_rng(seed), 1242, 375, "mild") for seed in range(200)]
    assert faculas[3] == draw_facula(np.random.default_rng(3), 1242, 375, "mild")
    radii = [facula.radius_px for facula in faculas]
    assert 187 <= min(radii) < 195
    assert 367 < max(radii) <= 375
    assert draw_facula(np.random.default_rng(3), 621, 188, "mild").radius_px == pytest.approx(faculas[3].radius_px / 2)
    walls = [draw_wall(np.random.default_rng(seed)) for seed in range(200)]
    assert {(wall.width_m, wall.height_m) for wall in walls} == {(2.5, 1.5)}
    assert all(6 <= w.range_m <= 10 and abs(w.lateral_m) <= 3 and 0 <= w.bottom_m <= 0.6 for w in walls)


def test_an_unknown_strength_is_refused_with_the_known_ones() -> None:
    with pytest.raises(SettingError, match="mild, strong, opaque"):
        draw_facula(np.random.default_rng(0), 1242, 375, "blinding")


def test_a_plan_is_on_for_its_interval_and_its_label_gives_the_interval() -> None:
    attacker = Attacker(AttackPlan(sensor=1, from_ns=100, to_ns=300), rig())
    images = {stamp: attacker.change_image(replace(image(0), stamp_ns=stamp)) for stamp in (0, 100, 200, 300, 400)}
    assert {stamp for stamp, changed in images.items() if changed.pixels.any()} == {100, 200, 300}
    label = attacker.label
    assert label is not None
    assert (label.topic, label.attack, label.from_ns, label.to_ns) == ("/camera_1", "facula", 100, 300)
    assert label.parameters["amplitude"] == 2000.0


def test_a_still_attack_stays_and_a_moving_one_moves() -> None:
    still, moving = AttackPlan(sensor=2), AttackPlan(sensor=2, moving=True)
    assert still.attack_at(1, rig()) == still.attack_at(2, rig())
    assert moving.attack_at(1, rig()) != moving.attack_at(2, rig())
    assert moving.attack_at(1, rig()) == AttackPlan(sensor=2, moving=True).attack_at(1, rig())


def test_a_plan_that_was_never_on_has_no_label() -> None:
    attacker = Attacker(AttackPlan(sensor=0, from_ns=100), rig())
    cloud = road_and_far_wall()
    assert attacker.change_cloud(cloud) is cloud
    assert attacker.label is None


def test_a_sensor_that_the_rig_lacks_is_refused() -> None:
    with pytest.raises(SettingError, match=r"no S_4; it has S_0, S_1, S_2, S_3"):
        Attacker(AttackPlan(sensor=4), rig())


def test_a_plan_of_another_kind_does_it_and_names_it() -> None:
    dimmed = Attacker(AttackPlan(sensor=1, kind="dimmed", size=0.5), rig())
    assert np.array_equal(dimmed.change_image(image(100)).pixels, image(50).pixels)
    label = dimmed.label
    assert label is not None
    assert (label.attack, label.parameters["light"]) == ("dimmed", 0.5)


@pytest.mark.parametrize("kind", sorted(ON_LIDAR))
def test_every_kind_for_the_lidar_changes_its_cloud(kind: str) -> None:
    cloud = road_and_far_wall()
    left, up = np.meshgrid(np.arange(-0.9, 0.9, 0.1), np.arange(-1.3, 0, 0.1))
    car = np.stack([np.full(left.size, 20.0), left.ravel(), up.ravel()], axis=1)
    behind = car * np.array([2.0, 6.0, 1.0])
    cloud = PointCloud(7, np.concatenate([cloud.xyz_m, car, behind]).astype(np.float32))
    assert not np.array_equal(Attacker(AttackPlan(0, kind=kind), rig()).change_cloud(cloud).xyz_m, cloud.xyz_m)


def test_a_ghost_has_the_points_and_the_range_that_were_asked_for() -> None:
    attacker = Attacker(AttackPlan(0, kind="ghost", size=40, options={"range_m": 12.0}), rig())
    before = road_and_far_wall().xyz_m
    after = attacker.change_cloud(PointCloud(7, before)).xyz_m
    changed = np.concatenate([after[: len(before)][(after[: len(before)] != before).any(axis=1)], after[len(before) :]])
    assert len(changed) == 40
    np.testing.assert_allclose(changed[:, 0], 12.0, atol=0.2)
    assert attacker.label is not None
    assert (attacker.label.attack, attacker.label.parameters["points"]) == ("ghost", 40)


@pytest.mark.parametrize("kind", sorted(ON_CAMERA))
def test_every_kind_for_a_camera_changes_its_image(kind: str) -> None:
    textured = replace(image(0), pixels=np.random.default_rng(0).integers(60, 190, image(0).pixels.shape, np.uint8))
    assert not np.array_equal(Attacker(AttackPlan(1, kind=kind), rig()).change_image(textured).pixels, textured.pixels)


def test_a_delayed_camera_shows_what_it_saw_so_many_frames_ago() -> None:
    attacker = Attacker(AttackPlan(1, kind="delayed", size=2), rig())
    seen = [attacker.change_image(replace(image(level), stamp_ns=level)) for level in range(5)]
    assert [int(one.pixels.max()) for one in seen] == [0, 1, 0, 1, 2]
    assert [one.stamp_ns for one in seen] == [0, 1, 2, 3, 4]
    label = attacker.label
    assert label is not None
    assert (label.from_ns, label.to_ns, label.parameters["frames"]) == (2, 4, 2)


def test_a_frozen_camera_shows_what_it_saw_when_it_froze() -> None:
    attacker = Attacker(AttackPlan(1, kind="frozen", from_ns=2, to_ns=3), rig())
    seen = [attacker.change_image(replace(image(level), stamp_ns=level)) for level in range(5)]
    assert [int(one.pixels.max()) for one in seen] == [0, 1, 2, 2, 4]


def test_a_plan_of_a_kind_that_a_sensor_cannot_suffer_is_refused() -> None:
    with pytest.raises(SettingError, match="hidden cannot be done to a camera; use facula"):
        Attacker(AttackPlan(1, kind="hidden"), rig())
    with pytest.raises(SettingError, match="name it with --pattern"):
        Attacker(AttackPlan(1, kind="pattern"), rig())
