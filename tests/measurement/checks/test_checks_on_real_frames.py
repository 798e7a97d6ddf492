"""On a real frame exactly the pair checks of the attacked sensor fire."""

import os
from itertools import islice

import pytest

from auditor.evaluation.attacked_frame import AttackedFrame
from auditor.identification.scores import FLOORS
from auditor.identification.statistics import WINDOWS, fitted
from auditor.lab.attacks.paper import BogusWall, Facula
from auditor.measurement.disparity.matchers import find_matcher
from auditor.model.checks import Check
from tests.benchmarks.real_drives import frames

pytestmark = pytest.mark.skipif(
    "AUDITOR_TEST_DATA" not in os.environ, reason="AUDITOR_TEST_DATA is not set: no real recorded data"
)

FACULA = Facula(amplitude=510.0, radius_px=250.0, u_px=600.0, v_px=200.0)


@pytest.fixture(scope="module")
def attacked_frame():
    rig, stream = frames("0009")
    return AttackedFrame(next(islice(stream, 20, None)), rig, find_matcher("sgbm"))


@pytest.mark.parametrize(
    ("attacks", "fired"),
    [
        ({}, set()),
        ({0: BogusWall(range_m=8.0, lateral_m=0.0)}, {"lidar_conflict 1 3", "lidar_conflict 2 3"}),
        (
            {1: FACULA},
            {
                "photometric_inconsistency 1 2",
                "photometric_inconsistency 1 3",
                "brightness_difference 1 2",
                "brightness_difference 1 3",
            },
        ),
        (
            {2: FACULA},
            {
                "photometric_inconsistency 1 2",
                "photometric_inconsistency 2 3",
                "brightness_difference 1 2",
                "brightness_difference 2 3",
            },
        ),
        (
            {3: FACULA},
            {
                "photometric_inconsistency 1 3",
                "photometric_inconsistency 2 3",
                "brightness_difference 1 3",
                "brightness_difference 2 3",
            },
        ),
    ],
    ids=["clean", "wall", "facula on S_1", "facula on S_2", "facula on S_3"],
)
def test_exactly_the_pair_checks_of_the_attacked_sensor_fire(attacked_frame, attacks, fired):
    ratios = zip(attacked_frame.pair_checks, attacked_frame.ratios(attacks), strict=True)
    assert {f"{e.check} {e.i} {e.k}" for e, ratio in ratios if ratio > FLOORS[e.check]} == fired


def test_sixty_four_beams_need_what_the_window_says(attacked_frame):
    window = WINDOWS[Check.LIDAR_CONFLICT]
    for attacks in ({}, {0: BogusWall(range_m=6.0, lateral_m=0.0)}, {3: FACULA}):
        assert fitted(window, attacked_frame.frame_checks(1, 3, attacks).lidar_conflicts[1, 3].valid) == window
