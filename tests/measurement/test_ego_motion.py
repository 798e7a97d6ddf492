"""Ego-motion from two pictures and the LiDAR's range at their corners."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from auditor.lab.simulation.drives import make_drive
from auditor.measurement.disparity.lidar import lidar_view
from auditor.measurement.ego_motion import ego_motion
from auditor.measurement.moment import Moment
from auditor.model.arrays import Image
from auditor.model.optics.geometry import compose, invert

DRIVE = make_drive(2, 6, n_cameras=1)


def moment(number: int) -> Moment:
    frame = DRIVE.frame(number)
    return Moment(frame.stamp_ns, frame.images[1].pixels, lidar_view(frame.cloud, DRIVE.rig, 1))


def showing(now: Moment, picture: Image) -> Moment:
    """The moment with another picture."""
    return Moment(now.stamp_ns, picture, now.view)


def motion_between(now: Moment, before: Moment, *, farther: float = 1.0, some: slice = slice(None)):
    """The motion by the true ranges, or by those of `farther` times as far away."""
    ranged = Moment(now.stamp_ns, now.grey, replace(now.view, point_m=farther * now.view.point_m))
    return ego_motion(ranged, before, np.arange(now.view.row.size)[some])


def spots() -> Image:
    """A pattern of spots on a third of the picture, as a projector throws it into a lens."""
    thrown = np.zeros(DRIVE.frame(0).images[1].pixels.shape[:2], dtype=np.uint8)
    cells = np.random.default_rng(5).integers(0, 2, (16, 48), dtype=np.uint8) * 180
    thrown[100:300, 300:900] = cv2.resize(cells, (600, 200))
    return thrown


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
    assert motion_between(now, before, some=slice(0, 12)) is None
    assert motion_between(now, before, some=slice(0, 0)) is None


def test_pictures_that_have_nothing_in_common_give_no_motion():
    rng = np.random.default_rng(3)
    now = moment(2)
    assert motion_between(now, showing(now, rng.integers(0, 256, now.grey.shape, dtype=np.uint8))) is None


def test_a_pattern_that_is_thrown_into_the_lens_does_not_make_the_vehicle_stand():
    now, before = moment(4), moment(3)
    true = motion_between(now, before)
    lit = motion_between(*(showing(each, cv2.add(each.grey, spots())) for each in (now, before)))
    assert np.linalg.norm(lit.translation_m - true.translation_m) < 0.1 * true.length_m


def test_a_vehicle_stands_though_a_pattern_moves_over_half_of_its_picture():
    now = moment(4)
    moved = now.grey.copy()
    moved[:, 300:900] = np.roll(now.grey, 6, axis=1)[:, 300:900]
    assert motion_between(now, showing(now, moved)).length_m < 0.05


def noisy(picture: Image, seed: int) -> Image:
    """The picture with fresh noise of two levels."""
    noise = np.random.default_rng(seed).normal(0, 2, picture.shape)
    return np.clip(picture + noise, 0, 255).astype(np.uint8)


def test_a_picture_that_is_repeated_with_fresh_noise_stands_and_the_ranges_say_that_the_vehicle_does_not():
    now, before = moment(4), moment(3)
    true = motion_between(now, before)
    found = motion_between(showing(now, noisy(before.grey, 1)), showing(before, noisy(before.grey, 2)))
    assert found.by_ranges
    assert not true.by_ranges
    assert np.linalg.norm(found.translation_m - true.translation_m) < 0.25


def test_where_the_ranges_say_so_too_the_vehicle_stands():
    now = moment(4)
    found = motion_between(showing(now, noisy(now.grey, 1)), showing(now, noisy(now.grey, 2)))
    assert not found.by_ranges
    assert found.length_m < 0.05


def test_a_strong_pattern_over_half_of_the_picture_has_all_corners_and_does_not_make_the_vehicle_stand():
    now, before = moment(4), moment(3)
    speckle = np.random.default_rng(5).integers(0, 2, (now.grey.shape[0] // 4 + 1, 160), dtype=np.uint8) * 180
    thrown = np.zeros_like(now.grey)
    thrown[:, :640] = np.kron(speckle, np.ones((4, 4), dtype=np.uint8))[: now.grey.shape[0]]
    true = motion_between(now, before)
    lit = motion_between(*(showing(each, cv2.add(each.grey, thrown)) for each in (now, before)))
    assert np.linalg.norm(lit.translation_m - true.translation_m) < 0.1 * true.length_m
