"""Sensors that hide, invent, lag or have moved do exactly that, and nothing else."""

import numpy as np
import pytest

from auditor.errors import SettingError
from auditor.lab.attacks.faults import (
    DelayedCamera,
    DelayedLidar,
    DimmedCamera,
    HiddenSector,
    ScatteredPoints,
    ShiftedCamera,
    SoiledLens,
    TurnedLidar,
)
from auditor.model.frames import CameraImage, PointCloud
from tests.making.scenes import plane_rig

RIG = plane_rig()


def cloud(stamp_ns=7):
    """A ring of points, one a degree, 10 m away, in a LiDAR frame with x forward and y to the left."""
    angle = np.deg2rad(np.arange(-180, 180) + 0.5)
    points = np.stack([10 * np.cos(angle), -10 * np.sin(angle), np.zeros(360)], axis=1)
    return PointCloud(stamp_ns, points.astype(np.float32))


def azimuths_deg(points):
    return np.rad2deg(np.arctan2(-points[:, 1], points[:, 0]))


@pytest.mark.parametrize("width", [10, 20, 30])
def test_a_hidden_sector_is_empty_and_the_rest_is_untouched(width):
    left = HiddenSector(float(width), 15.0).apply(cloud(), RIG)
    kept = azimuths_deg(left.xyz_m)
    assert len(kept) == 360 - width
    assert np.abs(kept - 15.0).min() > width / 2
    assert set(map(tuple, left.xyz_m)) <= set(map(tuple, cloud().xyz_m))
    assert left.stamp_ns == 7


def test_scattered_points_come_last_in_view_and_are_the_same_every_time():
    attack = ScatteredPoints(400, seed=3)
    first, second = attack.apply(cloud(), RIG), attack.apply(cloud(), RIG)
    assert np.array_equal(first.xyz_m, second.xyz_m)
    assert np.array_equal(first.xyz_m[:360], cloud().xyz_m)
    spoofed = first.xyz_m[360:]
    assert spoofed.shape == (400, 3)
    assert np.abs(azimuths_deg(spoofed)).max() <= 35.01
    distance = np.linalg.norm(spoofed, axis=1)
    assert 4 <= distance.min() < distance.max() <= 40
    assert not np.array_equal(attack.apply(cloud(8), RIG).xyz_m, first.xyz_m)


def test_a_turned_lidar_sees_everything_turned_by_as_much():
    turned = TurnedLidar(0.5).apply(cloud(), RIG).xyz_m
    away = np.abs(azimuths_deg(turned) - azimuths_deg(cloud().xyz_m))
    assert np.minimum(away, 360 - away) == pytest.approx(0.5, abs=1e-3)
    assert np.linalg.norm(turned, axis=1) == pytest.approx(10)


def test_a_shifted_camera_shows_its_image_lower():
    pixels = np.arange(12, dtype=np.uint8).reshape(4, 3)
    shifted = ShiftedCamera(2).apply(CameraImage(1, 5, pixels))
    assert np.array_equal(shifted.pixels, pixels[[0, 0, 0, 1]])
    assert (shifted.sensor, shifted.stamp_ns) == (1, 5)


def test_a_delayed_sensor_shows_the_earlier_data_under_the_later_stamp():
    earlier, later = (CameraImage(2, stamp, np.full((2, 2), stamp, np.uint8)) for stamp in (1, 9))
    shown = DelayedCamera(3, earlier).apply(later)
    assert (shown.stamp_ns, shown.pixels[0, 0]) == (9, 1)
    scan = DelayedLidar(3, cloud(1)).apply(PointCloud(9, np.zeros((1, 3), np.float32)), RIG)
    assert (scan.stamp_ns, len(scan.xyz_m)) == (9, 360)


def test_attacks_on_a_lidar_need_one():
    without = plane_rig(lidar=False)
    for attack in (HiddenSector(10, 0), ScatteredPoints(1, 0), TurnedLidar(1)):
        with pytest.raises(SettingError, match="needs a LiDAR"):
            attack.apply(cloud(), without)


def test_a_shifted_camera_may_look_aside_as_well():
    pixels = np.arange(12, dtype=np.uint8).reshape(4, 3)
    shifted = ShiftedCamera(0, -1).apply(CameraImage(1, 5, pixels))
    assert np.array_equal(shifted.pixels, pixels[:, [1, 2, 2]])


def test_a_lidar_that_has_tilted_sees_what_lies_ahead_higher_or_lower():
    ahead = PointCloud(0, np.array([[10, 0, 0]], np.float32))
    x, y, z = TurnedLidar(0, 2).apply(ahead, RIG).xyz_m[0]
    assert np.hypot(x, z) == pytest.approx(10)
    assert (abs(np.rad2deg(np.arctan2(z, x))), y) == pytest.approx((2, 0), abs=1e-3)


def test_a_dimmed_camera_gets_its_share_of_the_light():
    dimmed = DimmedCamera(0.2).apply(CameraImage(1, 5, np.full((2, 2, 3), 100, np.uint8)))
    assert np.array_equal(dimmed.pixels, np.full((2, 2, 3), 20, np.uint8))


def test_dirt_stays_in_its_place_and_hides_what_is_behind_it():
    dirt = SoiledLens(4, seed=1)
    bright, black = (dirt.apply(CameraImage(1, 0, np.full((100, 300), grey, np.uint8))).pixels for grey in (200, 0))
    changed = bright < 199
    assert 0.02 < changed.mean() < 0.6
    assert black[bright < 190].all()
    assert not black[bright == 200].any()
    assert bright.min() < 45
    assert not np.array_equal(dirt.apply(CameraImage(2, 0, np.full((100, 300), 200, np.uint8))).pixels, bright)
