"""Ego-motion from two pictures and the LiDAR's range at their corners."""

import numpy as np
import pytest

from auditor.lab.simulation.drives import make_drive
from auditor.measurement.disparity.lidar import lidar_view
from auditor.measurement.ego_motion import ego_motion
from auditor.measurement.moment import Moment
from auditor.model.optics.geometry import compose, invert

DRIVE = make_drive(2, 6, n_cameras=1)
HALVED = np.array([[0.5, 0, -0.25], [0, 0.5, -0.25], [0, 0, 1]])


def moment(number: int) -> Moment:
    frame = DRIVE.frame(number)
    return Moment(frame.stamp_ns, frame.images[1].pixels, lidar_view(frame.cloud, DRIVE.rig, 1))


def motion_between(now: Moment, before: Moment, *, farther: float = 1.0):
    """The motion by the true ranges, or by those of `farther` times as far away."""
    pixels = now.view.row // 2, now.view.column // 2
    K = HALVED @ now.camera.intrinsics
    return ego_motion(now.half, before.half, K, farther * now.point_m, pixels)


def test_the_motion_is_that_of_the_vehicle():
    for number in (1, 4):
        found = motion_between(moment(number), moment(number - 1))
        now, before = (DRIVE.world_SE3_rig(n / 10) for n in (number, number - 1))
        true = compose(invert(before), now)
        assert np.linalg.norm(found.translation_m - true[:3, 3]) < 0.05 * np.linalg.norm(true[:3, 3])
        turn = np.arccos(np.clip((np.trace(found.rotation.T @ true[:3, :3]) - 1) / 2, -1, 1))
        assert np.degrees(turn) < 0.1


def test_ranges_give_the_motion_its_length():
    now, before = moment(2), moment(1)
    true, twice = (motion_between(now, before, farther=times) for times in (1.0, 2.0))
    assert np.linalg.norm(twice.translation_m) == pytest.approx(2 * np.linalg.norm(true.translation_m), rel=0.05)


def test_pictures_of_one_place_have_no_motion():
    now = moment(3)
    found = motion_between(now, now)
    np.testing.assert_allclose(found.translation_m, 0, atol=0.005)


def test_without_enough_corners_the_motion_is_not_known():
    now, before = moment(2), moment(1)
    few = slice(0, 12)
    K = HALVED @ now.camera.intrinsics
    pixels = now.view.row[few] // 2, now.view.column[few] // 2
    assert ego_motion(now.half, before.half, K, now.point_m[few], pixels) is None
    assert ego_motion(now.half, before.half, K, now.point_m[:0], (now.view.row[:0], now.view.column[:0])) is None


def test_pictures_that_have_nothing_in_common_give_no_motion():
    rng = np.random.default_rng(3)
    now = moment(2)
    noise = rng.integers(0, 256, now.half.shape, dtype=np.uint8)
    pixels = now.view.row // 2, now.view.column // 2
    assert ego_motion(now.half, noise, HALVED @ now.camera.intrinsics, now.point_m, pixels) is None
