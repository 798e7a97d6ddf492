"""Which calibration is closest to a rig: of its kind, of a rig with more sensors, of a similar kind."""

from dataclasses import replace

import numpy as np
import pytest

from auditor.identification.thresholds import check_calibration
from auditor.identification.transfer import calibration_for, closeness
from auditor.model.calibration import Calibration
from auditor.model.measurement import Procedure
from auditor.model.rig import Rig
from auditor.model.rig_kind import Similarity
from tests.making.scenes import plane_rig

PROCEDURE = Procedure("sgbm", "{}")
RIG = plane_rig((0.74, 0.4, 0.0))
WHOLE = plane_rig((1.04, 0.74, 0.4, 0.0))


def larger(rig: Rig, by: float = 1.03) -> Rig:
    """The rig with images and focal lengths that are larger by a factor."""
    cameras = tuple(
        replace(camera, width_px=round(by * camera.width_px), projection=np.diag([by, by, 1]) @ camera.projection)
        for camera in rig.cameras
    )
    return Rig(rig.lidar, cameras)


def calibrated_on(rig: Rig) -> Calibration:
    return Calibration("c", rig.kind, PROCEDURE, ())


@pytest.mark.parametrize(
    ("calibrated", "rank", "similarity"),
    [
        (RIG, (False, 0), Similarity.SAME),
        (WHOLE, (False, 1), Similarity.SAME),
        (larger(RIG), (True, 0), Similarity.SIMILAR),
        (larger(WHOLE), (True, 1), Similarity.SIMILAR),
    ],
    ids=["same", "part", "similar", "similar part"],
)
def test_the_same_vehicle_is_closer_than_a_similar_one_also_with_more_sensors(calibrated, rank, similarity) -> None:
    calibration = calibrated_on(calibrated)
    assert closeness(calibration, RIG) == rank
    held = calibration_for(calibration, RIG)
    assert (held is calibration) is (rank[1] == 0)
    assert check_calibration(held, rig_kind=RIG.kind, procedure=PROCEDURE) is similarity


def test_other_rigs_are_not_close() -> None:
    for other in (larger(RIG, 1.1), larger(WHOLE, 1.1), plane_rig((0.4, 0.0))):
        assert closeness(calibrated_on(other), RIG) is None
        assert calibration_for(calibrated_on(other), RIG) is None
