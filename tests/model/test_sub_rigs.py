"""Which rigs are a part of a rig kind, and which sensors of it they have."""

from dataclasses import replace

import numpy as np
import pytest

from auditor.model.rig import Rig
from auditor.model.rig_kind import Similarity
from auditor.model.sub_rigs import SubRig, sub_rig
from tests.making.scenes import moved, plane_rig

POSITIONS_M = (1.04, 0.74, 0.4, 0.0)
WHOLE = plane_rig(POSITIONS_M)


def part(sensors, whole=WHOLE):
    """The rig of some of the sensors."""
    cameras = [whole.camera(sensor) for sensor in sensors if sensor]
    renumbered = tuple(replace(camera, number=number) for number, camera in enumerate(cameras, start=1))
    return Rig(whole.lidar if 0 in sensors else None, renumbered)


@pytest.mark.parametrize("sensors", [(0, 1, 2), (0, 3, 4), (0, 1, 4), (0, 2, 3, 4), (1, 2, 3, 4), (1, 3, 4), (2, 3, 4)])
def test_a_rig_that_lacks_sensors_is_found_by_its_cameras_geometry(sensors):
    assert sub_rig(WHOLE.kind, part(sensors)) == SubRig(WHOLE.kind, sensors)


def test_a_rig_that_is_no_part_is_none():
    assert sub_rig(WHOLE.kind, WHOLE) is None, "it lacks nothing"
    assert sub_rig(part((1, 2, 3, 4)).kind, part((0, 1, 2))) is None, "it has a LiDAR more"
    assert sub_rig(part((0, 1, 2)).kind, WHOLE) is None, "it has more cameras"
    assert sub_rig(WHOLE.kind, plane_rig((1.0, 0.5, 0.0))) is None, "its cameras stand elsewhere"
    wider = part((0, 1, 2))
    wider = Rig(wider.lidar, tuple(replace(camera, width_px=640) for camera in wider.cameras))
    assert sub_rig(WHOLE.kind, wider) is None, "its images have another size"


def test_lengths_agree_within_the_tolerance_of_rig_kinds():
    assert sub_rig(WHOLE.kind, plane_rig((1.043, 0.74, 0.0))) == SubRig(WHOLE.kind, (0, 1, 2, 4))
    assert sub_rig(WHOLE.kind, plane_rig((1.055, 0.74, 0.0))) == SubRig(WHOLE.kind, (0, 1, 2, 4), Similarity.SIMILAR)
    assert sub_rig(WHOLE.kind, plane_rig((1.08, 0.74, 0.0))) is None


def test_a_part_of_a_similar_kind_is_found_where_none_of_the_kind_itself_is():
    found = part((0, 2, 3, 4))
    cameras = tuple(replace(c, width_px=324, projection=np.diag([1.03, 1.03, 1]) @ c.projection) for c in found.cameras)
    assert sub_rig(WHOLE.kind, Rig(found.lidar, cameras)) == SubRig(WHOLE.kind, (0, 2, 3, 4), Similarity.SIMILAR)
    even = plane_rig((0.75, 0.5, 0.25, 0.0))
    exactly = sub_rig(even.kind, plane_rig((0.5, 0.26, 0.0)))
    assert (exactly.sensors, exactly.similarity) == ((0, 1, 2, 3), Similarity.SIMILAR)


def test_of_several_choices_the_nearest_is_taken_and_of_equal_ones_the_first():
    close = plane_rig((1.0, 0.94, 0.462, 0.4))
    assert sub_rig(close.kind, part((0, 1, 2), close)).sensors == (0, 1, 2)
    assert sub_rig(close.kind, part((0, 3, 4), close)).sensors == (0, 3, 4)
    even = plane_rig((0.75, 0.5, 0.25, 0.0))
    assert sub_rig(even.kind, part((0, 3, 4), even)).sensors == (0, 1, 2)


def test_cameras_beside_a_line_are_found_by_the_baselines_of_all_pairs():
    whole = moved(WHOLE, ((0, 0, 0), (0, 0.5, 0), (0, 0, 0), (0, 0.6, 0)))
    assert not whole.shares_view
    for sensors in ((0, 2, 4), (0, 1, 3, 4), (1, 2, 4)):
        assert sub_rig(whole.kind, part(sensors, whole)).sensors == sensors


def test_what_is_absent_is_told_with_its_place():
    found = sub_rig(WHOLE.kind, part((2, 3, 4)))
    assert found.absent == ("LiDAR", "S_1 (320 x 120 at +0.00 m)")
    assert sub_rig(WHOLE.kind, part((0, 1, 2))).absent == (
        "S_3 (320 x 120 at +0.64 m)",
        "S_4 (320 x 120 at +1.04 m)",
    )
