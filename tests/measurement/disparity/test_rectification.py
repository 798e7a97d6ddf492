from dataclasses import replace

import cv2
import numpy as np
import pytest

from auditor.errors import RigError
from auditor.lab.simulation.drives import SyntheticDrive, make_drive
from auditor.lab.simulation.vehicles import make_rig, rotation
from auditor.measurement import measure
from auditor.measurement.disparity.lidar import lidar_view
from auditor.measurement.disparity.matchers.sgbm import SgbmMatcher
from auditor.measurement.disparity.rectification import rectification, shown_rectification
from auditor.model.frames import CameraImage, Frame, PointCloud, SkippedFrame
from auditor.model.measurement import Statistic
from auditor.model.optics.geometry import invert, motion
from auditor.model.optics.sensors import NO_LENS, Lens
from auditor.model.rig import Camera, Rig
from tests.making.perturbed_rigs import perturbed
from tests.making.scenes import plane_frame, plane_rig

LENSES = (
    Lens("plumb_bob", (-0.3, 0.1, 0.0005, -0.0003, -0.01)),
    Lens("rational_polynomial", (2.5, 0.9, -0.0001, 0.0002, 0.03, 2.85, 1.6, 0.18)),
    Lens("equidistant", (-0.013, 0.02, -0.012, 0.002)),
)


def crooked_rig(seed: int = 1, **settings: object) -> Rig:
    return perturbed(make_rig(3, lidar=True, width_px=1242, height_px=375), LENSES, seed, **settings)


def rotated(rig: Rig, rig_SO3_new: np.ndarray) -> Rig:
    """The same rig described in another frame, as it might be in a rig file."""
    turn = motion(rig_SO3_new, np.zeros(3))
    lidar = replace(rig.lidar, rig_SE3_lidar=invert(turn) @ rig.lidar.rig_SE3_lidar)
    return Rig(lidar, tuple(replace(c, projection=c.projection @ turn) for c in rig.cameras))


def test_rigs_that_are_rectified_keep_their_frames_to_the_last_bit() -> None:
    rig = plane_rig()
    seen, frame = rectification(rig), plane_frame(rig)
    assert seen.rig is rig
    assert seen.frame(frame) is frame


@pytest.mark.parametrize(
    ("width_px", "focal_px", "scale"),
    [
        (1242, 721.5, 1),  # as wide an angle a pixel as is usual
        (621, 360.0, 2),
        (640, 500.0, 1.5),
        (640, 250.0, 2),  # no more than twice
        (1000, 250.0, 1.5),  # nor wider than is usual
        (1280, 500.0, 1),
        (2048, 1685.0, 1),
        (414, 240.0, 1),  # no vehicle's cameras are as narrow
    ],
)
def test_pictures_of_few_pixels_are_enlarged(width_px: int, focal_px: float, scale: float) -> None:
    rig = plane_rig()
    K = np.array([[focal_px, 0, 100.0], [0, focal_px, 60.0], [0, 0, 1]])
    cameras = tuple(
        replace(c, width_px=width_px, projection=K @ np.linalg.inv(c.intrinsics) @ c.projection) for c in rig.cameras
    )
    recorded = Rig(rig.lidar, cameras)
    first, seen = cameras[0], rectification(recorded)
    ideal, shown = seen.rig.camera(1), shown_rectification(recorded)
    assert (ideal.width_px, ideal.height_px) == (round(width_px * scale), round(first.height_px * scale))
    assert ideal.focal_px == pytest.approx(focal_px * scale, rel=0.01)
    assert seen.rig.baseline_m(1, 3) == pytest.approx(rig.baseline_m(1, 3))
    # The outer edges of both pictures coincide.
    assert (ideal.intrinsics[0, 2] + 0.5) / ideal.width_px == pytest.approx(100.5 / width_px)
    assert shown.rig is recorded
    assert not shown.remaps


def test_an_enlarged_picture_shows_the_same_at_the_same_place() -> None:
    rig = make_rig(3, lidar=True, width_px=621, height_px=188)
    rng = np.random.default_rng(0)
    pixels = np.asarray(cv2.GaussianBlur(rng.integers(0, 256, (188, 621), dtype=np.uint8), (0, 0), 2))
    enlarged = rectification(rig).image(CameraImage(1, 0, pixels)).pixels
    assert enlarged.shape == (376, 1242)
    back = cv2.resize(enlarged, (621, 188), interpolation=cv2.INTER_AREA)
    assert np.abs(back.astype(int) - pixels).max() <= 6


def test_the_ideal_cameras_are_the_same_on_one_line_and_at_their_old_places() -> None:
    rig = crooked_rig()
    ideal = rectification(rig).rig
    K = ideal.camera(1).intrinsics
    assert all(camera.rectified and np.array_equal(camera.intrinsics, K) for camera in ideal.cameras)
    assert len({(camera.width_px, camera.height_px) for camera in ideal.cameras}) == 1
    assert np.ptp([camera.centre_m[1:] for camera in ideal.cameras], axis=0) == pytest.approx([0, 0], abs=1e-12)
    assert ideal.baseline_m(1, 3) == pytest.approx(rig.baseline_m(1, 3))
    assert ideal.topic(2) == rig.topic(2)


@pytest.mark.parametrize("camera", [1, 2, 3])
def test_a_point_appears_in_the_rectified_picture_where_the_ideal_camera_says(camera: int) -> None:
    rig = crooked_rig()
    seen, real = rectification(rig), rig.camera(camera)
    # Dots painted where the real camera sees points; found again in the rectified picture.
    at_m = np.array([[x, y, 9.0] for x in (-3.0, 0.2, 3.2) for y in (-0.6, 0.7)])
    rays = (at_m - real.centre_m) @ real.rotation.T
    bent = np.stack((*real.lens.distort(rays[:, 0] / rays[:, 2], rays[:, 1] / rays[:, 2]), np.ones(6)))
    u, v = (real.intrinsics @ bent)[:2]
    rows, columns = np.mgrid[: real.height_px, : real.width_px]
    dots = sum(np.exp(-((columns - a) ** 2 + (rows - b) ** 2) / 8) for a, b in zip(u, v, strict=True))
    picture = seen.image(CameraImage(camera, 0, np.rint(dots * 250).astype(np.uint8))).pixels.astype(float)
    # The ideal rig has a frame of its own: the LiDAR shows how it is rotated.
    ideal_SE3_rig = seen.rig.lidar.rig_SE3_lidar @ invert(rig.lidar.rig_SE3_lidar)
    expected = seen.rig.camera(camera).projection @ ideal_SE3_rig @ np.column_stack([at_m, np.ones(6)]).T
    for a, b in (expected[:2] / expected[2]).T:
        near = picture[round(b) - 7 : round(b) + 8, round(a) - 7 : round(a) + 8]
        down, across = np.mgrid[-7:8, -7:8]
        assert (near * across).sum() / near.sum() + round(a) == pytest.approx(a, abs=0.1)
        assert (near * down).sum() / near.sum() + round(b) == pytest.approx(b, abs=0.1)


def test_no_pixel_of_a_rectified_picture_lies_outside_the_recorded_one() -> None:
    rig = crooked_rig(turn_deg=4.0)
    seen = rectification(rig)
    for camera in rig.cameras:
        inside = np.full((camera.height_px, camera.width_px), 200, dtype=np.uint8)
        inside[[0, -1]], inside[:, [0, -1]] = 0, 0
        # Between the places that were tried the border may curve in by a pixel.
        assert np.mean(seen.image(CameraImage(camera.number, 0, inside)).pixels < 200) < 0.002


def in_the_drives_frame(drive: SyntheticDrive, ideal: Rig) -> Rig:
    ideal_SE3_rig = ideal.lidar.rig_SE3_lidar @ invert(drive.rig.lidar.rig_SE3_lidar)
    cameras = (replace(c, projection=c.projection @ ideal_SE3_rig, rectified=False) for c in ideal.cameras)
    return Rig(drive.rig.lidar, tuple(cameras))


def test_a_drive_through_bent_and_rotated_cameras_measures_like_one_through_ideal_ones() -> None:
    drive = make_drive(2, 1, width_px=1242, height_px=375)
    crooked = replace(drive, vehicle=replace(drive.vehicle, rig=perturbed(drive.rig, LENSES, 2)))
    ideal = rectification(crooked.rig).rig
    straight = replace(drive, vehicle=replace(drive.vehicle, rig=in_the_drives_frame(drive, ideal)))
    E = {}
    for name, frames, rig in (("straight", straight.frames(), ideal), ("crooked", crooked.frames(), crooked.rig)):
        counts = [measure(frame, rig, SgbmMatcher())[0].counts for frame in frames]
        E[name] = np.array([[[c.disparity_error(s) for s in Statistic] for c in row] for row in counts]).mean(axis=0)
    print(E)
    assert np.abs(E["crooked"] - E["straight"]).max() < 0.02


def test_the_frame_that_a_rig_is_described_in_does_not_matter() -> None:
    rig = crooked_rig()
    again = rotated(rig, rotation(0.02, 0.03, -0.01))
    cloud = PointCloud(0, np.random.default_rng(0).uniform((4, -4, -1), (20, 4, 2), (500, 3)).astype(np.float32))
    a, b = (lidar_view(cloud, rectification(r).rig, 3) for r in (rig, again))
    assert np.allclose(a.u_px, b.u_px, atol=1e-3)
    assert np.allclose(a.disparity_px(1), b.disparity_px(1), atol=1e-3)


def test_cameras_of_other_sizes_and_focal_lengths_see_the_same_after_rectifying() -> None:
    rig = plane_rig()
    fine = rig.camera(2)
    twice = np.array([[2, 0, 0.5], [0, 2, 0.5], [0, 0, 1]])  # pixels' centres lie at whole numbers
    mixed = Camera(2, "fine", "/fine", 2 * fine.width_px, 2 * fine.height_px, twice @ fine.projection)
    mixed_rig = Rig(rig.lidar, (rig.camera(1), mixed, rig.camera(3)))
    frame = plane_frame(rig)
    large = cv2.resize(frame.images[2].pixels, None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST)
    colour = np.repeat(large[:, :, None], 3, axis=2)
    changed = replace(frame, images={**frame.images, 2: CameraImage(2, 0, colour)})
    assert rectification(mixed_rig).rig.camera(2).focal_px == pytest.approx(fine.focal_px)
    E = [c.disparity_error(Statistic.GATED) for c in measure(changed, mixed_rig, SgbmMatcher())[0].counts]
    assert max(E) < 0.03


def test_cameras_one_above_the_other_are_rectified_on_their_side() -> None:
    rig = plane_rig((0.6, 0.0))
    on_its_side = rotation(0, 0, np.pi / 2)
    K = np.array([[300.0, 0, 59.5], [0, 300, 159.5], [0, 0, 1]])
    cameras = tuple(
        replace(
            c,
            width_px=120,
            height_px=320,
            rectified=False,
            projection=K @ on_its_side @ np.column_stack([np.eye(3), -c.centre_m]),
        )
        for c in rig.cameras
    )
    frame = plane_frame(rig)
    upright = {n: replace(i, pixels=np.ascontiguousarray(np.rot90(i.pixels, -1))) for n, i in frame.images.items()}
    counts = measure(replace(frame, images=upright), Rig(rig.lidar, cameras), SgbmMatcher())[0].counts
    assert counts[0].valid_px > 1000
    assert counts[0].disparity_error(Statistic.GATED) < 0.03


def test_cameras_without_a_view_in_common_are_named() -> None:
    rig = plane_rig((0.6, 0.0))
    away = replace(
        rig.camera(2), rectified=False, projection=rig.camera(2).projection @ motion(rotation(0, 1.2, 0), np.zeros(3))
    )
    with pytest.raises(RigError, match="camera 1, camera 2 have no view in common"):
        rectification(Rig(rig.lidar, (rig.camera(1), away)))


def test_skipped_frames_stay_among_the_rectified_ones() -> None:
    drive = make_drive(1, 1, width_px=240, height_px=96)
    seen = rectification(perturbed(drive.rig, (NO_LENS,) * 3, 1))
    skipped = SkippedFrame(0, 0, "nothing there")
    images = {
        number: CameraImage(number, 0, np.zeros((115, 288), dtype=np.uint8)) for number in seen.rig.sensors if number
    }
    first, second = seen.frames([skipped, replace(plane_frame(plane_rig()), images=images)])
    assert first is skipped
    assert isinstance(second, Frame)
    camera = seen.rig.camera(1)
    assert second.images[1].pixels.shape == (camera.height_px, camera.width_px)
