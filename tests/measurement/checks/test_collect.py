from dataclasses import replace

import cv2
import numpy as np
import pytest

from auditor.lab.attacks.faults import DimmedCamera
from auditor.measurement import measure
from auditor.measurement.checks.collect import collect_checks
from auditor.measurement.disparity.half_resolution import halve
from auditor.measurement.disparity.lidar import lidar_view
from auditor.measurement.disparity.matchers import SgbmMatcher
from auditor.measurement.disparity.stereo import stereo_map, textured
from auditor.model.checks import LIDAR_CHECKS, Check, CountedPair, SensorCheck, resolves_depth
from auditor.model.frames import CameraImage
from tests.making.scenes import RIG, plane_frame, plane_rig, scene

OF_PICTURES = (Check.STRIPED_LIGHT, Check.VEILING_LIGHT, Check.UNMATCHED_LIGHT, Check.ADDED_TEXTURE)
"""The checks of two grey cameras that are measured as they are."""
OF_THREE = {SensorCheck(Check.FOREIGN_TEXTURE, 2, (1, 3)), SensorCheck(Check.FOREIGN_TEXTURE, 1, (2, 3))}
"""The reference and each other camera say how far away is what the third one has to show."""


def checks_of(rig, without=frozenset()):
    frame = plane_frame(rig, without=without)
    half_res = {n: halve(image.pixels) for n, image in frame.images.items()}
    texture = {n: textured(half) for n, half in half_res.items()}
    pairs = [(i, 3) for i in (1, 2) if i in half_res and 3 in half_res]
    maps = {
        (i, k): stereo_map(SgbmMatcher(), frame.images[k].pixels, frame.images[i].pixels, texture[k], texture[i])
        for i, k in pairs
    }
    views = {3: lidar_view(frame.cloud, rig, 3)} if frame.cloud is not None else {}
    return collect_checks(half_res, {}, maps, views, rig)


def test_every_matched_pair_is_counted_in_the_images_of_both_its_cameras():
    frame_checks = checks_of(plane_rig())
    assert set(frame_checks.by_direction[Check.LIDAR_CONFLICT]) == set(frame_checks.counts) == {(1, 3), (2, 3)}
    assert frame_checks.of_views[Check.POINT_DROPOUT] == {(3,): pytest.approx(0, abs=0.01)}
    cells = frame_checks.cells
    assert set(cells) == {
        *(CountedPair(check, i, 3, 0) for check in (Check.LIDAR_CONFLICT, Check.LOST_RETURNS) for i in (1, 2)),
        *(
            CountedPair(check, i, 3, camera)
            for check in (Check.ADDED_LIGHT, Check.PHOTOMETRIC_INCONSISTENCY)
            for i in (1, 2)
            for camera in (i, 3)
        ),
    }
    assert set(frame_checks.shares) == {
        *(SensorCheck(check, 0, (3,)) for check in LIDAR_CHECKS),
        *(SensorCheck(check, 0, (1, 2, 3)) for check in (Check.FALSE_RANGES, Check.SCATTERED_RANGES)),
        *(SensorCheck(check, *pair) for check in OF_PICTURES for i in (1, 2) for pair in ((i, (3,)), (3, (i,)))),
        *OF_THREE,
    }
    for counted, of_grid in cells.items():
        assert of_grid.valid.shape == ((80, 160) if counted.sensor == 0 else (15, 40))
        # Of the LiDAR's holes only what lies below its horizon is looked at.
        assert of_grid.valid.sum() > (2000 if counted.check is Check.LOST_RETURNS else 4000)
        # At the images' left and right edges some pixels have nothing to be matched by.
        assert np.abs(of_grid.total.astype(int)[:, 4:-1]).sum() < 0.03 * of_grid.valid.sum()


def test_without_a_lidar_there_are_no_lidar_conflicts():
    frame_checks = checks_of(plane_rig(), without=frozenset({0}))
    assert not frame_checks.by_direction[Check.LIDAR_CONFLICT]
    assert {one.check for one in frame_checks.shares} == {*OF_PICTURES, Check.FOREIGN_TEXTURE}
    assert set(frame_checks.counts) == {(1, 3), (2, 3)}


def test_a_missing_camera_s_pairs_are_not_checked():
    frame_checks = checks_of(plane_rig(), without=frozenset({1}))
    assert set(frame_checks.counts) == set(frame_checks.by_direction[Check.LIDAR_CONFLICT]) == {(2, 3)}


def test_a_pair_too_close_together_has_no_lidar_conflicts_but_photometric_inconsistencies():
    rig = plane_rig((0.6, 0.06, 0.0))
    assert resolves_depth(rig, 1, 3)
    assert not resolves_depth(rig, 2, 3)
    frame_checks = checks_of(rig)
    assert set(frame_checks.by_direction[Check.LIDAR_CONFLICT]) == {(1, 3)}
    assert set(frame_checks.counts) == {(1, 3), (2, 3)}


def test_what_lies_behind_the_counts_is_there_to_be_drawn():
    frame_checks = checks_of(plane_rig())
    points, map_ = frame_checks.verified_conflicts[1, 3], frame_checks.consistencies[1, 3]
    assert points.valid.sum() == frame_checks.by_direction[Check.LIDAR_CONFLICT][1, 3].valid.sum()
    counts = frame_checks.counts[1, 3]
    for image in ("source", "reference"):
        assert getattr(counts.inconsistencies, image).valid.sum() == np.count_nonzero(map_.comparable)
        assert getattr(counts.light, image).valid.sum() == np.count_nonzero(frame_checks.lights[1, 3].comparable)


def in_window(frame, check, rig=RIG):
    """By pair's camera: the sum of each camera's grid in the middle of its image, as a share of what is valid there."""
    cells = measure(frame, rig, SgbmMatcher())[0].cells
    found = {}
    for counted, of_grid in cells.items():
        if counted.check is check:
            middle = np.s_[5:11, 18:24]
            total, valid = (grid[middle].astype(int).sum() for grid in (of_grid.total, of_grid.valid))
            found[counted.sensor, counted.other] = total / valid
    return found


def spotted(frame, sensor, gain):
    """The frame with a part of one image brighter or darker, its texture left."""
    pixels = frame.images[sensor].pixels.copy()
    pixels[30:100, 130:220] = np.clip(pixels[30:100, 130:220] * gain, 0, 255)
    return replace(frame, images={**frame.images, sensor: replace(frame.images[sensor], pixels=pixels)})


@pytest.mark.parametrize("sensor", [1, 2, 3])
@pytest.mark.parametrize(("gain", "sign"), [(1.8, 1), (0.4, -1)], ids=["a facula", "dirt"])
def test_light_that_a_camera_adds_or_lacks_has_its_sign_there_and_the_other_one_in_the_others(sensor, gain, sign):
    light = in_window(spotted(scene(), sensor, gain), Check.ADDED_LIGHT)
    assert len(light) == 6
    of_sensor = [value for (camera, _), value in light.items() if camera == sensor]
    against = [value for (_, other), value in light.items() if other == sensor]
    elsewhere = [value for pair, value in light.items() if sensor not in pair]
    assert (np.array(of_sensor) * sign > 1).all()
    assert (np.array(against) * sign < -0.5).all()
    assert np.abs(elsewhere).max() < 0.1


@pytest.mark.parametrize("colour", [{1}, {2, 3}, {1, 2, 3}], ids=str)
def test_grey_and_colour_cameras_of_one_rig_see_the_same_and_a_facula_in_one(colour):
    def as_mixed(frame):
        images = {
            n: CameraImage(n, 0, cv2.cvtColor(i.pixels, cv2.COLOR_GRAY2BGR) if n in colour else i.pixels)
            for n, i in frame.images.items()
        }
        return replace(frame, images=images)

    assert np.abs(list(in_window(as_mixed(scene()), Check.ADDED_LIGHT).values())).max() < 0.1
    light = in_window(as_mixed(spotted(scene(), 3, 1.8)), Check.ADDED_LIGHT)
    assert min(light[3, 1], light[3, 2]) > 1
    assert max(light[1, 3], light[2, 3]) < -0.5
    assert abs(light[1, 2]) < 0.1


def test_a_camera_with_less_light_is_neither_darker_nor_inconsistent():
    frame = scene()
    frame = replace(frame, images={**frame.images, 1: DimmedCamera(0.6).apply(frame.images[1])})
    for check in (Check.ADDED_LIGHT, Check.PHOTOMETRIC_INCONSISTENCY):
        assert np.abs(list(in_window(frame, check).values())).max() < 0.1
