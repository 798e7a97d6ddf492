from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from auditor.errors import SettingError
from auditor.lab.simulation.drives import SyntheticDrive, make_drive
from auditor.lab.simulation.streets import STYLES
from auditor.lab.simulation.vehicles import CameraFlaws, LidarFlaws, make_rig, make_vehicle
from auditor.model.frames import SensorState
from auditor.model.rig import LIDAR

SMALL = {"width_px": 414, "height_px": 125}


def small(seed: int = 5, frames: int = 6, **more) -> SyntheticDrive:
    return make_drive(seed, frames, **(SMALL | more))


def flawless(drive: SyntheticDrive) -> SyntheticDrive:
    """The same street, seen by sensors that err in nothing."""
    cameras = tuple(CameraFlaws(1, 0, 0, 0, 0, 0, 0, 0) for _ in drive.vehicle.cameras)
    lidar = LidarFlaws(np.eye(3), np.zeros(3), 0, 0, 0)
    return replace(drive, vehicle=replace(drive.vehicle, cameras=cameras, lidar=lidar))


@pytest.fixture(scope="module")
def city() -> SyntheticDrive:
    return small()


def test_the_same_seed_makes_the_same_drive_whatever_frame_is_made_first(city: SyntheticDrive) -> None:
    again = small()
    again.frame(1)
    first, second = city.frame(3), again.frame(3)
    for camera in (1, 2, 3):
        np.testing.assert_array_equal(first.images[camera].pixels, second.images[camera].pixels)
    assert first.cloud is not None
    assert second.cloud is not None
    np.testing.assert_array_equal(first.cloud.xyz_m, second.cloud.xyz_m)


def test_another_seed_is_another_street_and_another_vehicle_the_same_one(city: SyntheticDrive) -> None:
    depth = city.depth_m(0, 3)
    other_street, other_vehicle = small(seed=6), small(vehicle=1)
    assert np.mean(np.isclose(depth, other_street.depth_m(0, 3), rtol=0.02)) < 0.7
    # Another row offset and another lateness of the shutter move edges a little.
    assert np.mean(np.isclose(depth, other_vehicle.depth_m(0, 3), rtol=0.03)) > 0.9
    assert other_vehicle.vehicle.cameras != city.vehicle.cameras


def test_drives_of_one_vehicle_share_its_calibration_and_its_flaws() -> None:
    a, b = (make_drive(seed, 1, vehicle=4, **SMALL).vehicle for seed in (1, 2))
    assert a.rig.rig_id == b.rig.rig_id
    assert a.cameras == b.cameras
    np.testing.assert_array_equal(a.lidar.tilt, b.lidar.tilt)


def test_every_vehicle_has_a_calibration_of_its_own_and_all_are_of_one_kind() -> None:
    designed = make_rig(3, lidar=True, width_px=1242, height_px=375)
    rigs = [make_vehicle(designed, vehicle).rig for vehicle in range(30)]
    assert len({rig.rig_id for rig in rigs}) == 30
    assert all(a.kind.matches(b.kind) for a in rigs for b in rigs)
    assert np.ptp([rig.camera(1).focal_px for rig in rigs]) > 5


def test_a_frame_holds_every_sensor_at_ten_hertz(city: SyntheticDrive) -> None:
    frames = list(city.frames())
    assert [frame.number for frame in frames] == list(range(6))
    assert {b.stamp_ns - a.stamp_ns for a, b in pairwise(frames)} == {100_000_000}
    for frame in frames:
        assert {state.state for state in frame.presence.values()} == {SensorState.PRESENT}
        assert sorted(frame.presence) == [LIDAR, 1, 2, 3]
        assert all(
            image.pixels.shape == (125, 414) and image.pixels.dtype == np.uint8 for image in frame.images.values()
        )
        assert frame.cloud is not None
        assert frame.cloud.xyz_m.dtype == np.float32


def test_the_vehicle_moves_along_the_street(city: SyntheticDrive) -> None:
    near = [np.median(city.depth_m(number, 3)[60:66, 300:]) for number in (0, 5)]
    assert near[0] != near[1]
    assert not np.array_equal(city.frame(0).images[1].pixels, city.frame(5).images[1].pixels)


@pytest.mark.parametrize("style", list(STYLES))
def test_without_flaws_the_lidar_measures_what_the_cameras_see(style: str) -> None:
    # At rest: a vehicle's motion during a sweep is no flaw of its LiDAR.
    drive = replace(flawless(make_drive(8, 1, style=style)), speed_m_s=0.0)
    rig = drive.rig
    xyz_m = drive.cloud(0).xyz_m
    assert rig.lidar is not None
    for camera in rig.cameras:
        depth = drive.depth_m(0, camera.number)
        P = camera.projection @ rig.lidar.rig_SE3_lidar
        u, v, z = P[:, :3] @ xyz_m.T + P[:, 3:]
        ahead = z > 1
        column, row = np.rint(u[ahead] / z[ahead]).astype(int), np.rint(v[ahead] / z[ahead]).astype(int)
        inside = (column >= 0) & (column < 1242) & (row >= 0) & (row < 375)
        apart = np.abs(depth[row[inside], column[inside]] - z[ahead][inside])
        assert inside.sum() > 10_000
        assert np.median(apart) < 0.02
        assert np.mean(apart > 1) < 0.2  # what one sees beside the other's edges


def test_flaws_move_the_scan_against_the_pictures(city: SyntheticDrive) -> None:
    exact, flawed = flawless(city).cloud(0).xyz_m, city.cloud(0).xyz_m
    assert len(flawed) < len(exact)
    assert 55_000 < len(flawed) < 68_000
    beside = (np.abs(flawed[:, 1]) < 3) & (flawed[:, 0] < 15) & (flawed[:, 2] < -1.5)
    assert np.std(flawed[beside, 2]) > np.std(
        exact[(np.abs(exact[:, 1]) < 3) & (exact[:, 0] < 15) & (exact[:, 2] < -1.5), 2]
    )


def test_true_disparities_of_two_cameras_agree(city: SyntheticDrive) -> None:
    drive = flawless(city)
    left, right = drive.depth_m(0, 3), drive.depth_m(0, 1)
    focal, baseline = drive.rig.camera(3).focal_px, drive.rig.baseline_m(1, 3)
    row, column = np.nonzero(np.isfinite(left))
    z = left[row, column]
    there = np.rint(column - focal * baseline / z).astype(int)
    inside = there >= 0
    share = np.abs(right[row, there] / z - 1)[inside] < 0.05
    assert share.mean() > 0.85  # the rest is hidden from the right camera


def test_cameras_stand_like_kittis_or_evenly_or_where_they_are_placed() -> None:
    rig = make_drive(1, 1, **SMALL).rig
    assert [rig.baseline_m(i, 3) for i in (1, 2)] == pytest.approx([0.60, 0.53])
    full = make_drive(1, 1).rig
    assert full.camera(1).focal_px == pytest.approx(721.54, abs=0.01)
    four = make_drive(1, 1, n_cameras=4, **SMALL).rig
    assert four.baseline_m(3, 4) == pytest.approx(0.06)
    six = make_drive(1, 1, n_cameras=6, **SMALL).rig
    assert [six.baseline_m(i, i + 1) for i in range(1, 6)] == pytest.approx([0.3] * 5)
    given = make_drive(1, 1, positions_m=(1.0, 0.4, 0.1), **SMALL).rig
    assert given.baseline_m(1, 3) == pytest.approx(0.9)


def test_a_drive_without_a_lidar_has_no_cloud() -> None:
    drive = small(frames=1, lidar=False)
    frame = drive.frame(0)
    assert frame.cloud is None
    assert LIDAR not in frame.presence
    with pytest.raises(SettingError, match="no LiDAR"):
        drive.cloud(0)


def test_impossible_settings_are_refused() -> None:
    with pytest.raises(SettingError, match="city"):
        make_drive(1, 1, style="moon")
    with pytest.raises(SettingError, match="2 positions for 3 cameras"):
        make_drive(1, 1, positions_m=(0.5, 0.0))
    with pytest.raises(SettingError, match="frame"):
        make_drive(1, 0)


def test_pictures_have_sky_shade_and_noise_and_cameras_of_their_own_brightness(city: SyntheticDrive) -> None:
    pixels = {camera: city.image(0, camera).pixels.astype(float) for camera in (1, 2, 3)}
    for picture in pixels.values():
        assert 0.02 < np.mean(picture >= 254) < 0.3
        assert 40 < picture.mean() < 150
        assert np.mean(picture < 30) > 0.02
    clean = flawless(city).image(0, 3).pixels.astype(float)
    levels = {camera: np.median(picture) for camera, picture in pixels.items()}
    assert len({*levels.values(), np.median(clean)}) > 2


def test_a_lidar_gets_less_back_from_glass_and_dark_paint(city: SyntheticDrive) -> None:
    lossless = replace(city, surfaces=replace(city.surfaces, lost=np.zeros_like(city.surfaces.lost)))
    assert len(city.cloud(0).xyz_m) < 0.99 * len(lossless.cloud(0).xyz_m)


def test_trips_of_one_seed_go_along_the_same_street_in_another_light() -> None:
    first, second = small(), small(trip=1)
    still = first.surfaces.speed == 0
    assert still.sum() > 500
    np.testing.assert_array_equal(first.surfaces.corner[still], second.surfaces.corner[second.surfaces.speed == 0])
    assert first.light != second.light
    assert not np.array_equal(first.image(0, 3).pixels, second.image(0, 3).pixels)
