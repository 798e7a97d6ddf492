from dataclasses import replace

import numpy as np

from auditor.cli.capabilities import capabilities, short_pairs
from tests.making.scenes import plane_rig


def test_four_sensors_name_one_and_close_cameras_do_not_check_the_lidar():
    rig = plane_rig((0.6, 0.1, 0.0))
    assert short_pairs(rig) == [(2, 3)]
    first, checked, *_, short, light = capabilities(rig)
    assert "up to 1 attacked sensor at once" in first
    assert checked == "the LiDAR is checked by S_1 and S_3, S_1 and S_2"
    assert short.endswith("S_2 and S_3")
    assert any(line.startswith("vanished objects") for line in capabilities(rig)), "two pairs tell what is gone"
    assert light.startswith("not told apart: weak light that is held on one camera for seconds, and drops or glare")


def test_one_wide_pair_leaves_the_lidar_unchecked_while_its_cameras_are_attacked():
    _, checked, *_, short, _ = capabilities(plane_rig((0.4, 0.2, 0.0)))
    assert checked.startswith("only S_1 and S_3 can check the LiDAR")
    assert short.endswith("S_2 and S_3, S_1 and S_2")


def test_three_sensors_identify_none():
    first, *others = capabilities(plane_rig((0.6, 0.0)))
    assert "told where the LiDAR's own scans show it, else by each camera's own past" in first
    assert not any("weak light" in line for line in others), "no camera is named, so none can be suspect for its lens"


def test_wide_pairs_check_the_lidar_and_narrow_ones_alone_cannot():
    lines = capabilities(plane_rig((0.9, 0.6, 0.0)))
    assert lines[1] == "the LiDAR is checked by S_1 and S_3, S_2 and S_3, S_1 and S_2"
    assert capabilities(plane_rig((0.1, 0.05, 0.0)))[1].startswith("no pair of cameras is wide enough")


def test_how_far_walls_are_told_follows_from_the_widest_pair():
    # 300 px and 0.9 m: 9 px at 30 m and 6 px half as far again, 3 px apart.
    lines = capabilities(plane_rig((0.9, 0.6, 0.0)))
    assert lines[2].endswith("1.5 times as far away, up to 30 m at most")
    assert lines[3].startswith("vanished objects and sectors are noticed up to 30 m")
    assert lines[4].startswith("invented cars of some dozens of points are noticed from 6 m on")
    assert lines[5].startswith("not noticed: walls in front of the sky")
    assert len(capabilities(plane_rig((0.1, 0.05, 0.0)))) == 5


def test_in_one_view_walls_are_told_as_far_as_the_camera_with_the_shortest_lens_allows():
    rig = plane_rig((0.9, 0.6, 0.0))
    wide = replace(rig.cameras[1], projection=rig.cameras[1].projection * np.array([[0.5], [0.5], [1]]))
    of_one = replace(rig, cameras=(rig.cameras[0], wide, rig.cameras[2]))
    assert of_one.shares_view
    assert "up to 15 m at most" in capabilities(of_one)[2]


def test_one_pair_of_cameras_says_that_it_does_not_tell_what_is_gone():
    lines = capabilities(plane_rig((0.9, 0.0)))
    assert not [line for line in lines if line.startswith("vanished objects")]
    assert [line for line in lines if line.startswith("not noticed: objects that are removed")]


def test_without_a_lidar_the_cameras_checks_are_described():
    lines = capabilities(plane_rig((0.9, 0.6, 0.3, 0.0), lidar=False))
    assert short_pairs(plane_rig((0.1, 0.05, 0.02, 0.0), lidar=False)) == []
    assert len(lines) == 3
    assert lines[1].startswith("without a LiDAR")
