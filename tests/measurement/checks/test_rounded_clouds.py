"""Clouds whose coordinates were rounded before they were recorded."""

from dataclasses import replace

import numpy as np
import pytest

from auditor.lab.attacks.spoofing import ChangedRanges
from auditor.measurement import measure_stream
from auditor.measurement.checks.point_distribution import is_rounded, rough_ranges
from auditor.measurement.disparity.lidar import LidarView, lidar_view, rounding_step_m
from auditor.measurement.disparity.matchers import find_matcher
from auditor.model.arrays import Points
from auditor.model.checks import Check
from auditor.model.frames import PointCloud
from tests.measurement.checks.test_thinned_clouds import drive, frame, points

CAMERA = 3


def view_of(xyz: Points) -> LidarView:
    return lidar_view(PointCloud(0, np.ascontiguousarray(xyz, dtype=np.float32)), drive().rig, CAMERA)


def rounded(xyz: Points, step_m: float) -> Points:
    return np.asarray(np.round(xyz / step_m) * step_m, dtype=np.float32)


def jittered(xyz: Points) -> Points:
    return ChangedRanges(10.0, 5.0, noise_m=0.3, seed=1).apply(PointCloud(0, xyz), drive().rig).xyz_m


def roughness(xyz: Points) -> float:
    found = rough_ranges(view_of(xyz), drive().rig.camera(CAMERA).focal_px)
    assert found is not None
    return found


@pytest.mark.parametrize("step_m", [0.03, 0.05, 0.08])
def test_rounding_is_not_rough_and_a_jitter_that_was_rounded_is(step_m: float) -> None:
    assert roughness(rounded(points(), step_m)) < 0.1
    assert roughness(rounded(jittered(points()), step_m)) > 3 * roughness(rounded(points(), step_m))


@pytest.mark.parametrize("step_m", [0.02, 0.05, 0.1])
def test_what_coordinates_were_rounded_to_is_found_from_them_wherever_the_first_value_lies(step_m: float) -> None:
    assert rounding_step_m(rounded(points(), step_m)) == pytest.approx(step_m, rel=1e-3)
    assert rounding_step_m(rounded(points(), step_m) + np.float32(0.3)) == pytest.approx(step_m, rel=1e-3)


def test_a_cloud_that_was_not_rounded_has_hardly_a_step() -> None:
    assert rounding_step_m(points()) < 0.001


@pytest.mark.parametrize("xyz", [np.zeros((0, 3), dtype=np.float32), np.ones((9, 3), dtype=np.float32)])
def test_points_without_two_values_have_no_step(xyz: Points) -> None:
    assert rounding_step_m(xyz) == 0


@pytest.mark.parametrize(("step_m", "coarse"), [(0.08, False), (0.1, True)])
def test_from_a_tenth_of_a_metre_on_rounding_is_coarse(step_m: float, coarse: bool) -> None:
    assert is_rounded(view_of(rounded(points(), step_m))) == coarse


@pytest.mark.parametrize(("step_m", "measured"), [(0.08, True), (0.1, False)])
def test_of_coarse_coordinates_neither_rough_ranges_nor_isolated_points_are_measured(
    step_m: float, measured: bool
) -> None:
    cloud = PointCloud(0, rounded(points(), step_m))
    [(found, _)] = measure_stream([replace(frame(), cloud=cloud)], drive().rig, find_matcher("sgbm"))
    checks = {key.check for key in found.shares}
    assert (Check.ROUGH_RANGES in checks) == measured
    assert (Check.ISOLATED_POINTS in checks) == measured
