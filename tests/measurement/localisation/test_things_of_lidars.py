"""What LiDARs without cameras say is not there: as regions, and in pictures."""

from collections.abc import Sequence

import cv2
import numpy as np
import pytest

from auditor.lab.attacks.spoofing import GhostCar
from auditor.measurement import localise, measure_stream
from auditor.measurement.disparity.matchers import SgbmMatcher
from auditor.measurement.drawing import damaged_cloud, draw_frame
from auditor.measurement.drawing.clouds import ThingInFrame, range_image, seen_together
from auditor.model.arrays import Image
from auditor.model.frames import Frame, SkippedFrame
from auditor.model.measurement import Region
from auditor.model.pictures import LIDAR_COLOURS, Content
from tests.making.several_lidars import BUMPER, REAR, ROOF, attacked, rig_of, street

RIG = rig_of(ROOF, REAR)
AHEAD, NEARER = GhostCar(120, 12.0, seed=1), GhostCar(60, 8.0, seed=2)


@pytest.fixture(scope="module")
def frames() -> list[Frame]:
    return list(street((ROOF, REAR), 46001, 3))


def decoded(data: bytes) -> Image:
    return np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR), dtype=np.uint8)


def regions(frames: Sequence[Frame], *sensors: int) -> list[Region]:
    """Those of the last frame."""
    *_, last = measure_stream(frames, RIG, SgbmMatcher())
    assert not isinstance(last, SkippedFrame)
    return list(localise(last[1], sensors, RIG))


def test_a_ghost_is_a_solid_at_its_place_and_the_lidar_that_does_not_see_it_is_its_view(frames: list[Frame]) -> None:
    found = regions([attacked(one, RIG, 1, AHEAD) for one in frames], 0, 1)
    assert [(one.sensor, one.view, one.box_px, one.mask) for one in found] == [(1, 0, (0, 0, 0, 0), b"")]
    [ghost] = found
    assert ghost.solid
    assert ghost.points
    assert ghost.solid.centre_m[:2] == pytest.approx((12, 0), abs=0.3)
    assert 20 < ghost.points <= 120


def test_things_that_lie_apart_are_regions_of_their_own(frames: list[Frame]) -> None:
    both = [attacked(attacked(one, RIG, 0, AHEAD), RIG, 0, NEARER) for one in frames]
    solids = [one.solid for one in regions(both, 0, 1)]
    assert sorted(round(one.centre_m[0]) for one in solids if one) == [8, 12]


def test_a_sensor_that_is_not_asked_about_and_a_clean_frame_have_none(frames: list[Frame]) -> None:
    assert regions([attacked(one, RIG, 1, AHEAD) for one in frames], 0) == []
    assert regions(frames, 0, 1) == []


def test_the_pictures_have_both_clouds_the_ghost_in_red_and_its_place_in_the_other_range_image(
    frames: list[Frame],
) -> None:
    ghost = [attacked(one, RIG, 1, AHEAD) for one in frames]
    found = regions(ghost, 0, 1)
    drawn = {(one.sensor, one.content): decoded(one.data) for one in draw_frame(ghost[-1], RIG, found)}
    assert list(drawn) == [(0, Content.ABOVE), (0, Content.RANGE), (1, Content.RANGE)]
    above = drawn[0, Content.ABOVE]
    for colour in LIDAR_COLOURS[:2]:
        assert (above == tuple(bytes.fromhex(colour))[::-1]).all(axis=2).sum() > 1000
    red = np.argwhere((above == (60, 60, 255)).all(axis=2))
    ahead_m = (450 - red.mean(axis=0)[0]) / 450 * 20
    assert ahead_m == pytest.approx(12 - 1.6, abs=0.5), "the rear LiDAR is 1.6 m behind the roof's"
    plain = {(one.sensor, one.content): decoded(one.data) for one in draw_frame(ghost[-1], RIG, [])}
    for sensor in (0, 1):
        changed = np.argwhere((drawn[sensor, Content.RANGE] != plain[sensor, Content.RANGE]).any(axis=2))
        assert 300 < changed[changed[:, 0] < 256].mean(axis=0)[1] < 1140, "about the middle, which is ahead"


def test_the_frame_around_what_stands_behind_is_at_one_edge(frames: list[Frame]) -> None:
    cloud, place = frames[0].clouds[0].xyz_m, RIG.lidars[0].rig_SE3_lidar
    behind = np.array([[-10, y, z] for y in (-0.5, 0.2, 0.5) for z in (-1, 0)], np.float32)
    nothing = np.zeros(len(cloud), bool)
    plain, drawn = (range_image(cloud, nothing, place, framed) for framed in ((), [ThingInFrame(1, behind)]))
    columns = np.flatnonzero((plain != drawn).any(axis=(0, 2)))
    assert columns.min() > 1000 or columns.max() < 440


def test_the_lidars_colours_differ_in_their_greys() -> None:
    greys = [np.dot(tuple(bytes.fromhex(one)), (0.299, 0.587, 0.114)) for one in LIDAR_COLOURS[:2]]
    assert greys[0] - greys[1] > 80


def test_a_view_of_three_clouds_without_anything_contradicted_shows_them_all(frames: list[Frame]) -> None:
    three = rig_of(ROOF, REAR, BUMPER)
    points = {0: frames[0].clouds[0].xyz_m, 1: frames[0].clouds[1].xyz_m, 2: np.zeros((0, 3), np.float32)}
    drawn = seen_together(points, {one: np.zeros(len(xyz), bool) for one, xyz in points.items()}, three)
    assert not (drawn == (60, 60, 255)).all(axis=2).any()


def test_points_in_a_thing_are_those_that_were_measured(frames: list[Frame]) -> None:
    ghost = [attacked(one, RIG, 1, AHEAD) for one in frames]
    [region] = regions(ghost, 0, 1)
    marked = np.count_nonzero(damaged_cloud(ghost[-1].clouds[1], RIG, [region], 1))
    assert region.points
    assert region.points <= marked <= 1.2 * region.points
    assert not damaged_cloud(ghost[-1].clouds[0], RIG, [region]).any()
