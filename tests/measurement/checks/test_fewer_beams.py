"""LiDARs of fewer beams have conflicts as those of sixty-four have, without a calibration."""

from dataclasses import replace
from decimal import Decimal

import numpy as np
import pytest

from auditor.identification.scores import normalised_scores, thresholds_from
from auditor.lab.attacks.paper import BogusWall
from auditor.lab.evaluation.attacked_frame import AttackedFrame
from auditor.lab.simulation.drives import make_drive
from auditor.measurement.disparity.matchers import find_matcher
from auditor.model.checks import Check
from auditor.model.frames import PointCloud

LOWEST_DEG, BEAMS, FIELD_DEG = -24.9, 64, 26.9


@pytest.fixture(scope="module")
def street():
    drive = make_drive(3, 2, n_cameras=3, style="city", vehicle=3)
    return drive.rig, next(iter(drive.frames()))


@pytest.mark.parametrize("beams", [64, 32, 16])
def test_a_wall_is_in_conflict_and_a_clean_street_is_not(street, beams):
    rig, frame = street
    x, y, z = frame.cloud.xyz_m.T
    ring = np.floor((np.rad2deg(np.arctan2(z, np.hypot(x, y))) - LOWEST_DEG) / (FIELD_DEG / BEAMS))
    kept = frame.cloud.xyz_m[ring % (BEAMS // beams) == 0]
    assert len(kept) < 1.2 * len(x) * beams / BEAMS
    attacked_frame = AttackedFrame(
        replace(frame, cloud=PointCloud(frame.cloud.stamp_ns, kept)), rig, find_matcher("sgbm")
    )
    conflict = attacked_frame.sensor_checks[0]
    assert conflict.check is Check.LIDAR_CONFLICT
    thresholds = thresholds_from([], [conflict], 20, Decimal("0.01"))

    def z_of(attacks):
        statistics = np.array([attacked_frame.statistics(attacks)[:1]], dtype=np.float64)
        return float(normalised_scores(statistics, [thresholds.expected[conflict]])[0, 0])

    assert z_of({}) < thresholds.limit < z_of({0: BogusWall(range_m=7.0, lateral_m=0.5)})
