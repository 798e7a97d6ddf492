"""How much of each sensor other sensors were compared with."""

import numpy as np
import pytest

from auditor.measurement import measure
from auditor.measurement.disparity.matchers.sgbm import SgbmMatcher
from auditor.measurement.frame import ComparedShares, looked_at
from auditor.model.checks import Check, CountedPair
from auditor.model.measurement import Cells
from auditor.model.rig import LIDAR
from tests.making.scenes import plane_frame, plane_rig


def counted(valid):
    valid = np.array(valid, dtype=np.uint8)
    return Cells(valid, np.zeros_like(valid, dtype=np.int8))


def light(i, k, sensor, valid):
    return {CountedPair(Check.ADDED_LIGHT, i, k, sensor): counted(valid)}


def test_what_one_other_sees_and_what_two_see_are_told_apart():
    cells = light(1, 2, 2, [[5, 5, 0, 0]]) | light(2, 3, 2, [[0, 1, 1, 0]])
    assert looked_at(cells, {2: 1.0}, None) == {2: ComparedShares(0.75, 0.25)}


def test_a_view_of_half_a_picture_is_half_of_it_at_most():
    cells = light(1, 2, 1, [[9, 9]]) | light(1, 3, 1, [[9, 0]])
    assert looked_at(cells, {1: 0.5, 4: 1.0}, None) == {1: ComparedShares(0.5, 0.25), 4: ComparedShares(0.0, 0.0)}


def test_other_checks_do_not_make_a_place_looked_at():
    cells = {CountedPair(Check.PHOTOMETRIC_INCONSISTENCY, 1, 2, 1): counted([[9, 9]])}
    assert looked_at(cells, {1: 1.0}, None) == {1: ComparedShares(0.0, 0.0)}


@pytest.mark.parametrize(("points", "share"), [(100, 0.3), (20, 1.0), (0, 1.0)])
def test_a_point_counts_once_however_many_pairs_look_at_it(points, share):
    pairs = {
        CountedPair(Check.LIDAR_CONFLICT, 1, 2, LIDAR): counted([[10, 20]]),
        CountedPair(Check.LIDAR_CONFLICT, 1, 3, LIDAR): counted([[5, 20]]),
    }
    assert looked_at(pairs, {}, points) == {LIDAR: ComparedShares(share, share)}


def test_a_lidar_that_no_pair_checks_is_not_looked_at():
    assert looked_at({}, {}, 1000) == {LIDAR: ComparedShares(0.0, 0.0)}


def test_a_frame_says_what_of_each_sensor_was_looked_at_and_a_missing_camera_takes_its_voice():
    rig = plane_rig()
    frame = plane_frame(rig)
    whole = measure(frame, rig, SgbmMatcher())[0].coverage
    assert whole[LIDAR].compared_share == whole[LIDAR].compared_by_two_share > 0
    assert all(0 < whole[camera].compared_by_two_share < whole[camera].compared_share <= 1 for camera in (1, 2, 3))
    del frame.images[2]
    without = measure(frame, rig, SgbmMatcher())[0].coverage
    assert without[1].compared_by_two_share == without[3].compared_by_two_share == 0 < without[1].compared_share
