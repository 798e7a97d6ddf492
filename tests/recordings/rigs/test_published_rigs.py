"""Every camera of the published fleets has an audit plan, and every LiDAR is used or said to be not."""

from dataclasses import replace
from pathlib import Path

import pytest

from auditor.model.optics.common_view import shown_shares
from auditor.recordings import open_recording, search_rigs, survey
from tests.making.published_recordings import write_standing
from tests.making.published_rigs import PUBLISHED_RIGS, PublishedRig

WIDTH_PX = 160
GROUPS = {"argoverse_2": 3, "kitti_360": 2}
"""How many cameras of a fleet look the same way and can be compared with each other."""


@pytest.mark.parametrize("fleet", PUBLISHED_RIGS)
def test_every_camera_of_a_fleet_is_audited_with_a_lidar(fleet: str, tmp_path: Path) -> None:
    published = PUBLISHED_RIGS[fleet]
    small = published.smaller(WIDTH_PX / max(camera.size_px[0] for camera in published.cameras))
    with open_recording(write_standing(tmp_path / f"{fleet}.mcap", small, 2)) as recording:
        found = search_rigs(survey(recording))
    seen = [camera.name for rig in found.rigs for camera in rig.cameras]
    assert sorted(seen) == sorted(camera.name for camera in published.cameras)
    assert all(rig.lidar for rig in found.rigs)
    assert not found.reasons
    group = GROUPS.get(fleet)
    assert [rig.n for rig in found.rigs if not rig.by_time] == ([group] if group else [])


def lidars_of_cameras(published: PublishedRig, path: Path) -> dict[str, str]:
    with open_recording(write_standing(path, published, 12)) as recording:
        return {rig.camera(1).name: rig.name(0) for rig in search_rigs(survey(recording)).rigs if rig.cameras}


def test_a_camera_takes_the_lidar_that_covers_most_of_its_view(tmp_path: Path) -> None:
    rig = PUBLISHED_RIGS["waymo"].smaller(WIDTH_PX / 1920)
    ahead = [replace(one, wide_deg=120.0) if one.name == "lidar_top" else one for one in rig.lidars]
    chosen = lidars_of_cameras(replace(rig, lidars=tuple(ahead)), tmp_path / "ahead.mcap")
    assert chosen == {
        "front": "lidar_top",
        "front_left": "lidar_top",
        "front_right": "lidar_top",
        "side_left": "lidar_side_left",
        "side_right": "lidar_side_right",
    }


@pytest.mark.parametrize(("fleet", "lidar"), [("zod", "vls128"), ("waymo", "lidar_top"), ("pandaset", "pandar64")])
def test_of_lidars_that_cover_a_view_the_one_with_the_most_points_is_taken(
    fleet: str, lidar: str, tmp_path: Path
) -> None:
    rig = PUBLISHED_RIGS[fleet]
    small = rig.smaller(WIDTH_PX / max(camera.size_px[0] for camera in rig.cameras))
    assert set(lidars_of_cameras(small, tmp_path / "rig.mcap").values()) == {lidar}


@pytest.mark.parametrize("fleet", PUBLISHED_RIGS)
def test_a_lone_camera_is_looked_at_in_most_of_what_it_shows(fleet: str) -> None:
    published = PUBLISHED_RIGS[fleet]
    for camera in published.cameras:
        fisheye = fleet == "kitti_360" and camera.size_px[1] == 1400  # of 185 degrees
        assert shown_shares(published.lone(camera.name))[1] > (0.15 if fisheye else 0.6)
