"""What a camera's own past says of the LiDAR's points."""

from dataclasses import replace
from functools import cache

import cv2
import numpy as np

from auditor.lab.attacks.paper import BogusWall
from auditor.lab.simulation.drives import SyntheticDrive, make_drive
from auditor.measurement import measure_stream
from auditor.measurement.checks.in_time.parallax_conflict import (
    _alike,
    _in_halves,
    _patches,
    _Sought,
    parallax_conflicts,
)
from auditor.measurement.disparity.lidar import lidar_view
from auditor.measurement.disparity.matchers import find_matcher
from auditor.measurement.moment import Moment
from auditor.model.checks import Check, CountedPair
from auditor.model.frames import Frame, SkippedFrame

WALL = BogusWall(range_m=9.0, lateral_m=-1.5, seed=1)
SGBM = find_matcher("sgbm")


@cache
def drive() -> SyntheticDrive:
    return make_drive(2, 8, n_cameras=1)


@cache
def frame_of(number: int) -> Frame:
    return drive().frame(number)


def moment(number: int, *, wall: bool = False, at_s: float = 0.0) -> Moment:
    frame = frame_of(number)
    cloud = WALL.apply(frame.cloud, drive().rig) if wall else frame.cloud
    return Moment(frame.stamp_ns + int(at_s * 1e9), frame.images[1].pixels, lidar_view(cloud, drive().rig, 1))


def on_wall(moment: Moment) -> np.ndarray:
    right, _, ahead = drive().rig.lidar.rig_SE3_lidar[:3, :3] @ moment.view.point_m.T
    return (np.abs(ahead - WALL.range_m) < 0.1) & (np.abs(right - WALL.lateral_m) < WALL.width_m / 2)


def test_points_of_a_bogus_wall_are_conflicts_and_others_are_not():
    now = moment(4, wall=True)
    found = parallax_conflicts(now, moment(3, wall=True)).points
    wall = on_wall(now)
    assert np.count_nonzero(found.lidar_conflicts & wall) > 30
    assert np.count_nonzero(found.lidar_conflicts & ~wall) < 0.005 * np.count_nonzero(found.valid & ~wall)


def test_a_clean_frame_has_next_to_no_conflicts():
    for number in (2, 5):
        found = parallax_conflicts(moment(number), moment(number - 1)).points
        assert np.count_nonzero(found.valid) > 300
        assert np.count_nonzero(found.lidar_conflicts) < 0.005 * np.count_nonzero(found.valid)


def test_what_a_picture_shows_apart_from_a_wall_is_what_the_picture_before_shows():
    clean, walled = (parallax_conflicts(moment(4, wall=one), moment(3, wall=one)) for one in (False, True))
    assert abs(walled.unmatched_share - clean.unmatched_share) < 0.05
    now = replace(moment(4), grey=moment(1).grey)
    assert parallax_conflicts(now, moment(3)).unmatched_share > clean.unmatched_share + 0.1


def test_any_number_of_patches_is_sampled():
    centres = np.tile([[40.0, 30.0], [50.0, 20.0]], (20_000, 1))
    patches = _patches(moment(0).half, centres, np.ones(1))
    assert (patches[::2] == patches[0]).all()
    assert (patches[1::2] == patches[1]).all()


def test_conflicts_are_valid():
    found = parallax_conflicts(moment(4, wall=True), moment(3)).points
    assert not (found.lidar_conflicts & ~found.valid).any()


def test_a_vehicle_that_stands_compares_nothing():
    now, noise = moment(3, wall=True), np.random.default_rng(0)
    again = np.clip(now.grey + noise.normal(0, 1.5, now.grey.shape), 0, 255).astype(np.uint8)
    before = replace(now, stamp_ns=now.stamp_ns - 10**8, grey=again)
    assert not parallax_conflicts(now, before).points.valid.any()


def test_the_first_frame_and_one_behind_a_gap_compare_nothing():
    now = moment(4)
    assert not parallax_conflicts(now, None).points.valid.any()
    assert not parallax_conflicts(now, moment(3, at_s=-0.4)).points.valid.any()
    assert not parallax_conflicts(now, moment(3, at_s=0.2)).points.valid.any(), "a clock that was set back"
    assert parallax_conflicts(now, moment(2)).points.valid.any(), "one frame was dropped"


def test_a_picture_without_texture_compares_nothing():
    now, before = (replace(moment(n), grey=np.full((375, 1242), 128, dtype=np.uint8)) for n in (4, 3))
    assert not parallax_conflicts(now, before).points.valid.any()


def test_a_cloud_of_few_points_compares_nothing():
    now, before = moment(4), moment(3)
    frame = frame_of(4)
    few = replace(frame.cloud, xyz_m=frame.cloud.xyz_m[::2000])
    assert not parallax_conflicts(replace(now, view=lidar_view(few, drive().rig, 1)), before).points.valid.any()
    none = replace(frame.cloud, xyz_m=frame.cloud.xyz_m[:0])
    assert parallax_conflicts(replace(now, view=lidar_view(none, drive().rig, 1)), before).points.valid.size == 0


def test_a_camera_that_only_turned_compares_nothing():
    now = moment(4)
    matrix = now.camera.intrinsics
    turn = cv2.Rodrigues(np.array([0.0, 0.02, 0.0]))[0]
    turned = cv2.warpPerspective(now.grey, matrix @ turn @ np.linalg.inv(matrix), (1242, 375))
    before = replace(now, stamp_ns=now.stamp_ns - 10**8, grey=turned)
    assert np.count_nonzero(parallax_conflicts(now, before).points.valid) < 5


def sought(pixel, predicted):
    many = len(pixel)
    return _Sought(
        np.arange(many),
        np.tile([0.0, 0.0, 10.0], (many, 1)),
        np.array(pixel, dtype=np.float64),
        np.array(predicted, dtype=np.float64),
        np.tile([1.0, 0.0], (many, 1)),
        np.full(many, 20.0),
        np.zeros(many),
    )


def test_an_edge_before_a_scene_that_is_found_elsewhere_is_no_conflict():
    """The right half of the picture moved by 12 px against the left one, as what lies behind an edge does."""
    scene = np.random.default_rng(3).integers(0, 256, (40, 120), dtype=np.uint8)
    now, before = scene.copy(), scene.copy()
    before[:, 40:100] = np.roll(scene, -12, axis=1)[:, 40:100]
    behind, edge = sought([(70, 20)], [(70, 20)]), sought([(53, 20)], [(53, 20)])
    before[:, 40:53] = scene[:, 40:53]
    patches = {name: _patches(now, one.pixel, np.ones(1)) for name, one in (("behind", behind), ("edge", edge))}
    assert _in_halves(patches["behind"], before, behind, np.array([-12.0])).tolist() == [True]
    assert _in_halves(patches["edge"], before, edge, np.array([-12.0])).tolist() == [False]


def test_conflicts_are_those_whose_neighbours_are_found_as_far_away():
    row = [(10.0 + 3 * n, 20.0) for n in range(6)]
    things = sought([*row, (200.0, 20.0)], [*row, (200.0, 20.0)])
    together, scattered = np.full(7, -8.0), np.array([-3.0, -14.0, 5.0, -8.0, -18.0, 0.0, -8.0])
    found = [_alike(things, things.predicted + offset[:, None] * things.along) for offset in (together, scattered)]
    assert found[0].tolist() == [True] * 6 + [False], "one that stands alone is no conflict"
    assert not found[1].any()
    nothing = things.chosen(slice(0))
    assert _alike(nothing, nothing.predicted).shape == (0,)


def test_a_stream_compares_each_frame_with_the_one_before_across_skipped_ones():
    frames = [frame_of(1), frame_of(2), SkippedFrame(3, 0, "too few"), frame_of(4)]
    measured = [one for one in measure_stream(frames, drive().rig, SGBM) if not isinstance(one, SkippedFrame)]
    counted = CountedPair(Check.PARALLAX_CONFLICT, 1, 1, 0)
    valid = [int(one.cells[counted].valid.sum()) for one, _ in measured]
    assert valid[0] == 0
    assert min(valid[1:]) > 200
    first, second, _ = (one.counts for one, _ in measured)
    assert first[0].gated_valid_px == 0
    assert second[0].disparity_error("gated") < 0.02
