from decimal import Decimal

import numpy as np

from auditor.elements import elements_of
from auditor.identification.false_alarms import HeldOut, leave_one_recording_out, score_threshold
from auditor.identification.joint import attack_sets

PAIRS = ((1, 3), (2, 3))
ELEMENTS = elements_of(3, PAIRS, PAIRS, (3,))
SETS = attack_sets(range(4), 1)
R = Decimal("0.01")


def test_each_recording_is_judged_by_the_others_alone():
    easy, hard = np.zeros((20, len(ELEMENTS))), np.zeros((10, len(ELEMENTS)))
    hard[:4, :2] = 0.65  # both pairs contradict the LiDAR in four frames
    found = leave_one_recording_out({"easy": easy, "hard": hard}, ELEMENTS, SETS, R)
    assert found == [HeldOut("easy", 20, 0), HeldOut("hard", 10, 4)]
    twice = leave_one_recording_out({"hard": hard, "like it": hard}, ELEMENTS, SETS, R)
    assert [held.raised for held in twice] == [0, 0]


def test_one_recording_alone_can_hold_nothing_out():
    assert leave_one_recording_out({"only": np.zeros((5, len(ELEMENTS)))}, ELEMENTS, SETS, R) == []


def test_the_score_s_threshold_allows_so_many_incidents_and_no_more():
    scores = np.array([-1, 0.2, 0.3, -1, 0.5, -1, 0.1, 0.9, -1])
    assert score_threshold(scores, hours=1.0, incidents_per_hour=3) == 0.0
    assert score_threshold(scores, hours=1.0, incidents_per_hour=2) == 0.3
    assert score_threshold(scores, hours=0.5, incidents_per_hour=2) == 0.5
    assert score_threshold(scores, hours=1.0, incidents_per_hour=0) == 0.9


def test_a_longer_incident_counts_once_even_where_a_higher_threshold_splits_it():
    scores = np.array([0.5, 0.1, 0.5])
    assert score_threshold(scores, hours=1.0, incidents_per_hour=1) == 0.0


def test_silent_frames_need_no_threshold():
    assert score_threshold(np.full(5, -0.02), hours=1.0, incidents_per_hour=0) == 0.0
