"""The picture of a rig from above: everything on board is on it, where it is."""

import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from auditor.model.rig import Rig
from auditor.reporting.rig_picture import rig_picture
from auditor.reporting.rig_plan import PlacedRig, UnusedLidar, in_lidar_frame, planned
from tests.making.published_rigs import PUBLISHED_RIGS
from tests.making.recorded_drives import make_rig
from tests.making.several_lidars import BUMPER, REAR, ROOF, rig_of


def ring(fleet: str) -> list[PlacedRig]:
    published = PUBLISHED_RIGS[fleet]
    return [PlacedRig(published.lone(camera.name), np.eye(4)) for camera in published.cameras]


@pytest.mark.parametrize("fleet", PUBLISHED_RIGS)
def test_all_cameras_of_a_fleet_look_where_they_do_and_sit_where_they_are(fleet: str) -> None:
    seen = {one.name: one for one in planned(ring(fleet), []).cameras}
    published = PUBLISHED_RIGS[fleet]
    for camera in published.cameras:
        drawn = seen[camera.name]
        assert np.cos(np.radians(drawn.yaw_deg - camera.yaw_deg)) > 0.999
        assert drawn.parts[0].from_deg < drawn.yaw_deg < drawn.parts[-1].to_deg
    first, last = published.cameras[0], published.cameras[-1]
    apart = seen[first.name].ahead_m - seen[last.name].ahead_m, seen[first.name].left_m - seen[last.name].left_m
    assert apart == pytest.approx(np.subtract(first.at_m, last.at_m)[:2], abs=0.02)


def test_a_wide_lens_is_compared_in_its_middle_and_not_at_its_edges() -> None:
    [front] = planned(ring("zod"), []).cameras
    assert [part.others for part in front.parts] == [0, 1, 0]
    assert front.parts[-1].to_deg - front.parts[0].from_deg == pytest.approx(120, abs=2)


def test_a_lone_camera_is_drawn_where_its_name_says_that_it_looks() -> None:
    nuscenes = PUBLISHED_RIGS["nuscenes"]
    for name, yaw_deg, headed in (("cam_front", 0, True), ("cam_back", 180, True), ("cam_back_left", 0, False)):
        plan = planned([in_lidar_frame(nuscenes.lone(name))], [])
        assert np.cos(np.radians(plan.cameras[0].yaw_deg - yaw_deg)) > 0.999
        assert plan.headed is headed
        assert ("ahead is up" in rig_picture([in_lidar_frame(nuscenes.lone(name))])) is headed


def test_rectified_cameras_and_a_lidar_are_each_compared_with_all_the_others() -> None:
    [one, two, three] = planned([in_lidar_frame(make_rig(3))], []).cameras
    assert [[part.others for part in camera.parts] for camera in (one, two, three)] == [[3], [3], [3]]
    assert one.left_m < two.left_m < three.left_m
    assert max(abs(camera.yaw_deg) for camera in (one, two, three)) < 1


def test_without_a_lidar_only_the_cameras_count() -> None:
    rig = make_rig(3)
    plan = planned([in_lidar_frame(Rig(None, rig.cameras))], [])
    assert not plan.lidars
    assert {part.others for camera in plan.cameras for part in camera.parts} == {2}


def test_lidars_that_nothing_is_compared_with_are_drawn_or_named() -> None:
    svg = rig_picture(ring("pandaset"), [UnusedLidar("pandar_gt", np.array([1.75, 0, 1.7])), UnusedLidar("lost", None)])
    assert svg.count('class="unused"') == 2  # on the vehicle and in the legend
    assert "LiDAR that is compared with nothing: pandar_gt" in svg
    assert "place not known: lost" in svg


def test_names_of_a_recording_are_escaped_and_cut() -> None:
    rig = PUBLISHED_RIGS["zod"].lone("front")
    evil = replace(rig.camera(1), name="<script>alert('x')</script> and more of it")
    svg = rig_picture([PlacedRig(Rig(rig.lidar, (evil,)), np.eye(4))])
    ElementTree.fromstring(svg)  # it is whole XML
    assert "<script" not in svg


def test_no_two_names_lie_on_top_of_each_other() -> None:
    for fleet in PUBLISHED_RIGS:
        places = re.findall(r'<text x="([-\d.]+)" y="([-\d.]+)" text-anchor', rig_picture(ring(fleet)))
        at = [(float(x), float(y)) for x, y in places]
        assert len(at) == len(PUBLISHED_RIGS[fleet].cameras)
        assert all(
            abs(y - other_y) >= 13 or abs(x - other_x) > 60
            for n, (x, y) in enumerate(at)
            for other_x, other_y in at[:n]
        )


def test_lidars_that_are_compared_with_each_other_are_named_and_joined() -> None:
    rig = rig_of(ROOF, REAR, BUMPER)
    svg = rig_picture([in_lidar_frame(rig)])
    assert "compared with each other: S_0 roof, S_1 rear, S_2 bumper" in svg
    assert svg.count('class="pair"') == 3 + 1, "a line for each two, and one in the legend"
    at = {name: float(y) for y, name in re.findall(r'class="beside" x="[-\d.]+" y="([-\d.]+)">S_\d (\w+)<', svg)}
    assert at["bumper"] < at["roof"] < at["rear"], "ahead is up"
    assert "LiDAR S_0:" not in svg


def test_the_lidar_of_the_cameras_is_told_from_the_others() -> None:
    nuscenes = PUBLISHED_RIGS["nuscenes"].lone("cam_front")
    svg = rig_picture([in_lidar_frame(nuscenes), in_lidar_frame(rig_of(BUMPER, ROOF))])
    assert "LiDAR S_0 of the cameras: lidar_top" in svg
    assert "compared with each other: S_0 bumper, S_1 roof" in svg
