from dataclasses import replace
from itertools import pairwise
from math import isnan

import numpy as np
import pytest

from auditor.lab.attacks.faults import ShiftedCamera
from auditor.measurement import FaultFeatures, measure
from auditor.measurement.disparity.matchers import SgbmMatcher
from auditor.measurement.fault_features.lidar_agreement import BORDER, LidarComparison, agreement
from auditor.model.fault_features import COLUMNS, PairFaultFeatures
from tests.making.scenes import DEPTH_M, RIG, WIDTH, plane_cloud, plane_rig, scene

NEAR_M = 6.0


def with_image(frame, sensor, fault):
    return replace(frame, images={**frame.images, sensor: fault.apply(frame.images[sensor])})


def observed(*frames, rig=RIG):
    watch = FaultFeatures()
    for frame in frames:
        _, evidence = measure(frame, rig, SgbmMatcher())
        seen = watch.update(evidence)
    return seen


def test_cameras_that_see_one_moment_are_in_step_and_nothing_is_said_of_a_frame_before_the_first():
    seen = observed(scene())
    assert set(seen) == {(1, 2), (1, 3), (2, 3)}
    for pair in seen.values():
        assert pair.rows.tracked > 30
        assert pair.rows.row_aligned > 0.9
        assert abs(pair.rows.offset_px) < 0.5
        assert isnan(pair.rows.lagged_i)
        assert isnan(pair.rows.lagged_k)
        assert isnan(pair.agreement.before_only)
        assert pair.agreement.agreeing > 0.9


def test_a_tilted_camera_moves_all_rows_of_its_pairs_by_one_offset():
    seen = observed(with_image(scene(), 1, ShiftedCamera(6)))
    assert seen[1, 3].rows.row_aligned < 0.1
    assert seen[1, 3].rows.offset_px == pytest.approx(6, abs=0.5)
    assert seen[1, 3].rows.offset_share > 0.8
    assert seen[2, 3].rows.row_aligned > 0.9


def test_a_camera_a_frame_behind_is_on_its_rows_with_the_frame_before():
    before, now = scene(), scene(down_px=6)
    rows = observed(before, replace(now, images={**now.images, 1: before.images[1]}))[1, 3].rows
    assert rows.row_aligned < 0.1
    assert rows.lagged_i > 0.9
    steady = observed(before, now)[1, 3].rows
    assert steady.row_aligned > 0.9
    assert max(steady.lagged_i, steady.lagged_k) < 0.1


def test_a_reference_a_frame_behind_all_along_is_on_its_rows_with_the_others_frame_before():
    moments = [scene(down_px=rows) for rows in (0, 6, 12)]
    lagging = [replace(now, images={**now.images, 3: before.images[3]}) for before, now in pairwise(moments)]
    seen = observed(*lagging)
    for pair in (seen[1, 3], seen[2, 3]):
        assert pair.rows.row_aligned < 0.1
        assert pair.rows.lagged_k > 0.8
        assert pair.rows.lagged_i < 0.1
    assert seen[1, 2].rows.row_aligned > 0.9


def test_a_camera_rotated_aside_biases_its_disparities_by_a_constant():
    agreement = observed(with_image(scene(), 1, ShiftedCamera(0, -6)))[1, 3].agreement
    assert agreement.agreeing < 0.1
    assert agreement.bias_px == pytest.approx(6, abs=1)
    assert agreement.biased > 0.9


def step(aside_px=0):
    """A plane whose right half stands nearer: a plane alone would not show a rotation of the LiDAR."""
    far, near = scene(), scene(depth_m=NEAR_M)
    images = {}
    for number, image in far.images.items():
        edge = WIDTH // 2 - round(300 * float(RIG.camera(number).centre_m[0]) / NEAR_M)
        pixels = image.pixels.copy()
        pixels[:, edge:] = near.images[number].pixels[:, edge:]
        images[number] = replace(image, pixels=pixels)
    cloud = plane_cloud(DEPTH_M)
    right = cloud[:, 1] < -aside_px / 300 * DEPTH_M
    cloud = np.where(right[:, None], cloud * np.float32(NEAR_M / DEPTH_M), cloud)
    return replace(far, images=images, cloud=replace(far.cloud, xyz_m=cloud))


def test_a_rotated_lidar_agrees_once_all_its_points_are_moved():
    straight, rotated = (observed(step(aside))[2, 3].agreement for aside in (0, 16))
    assert straight.agreeing > 0.9
    assert max(straight.rotated, straight.biased) < straight.agreeing + 0.01
    assert rotated.agreeing < straight.agreeing - 0.02
    assert rotated.rotated > rotated.agreeing + 0.02
    assert (rotated.right_px, rotated.down_px) == (-16, 0)
    assert rotated.rotated_only > 5 * rotated.unrotated_only
    assert straight.rotated_only < rotated.rotated_only / 10


def edge_seen_aside(aside_px):
    """The agreement with stereo of a LiDAR that sees the edge of a near surface some pixels too far right."""
    half_px = np.arange(200)
    sure_px = np.tile(np.where(half_px < 100, 20, 40).astype(np.float32), (60, 1))
    row, column = (one.ravel().astype(np.int32) for one in np.mgrid[0:120:2, 100:300])
    d0_px = np.where(column < 200 + aside_px, 20, 40).astype(np.float32)
    bordered_px = np.pad(sure_px, BORDER, constant_values=np.nan)
    return agreement(LidarComparison(bordered_px, row, column, d0_px), None)


def test_a_lidar_turned_by_less_than_half_of_what_is_looked_for_has_not_turned():
    little, much = edge_seen_aside(4), edge_seen_aside(8)
    assert (little.right_px, much.right_px) == (-8, -8)
    assert little.rotated_only < little.unrotated_only  # moved by 2 px it agrees better than moved by 8
    assert much.rotated_only == 8 * 60
    assert much.unrotated_only == 0


def test_the_points_of_a_lidar_a_frame_behind_agree_with_the_frame_before_alone():
    far, near = scene(), scene(depth_m=NEAR_M)
    now, lagging = (observed(far, frame)[2, 3].agreement for frame in (near, replace(near, cloud=far.cloud)))
    assert now.now_only > 500
    assert now.before_only == 0
    assert lagging.before_only > 500
    assert lagging.now_only == 0


def test_without_a_lidar_nothing_is_said_of_it():
    rig = plane_rig(lidar=False)
    pair = observed(replace(scene(), cloud=None), rig=rig)[1, 3]
    assert all(isnan(value) for value in pair.agreement)
    assert len(PairFaultFeatures().values) == len(COLUMNS)
    assert all(isnan(value) for value in PairFaultFeatures().values)
