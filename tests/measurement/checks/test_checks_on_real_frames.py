"""On a real frame the checks of the attacked sensor exceed the limit, and no others without it.

That of the prior alone at r = 1 %; that at 0.1 % once the drive's own clean frame says what is usual there.
"""

import os
from decimal import Decimal
from itertools import islice

import numpy as np
import pytest

from auditor.identification.drive_level import for_drive
from auditor.identification.naming import name_attacked
from auditor.identification.scores import normalised_scores, thresholds_from
from auditor.identification.statistics import CONFLICT_WINDOW, fitted, window_sums
from auditor.identification.systems import System
from auditor.lab.attacks.faults import HiddenSector
from auditor.lab.attacks.paper import BogusWall, Facula
from auditor.lab.attacks.spoofing import ChangedRanges, GhostCar
from auditor.lab.evaluation.attacked_frame import AttackedFrame
from auditor.measurement.disparity.matchers import find_matcher
from auditor.model.checks import Check
from auditor.model.verdict import VerdictKind
from tests.benchmarks.real_drives import frames

pytestmark = pytest.mark.skipif(
    "AUDITOR_TEST_DATA" not in os.environ, reason="AUDITOR_TEST_DATA is not set: no real recorded data"
)

FACULA = Facula(amplitude=510.0, radius_px=250.0, u_px=600.0, v_px=200.0)
WALL = BogusWall(range_m=8.0, lateral_m=0.0)


@pytest.fixture(scope="module")
def attacked_frame():
    rig, stream = frames("0009")
    return AttackedFrame(next(islice(stream, 20, None)), rig, find_matcher("sgbm"))


@pytest.fixture(scope="module", params=["prior alone", "prior and drive"])
def verdict(request, attacked_frame):
    rig = attacked_frame.rig
    checks = attacked_frame.sensor_checks
    system = System(checks, rig.triples, rig.sensors, rig.fallback)
    if request.param == "prior alone":
        thresholds = thresholds_from([], checks, system.judged_together, Decimal("0.01"))
    else:
        thresholds = thresholds_from([], checks, system.judged_together, Decimal("0.001"))
        clean = np.array([attacked_frame.statistics({})], dtype=np.float64)
        thresholds = for_drive(thresholds, checks, clean, np.zeros(1, dtype=np.int64))

    def judge(attacks):
        statistics = np.array([attacked_frame.statistics(attacks)], dtype=np.float64)
        z = normalised_scores(statistics, [thresholds.expected[check] for check in checks])
        return name_attacked(z, system, [frozenset()], thresholds.limit)[0]

    return judge


@pytest.mark.parametrize(
    ("attacks", "checks"),
    [
        ({0: WALL}, {Check.LIDAR_CONFLICT}),
        ({0: HiddenSector(8.0, 0.0)}, {Check.LOST_RETURNS}),
        ({0: GhostCar(200, 8.0, 1.0)}, {Check.FALSE_RANGES}),
        ({0: BogusWall(range_m=18.0, lateral_m=-2.0)}, {Check.FALSE_RANGES}),
        ({0: ChangedRanges(20.0, 5.0, shift_m=2.0)}, {Check.FALSE_RANGES}),
        ({0: ChangedRanges(10.0, 5.0, noise_m=0.3)}, {Check.ROUGH_RANGES}),
        *(({camera: FACULA}, {Check.ADDED_LIGHT, Check.PHOTOMETRIC_INCONSISTENCY}) for camera in (1, 2, 3)),
    ],
    ids=[
        "wall",
        "hidden sector",
        "ghost",
        "far wall",
        "shift",
        "jitter",
        "facula on S_1",
        "facula on S_2",
        "facula on S_3",
    ],
)
def test_the_attacked_sensor_is_named_by_its_own_checks(verdict, attacks, checks):
    found = verdict(attacks)
    assert found.kind is VerdictKind.ATTACKED
    assert found.attacked == tuple(attacks)
    assert {one.i for one in found.evidence} == set(attacks)
    assert checks.intersection(one.check_name for one in found.evidence)


def test_a_clean_frame_is_clean(verdict):
    assert verdict({}).kind is VerdictKind.CLEAN


def test_sixty_four_beams_need_what_the_window_says(attacked_frame):
    for attacks in ({}, {0: BogusWall(range_m=6.0, lateral_m=0.0)}, {3: FACULA}):
        conflicts = attacked_frame.frame_checks((1, 3), attacks).by_direction[Check.LIDAR_CONFLICT][1, 3]
        assert fitted(CONFLICT_WINDOW, window_sums(conflicts.valid, CONFLICT_WINDOW)) == CONFLICT_WINDOW
