"""Clouds of which some points were recorded: every fourth, or one a voxel."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from auditor.lab.simulation.drives import SyntheticDrive, make_drive
from auditor.measurement import measure_stream
from auditor.measurement.checks.point_distribution import is_thinned
from auditor.measurement.disparity.lidar import lidar_view
from auditor.measurement.disparity.matchers import find_matcher
from auditor.model.arrays import Mask, Points
from auditor.model.checks import Check
from auditor.model.frames import Frame


@cache
def drive() -> SyntheticDrive:
    return make_drive(2, 1, n_cameras=3)


@cache
def frame() -> Frame:
    [one] = [one for one in drive().frames() if isinstance(one, Frame)]
    return one


def recorded(keep: Mask) -> Frame:
    cloud = frame().cloud
    assert cloud is not None
    return replace(frame(), cloud=replace(cloud, xyz_m=cloud.xyz_m[keep]))


def every(step: int) -> Mask:
    return np.arange(len(points())) % step == 0


def one_a_voxel(side_m: float) -> Mask:
    _, first = np.unique(np.floor(points() / side_m), axis=0, return_index=True)
    return np.isin(np.arange(len(points())), first)


def points() -> Points:
    cloud = frame().cloud
    assert cloud is not None
    return cloud.xyz_m


CLOUDS: dict[str, tuple[Callable[[], Mask], bool]] = {
    "as it was": (lambda: every(1), False),
    "every second point": (lambda: every(2), False),
    "every sixth point": (lambda: every(6), True),
    "a random fifth": (lambda: np.random.default_rng(1).random(len(points())) < 0.2, True),
    "voxels of 0.5 m": (lambda: one_a_voxel(0.5), True),
    "half of the view alone": (lambda: points()[:, 1] > 0, False),
    "no point": (lambda: every(1) & False, False),
}


@pytest.mark.parametrize(("keep", "expected"), CLOUDS.values(), ids=CLOUDS)
def test_a_cloud_is_thinned_where_the_points_of_a_beam_lie_far_apart(keep: Callable[[], Mask], expected: bool) -> None:
    cloud = recorded(keep()).cloud
    assert cloud is not None
    assert is_thinned(lidar_view(cloud, drive().rig, 3)) == expected


@pytest.mark.parametrize(("step", "looked"), [(1, True), (6, False)])
def test_what_lies_between_the_points_of_a_thinned_cloud_is_not_looked_at(step: int, looked: bool) -> None:
    [(found, _)] = measure_stream([recorded(every(step))], drive().rig, find_matcher("sgbm"))
    lost = [cells for key, cells in found.cells.items() if key[0] is Check.LOST_RETURNS]
    rough = [key for key in found.shares if key.check is Check.ROUGH_RANGES]
    assert any(cells.valid.any() for cells in lost) == looked
    assert bool(rough) == looked
