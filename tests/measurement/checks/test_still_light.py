"""Light that stays at its place in a camera's picture while the scene moves."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from auditor.lab.attacks.paper import Facula
from auditor.lab.simulation.drives import make_drive
from auditor.measurement import measure_stream
from auditor.measurement.checks.in_time.still_light import Glimpse
from auditor.measurement.disparity.matchers import find_matcher
from auditor.measurement.ego_motion import Motion
from auditor.model.checks import Check, SensorCheck
from auditor.model.frames import CameraImage, Frame
from auditor.model.measurement import Measurement

DRIVE = make_drive(2, 10, n_cameras=1)
STILL = SensorCheck(Check.STILL_LIGHT, 1, (0,))
WIDTH, HEIGHT = DRIVE.rig.cameras[0].width_px, DRIVE.rig.cameras[0].height_px
ASIDE = Facula(255.0, 0.2 * WIDTH, 0.7 * WIDTH, 0.7 * HEIGHT)


@cache
def drive_frames() -> tuple[Frame, ...]:
    return tuple(one for one in DRIVE.frames() if isinstance(one, Frame))


def measured(frames: list[Frame]) -> list[Measurement]:
    return [one[0] for one in measure_stream(frames, DRIVE.rig, find_matcher("sgbm")) if isinstance(one, tuple)]


def statistics(change: Callable[[CameraImage], CameraImage], since: int = 0) -> list[float | None]:
    """By frame, where the pictures from one on are changed."""
    frames = [
        replace(one, images={1: change(one.images[1])}) if place >= since else one
        for place, one in enumerate(drive_frames())
    ]
    return [one.shares.get(STILL) for one in measured(frames)]


@pytest.fixture(scope="module")
def clean() -> list[float | None]:
    return statistics(lambda image: image)


def test_a_clean_drive_has_hardly_any_and_says_how_much_of_the_picture_was_looked_at(clean: list[float | None]) -> None:
    assert clean[0] is None, "there is no past yet"
    assert max(one for one in clean if one is not None) < 0.2
    last = measured(list(drive_frames()))[-1].coverage[1]
    assert last.compared_share is not None
    assert 0.3 < last.compared_share < 1
    assert last.compared_by_two_share == 0


def test_light_that_was_there_all_along_shows_once_the_vehicle_has_moved(clean: list[float | None]) -> None:
    lit = statistics(ASIDE.apply)
    assert min(one for one in lit[5:] if one is not None) > 2 * max(one for one in clean if one is not None)


def test_an_opaque_light_that_was_there_all_along_shows_where_the_scene_comes_out_of_it(
    clean: list[float | None],
) -> None:
    """Ahead the scene moves outwards: nothing moves into a light in the middle, and all is white in it."""
    middle = Facula(2000.0, 0.15 * WIDTH, 0.5 * WIDTH, 0.6 * HEIGHT)
    lit = statistics(middle.apply)
    assert max(one for one in lit if one is not None) > 3 * max(one for one in clean if one is not None)


def test_what_is_white_in_both_pictures_is_not_looked_at() -> None:
    def white_below(share: float) -> Callable[[CameraImage], CameraImage]:
        def change(image: CameraImage) -> CameraImage:
            rows = np.arange(HEIGHT)[:, None] > (1 - share) * HEIGHT
            return replace(image, pixels=np.where(rows, np.uint8(255), image.pixels))

        return change

    def compared(share: float) -> list[bool]:
        changed = [replace(one, images={1: white_below(share)(one.images[1])}) for one in drive_frames()]
        return [counts is not None and counts.valid_px > 0 for one in measured(changed) for counts in one.counts]

    assert compared(0.1)[3:] == [True] * (len(drive_frames()) - 3)
    assert compared(0.35) == [False] * len(drive_frames())


def test_light_that_begins_shows_at_once(clean: list[float | None]) -> None:
    lit = statistics(ASIDE.apply, since=6)
    assert lit[:6] == clean[:6]
    assert min(one for one in lit[6:] if one is not None) > 2 * max(one for one in clean if one is not None)


def test_light_that_ended_shows_no_more() -> None:
    """It is still in the earlier pictures, and what it lit there is darker now."""
    opaque = Facula(2000.0, 0.12 * WIDTH, 0.7 * WIDTH, 0.7 * HEIGHT)
    ends_ns = drive_frames()[6].stamp_ns
    lit = statistics(lambda image: opaque.apply(image) if image.stamp_ns < ends_ns else image)
    assert min(one for one in lit[2:6] if one is not None) > 0.3
    assert max(one for one in lit[6:] if one is not None) < 0.05


def disc(u_px: float) -> Callable[[CameraImage], CameraImage]:
    """What makes a round patch white, with a sharp edge."""
    down, across = np.ogrid[:HEIGHT, :WIDTH]
    inside = np.hypot(across - u_px, down - 0.7 * HEIGHT) < 0.12 * WIDTH

    def change(image: CameraImage) -> CameraImage:
        return replace(image, pixels=np.where(inside, np.uint8(255), image.pixels))

    return change


def test_a_white_patch_that_is_elsewhere_in_the_next_frame_counts_for_less() -> None:
    """What passes near by, as the roof of a car that reflects the sky, is elsewhere in each frame."""
    here, there = disc(0.7 * WIDTH), disc(0.2 * WIDTH)
    passing = statistics(lambda image: (there if image.stamp_ns // 10**8 % 2 else here)(image), since=6)[7:]
    staying = statistics(here, since=6)[7:]
    assert max(one for one in passing if one is not None) < 0.5 * min(one for one in staying if one is not None)


def test_light_of_one_frame_shows_as_light_that_stays() -> None:
    """It fades at its edge, which no roof does."""
    once = statistics(ASIDE.apply, since=9)[9]
    staying = statistics(ASIDE.apply, since=6)[9]
    assert once is not None
    assert staying is not None
    assert once > 0.9 * staying


@pytest.mark.parametrize(
    ("across_px", "down_px", "sharpened", "fading"),
    [(40.0, 40.0, 1.0, True), (44.0, 36.0, 1.0, True), (90.0, 12.0, 1.0, False), (40.0, 40.0, 30.0, False)],
    ids=["a spot", "a spot that is not quite round", "a streak", "a disc"],
)
def test_what_saturates_is_thrown_light_where_it_is_round_and_fades(
    across_px: float, down_px: float, sharpened: float, *, fading: bool
) -> None:
    row, column = np.mgrid[:240, :320]
    light = np.exp(-(((column - 160) / across_px) ** 2 + ((row - 120) / down_px) ** 2) / 2)
    half = np.clip(220 + 400 * sharpened * (light - 0.4), 60, 255).astype(np.uint8)
    glimpse = Glimpse.of(0, half, np.eye(3), np.zeros((0, 3)), (Motion(np.eye(3), np.zeros(3)), 0.0))
    saturated = glimpse.levels >= glimpse.saturation
    assert np.count_nonzero(saturated) > 50
    assert (glimpse.fading > 0).tolist() == (saturated & fading).tolist()


def test_a_picture_without_a_patch_and_one_that_is_all_white_have_no_thrown_light() -> None:
    for level in (60, 255):
        picture = np.full((240, 320), level, dtype=np.uint8)
        glimpse = Glimpse.of(0, picture, np.eye(3), np.zeros((0, 3)), (Motion(np.eye(3), np.zeros(3)), 0.0))
        assert not glimpse.fading.any()


@pytest.mark.parametrize("gain", [0.7, 1.3])
def test_an_exposure_that_changes_is_none(gain: float, clean: list[float | None]) -> None:
    def brighter(image: CameraImage) -> CameraImage:
        return replace(image, pixels=np.clip(np.rint(image.pixels * gain), 0, 255).astype(np.uint8))

    lit = statistics(brighter, since=6)
    assert max(one for one in lit if one is not None) < 0.2


def test_where_the_vehicle_stands_nothing_is_looked_at() -> None:
    first = drive_frames()[0]
    standing = [replace(first, number=number, stamp_ns=first.stamp_ns + number * 10**8) for number in range(4)]
    found = measured(standing)
    assert [one.shares.get(STILL) for one in found] == [None] * 4
    assert found[-1].coverage[1].compared_share == 0


@pytest.mark.parametrize(("every", "reach"), [(1, 1), (4, 4), (9, 9), (30, 12)])
def test_near_points_of_a_sparse_lidar_hide_what_lies_behind_out_to_its_next_rows(every: int, reach: int) -> None:
    """At quarter resolution a LiDAR of 32 rings leaves several rows of pixels between two of them."""
    row, column = (one.ravel() for one in np.mgrid[40:101:every, 20:60])
    quarter = np.array([[160.0, 0, 159.5], [0, 160.0, 79.5], [0, 0, 1]])
    point_m = 10.0 * np.stack([column, row, np.ones(row.size)], axis=1) @ np.linalg.inv(quarter).T
    whole = np.array([[640.0, 0, 639.5], [0, 640.0, 319.5], [0, 0, 1]])
    here = Motion(np.eye(3), np.zeros(3)), 0.0
    nearest_m = Glimpse.of(0, np.zeros((320, 640), np.uint8), whole, point_m, here).nearest_m
    known = nearest_m < 11
    rows = np.flatnonzero(known[:, 40])
    assert (rows[0], rows[-1]) == (40 - reach, row.max() + reach)
    assert known[rows[0] : rows[-1] + 1, 25:55].all() == (every < 30), "the rows of a LiDAR leave no gap"
    assert not known[:, 62:].any()
