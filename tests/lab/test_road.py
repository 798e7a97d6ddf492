"""Synthetic road drives: the same for the same seed, and true to their own geometry."""

import numpy as np
import pytest

from auditor.errors import SettingError
from auditor.frames import SensorState
from auditor.lab.road import SyntheticDrive, make_drive
from auditor.lab.road.casting import NOTHING, cast, view
from auditor.lab.road.scanner import hdl64

SIZE = {"width_px": 310, "height_px": 94}


@pytest.fixture(scope="module")
def drive() -> SyntheticDrive:
    return make_drive(3, 12, **SIZE)


@pytest.fixture(scope="module")
def flawless() -> SyntheticDrive:
    return make_drive(3, 12, flawless=True, **SIZE)


def test_a_frame_is_the_same_whenever_and_wherever_it_is_made(drive):
    again = make_drive(3, 12, **SIZE)
    later = again.frame(7)
    first = drive.frame(7)
    assert np.array_equal(first.cloud.xyz_m, later.cloud.xyz_m)
    for number in (1, 2, 3):
        assert np.array_equal(first.images[number].pixels, later.images[number].pixels)


def test_seeds_frames_and_styles_differ(drive):
    pixels = drive.frame(0).images[1].pixels
    others = [
        drive.frame(5),
        make_drive(4, 12, **SIZE).frame(0),
        make_drive(3, 12, style="residential", **SIZE).frame(0),
    ]
    for other in others:
        assert np.mean(pixels != other.images[1].pixels) > 0.3


@pytest.mark.parametrize(("n_cameras", "lidar"), [(2, True), (3, False), (4, True)])
def test_every_frame_has_all_sensors_in_the_rigs_sizes(n_cameras, lidar):
    drive = make_drive(1, 2, n_cameras=n_cameras, lidar=lidar, **SIZE)
    frames = list(drive.frames())
    assert [frame.number for frame in frames] == [0, 1]
    assert frames[1].stamp_ns - frames[0].stamp_ns == 100_000_000
    for frame in frames:
        assert set(frame.presence) == set(drive.rig.sensors)
        assert all(presence.state is SensorState.PRESENT for presence in frame.presence.values())
        assert (frame.cloud is not None) == lidar
        for camera in drive.rig.cameras:
            assert frame.images[camera.number].pixels.shape == (camera.height_px, camera.width_px)
            assert frame.images[camera.number].pixels.dtype == np.uint8


def test_cameras_stand_where_they_are_asked_to():
    assert [round(float(c.centre_m[0]), 3) for c in make_drive(0, 1).rig.cameras] == [0.54, 0.47, -0.06]
    even = make_drive(0, 1, n_cameras=4, evenly_spaced=True).rig
    assert np.allclose([even.baseline_m(i, i + 1) for i in (1, 2, 3)], 0.2)


def _depth_at(depth, u, v):
    """Between pixels; linear in the inverse depth, which is exact on a plane."""
    column, row = u.astype(int), v.astype(int)
    right, down = u - column, v - row
    near = 1 / depth
    upper = near[row, column] * (1 - right) + near[row, column + 1] * right
    lower = near[row + 1, column] * (1 - right) + near[row + 1, column + 1] * right
    return 1 / (upper * (1 - down) + lower * down)


def test_without_its_flaws_the_lidar_measures_what_the_camera_sees(flawless):
    rig = flawless.rig
    for number in (0, 6):
        depth = flawless.depth_m(number, 3)
        P = rig.camera(3).projection @ rig.lidar.rig_SE3_lidar
        u, v, z = P[:, :3] @ flawless.frame(number).cloud.xyz_m.T + P[:, 3:]
        u, v = u / z, v / z
        inside = (u >= 0) & (u < depth.shape[1] - 1) & (v >= 0) & (v < depth.shape[0] - 1)
        assert inside.sum() > 4000
        assert np.median(np.abs(_depth_at(depth, u[inside], v[inside]) - z[inside])) < 0.01


def test_every_ray_that_looks_down_meets_something(flawless):
    # The ground begins behind the sensors: the part of the grid in which it is looked for must not cut it off.
    surfaces, atlas, rays = flawless.scenery.surfaces, flawless.scenery.atlas, hdl64()
    hits = cast(surfaces, view(surfaces, flawless._pose(0.0), 0.0), rays, atlas)
    down = hits.surface[-8:]
    assert np.mean(down == NOTHING) < 0.01


def test_true_depths_agree_from_left_to_right(flawless):
    rig = flawless.rig
    right, left = flawless.depth_m(2, 1), flawless.depth_m(2, 3)
    row, column = np.nonzero(np.isfinite(left))
    disparity = rig.camera(3).focal_px * rig.baseline_m(1, 3) / left[row, column]
    match = np.rint(column - disparity).astype(int)
    inside = match >= 0
    there = right[row[inside], match[inside]]
    here = left[row[inside], column[inside]]
    agree = np.abs(there - here) < 0.05 * here
    assert agree.mean() > 0.8
    # Where they do not, something nearer hides the place from the other camera, or an edge fell to the other side.
    assert np.mean(there[~agree] < here[~agree]) > 0.5


def test_images_agree_at_the_true_disparity_and_not_beside_it(flawless):
    frame, rig = flawless.frame(2), flawless.rig
    left, right = (frame.images[number].pixels.astype(float) for number in (3, 1))
    depth = flawless.depth_m(2, 3)
    row, column = np.nonzero(np.isfinite(depth) & (depth < 25))
    disparity = rig.camera(3).focal_px * rig.baseline_m(1, 3) / depth[row, column]

    def difference(shift: int) -> float:
        match = np.rint(column - disparity).astype(int) + shift
        inside = (match >= 0) & (match < left.shape[1])
        return float(np.mean(np.abs(left[row, column] - right[row, np.clip(match, 0, None) % left.shape[1]])[inside]))

    assert difference(0) < 0.7 * min(difference(-3), difference(3))


def test_flaws_are_those_of_real_sensors(drive):
    rows = [character.row_error_px for character in drive.cameras]
    assert 0 < max(rows) - min(rows) <= 0.6
    assert drive.lidar.range_m == pytest.approx(0.02)


def test_a_drive_that_makes_no_sense_is_refused():
    with pytest.raises(SettingError, match="0 frames"):
        make_drive(0, 0)
