"""Courses: which sensors the frames of an incident are held for, where another one is attacked for a shorter time."""

import numpy as np
import pytest

from auditor.identification.incidents.events import held_of
from auditor.identification.incidents.sequential import Event, FrameEvidence, incident_limit
from auditor.model.verdict import Verdict, VerdictKind

FRAMES = 24
SENSORS = (0, 1, 4)
ALL = range(FRAMES)


def attacked_in(frames_of, frames=ALL):
    """What each frame of an incident of some `frames` is held for, where frames name each sensor so, at 10 Hz."""
    of_each = np.full((FRAMES, len(SENSORS)), -0.1)
    for sensor, naming in frames_of.items():
        of_each[list(naming), SENSORS.index(sensor)] = 1.0
    added = of_each.max(axis=1)
    every = np.ones(FRAMES)
    evidence = FrameEvidence(added, of_each, of_each, added, 0.3 * every, np.zeros(FRAMES, dtype=np.int64), 0.1 * every)
    named = [tuple(sensor for sensor in SENSORS if place in frames_of.get(sensor, ())) for place in ALL]
    verdicts = {place: Verdict(VerdictKind.ATTACKED, "-", sensors) for place, sensors in enumerate(named)}
    held = held_of(Event(tuple(frames)), verdicts, evidence, SENSORS, incident_limit())
    return {place: frame.held_for[1] for place, frame in held.frames.items()}


@pytest.mark.parametrize(
    ("lidar", "camera"),
    [
        (range(10, 16), ALL),
        (range(4, 20), ALL),
        (range(6), range(3, FRAMES)),
        (ALL, range(12, 15)),
    ],
)
def test_each_sensor_is_held_for_attacked_from_its_own_first_frame_to_its_own_last(lidar, camera):
    held = attacked_in({0: lidar, 4: camera})
    assert set(held) == set(ALL)
    for sensor, frames in ((0, lidar), (4, camera)):
        assert [place for place, attacked in held.items() if sensor in attacked] == list(frames)


def test_two_frames_that_name_a_sensor_more_are_too_little_for_a_course():
    assert set(attacked_in({0: (8, 9), 4: ALL}).values()) == {(4,)}


def test_a_course_goes_on_where_frames_in_it_do_not_name_its_sensor_and_ends_after_a_second():
    held = attacked_in({0: (2, 3, 4, 6, 8), 4: ALL})
    assert [place for place, attacked in held.items() if attacked == (0, 4)] == list(range(2, 9))
    held = attacked_in({0: (2, 3, 4, 20, 21, 22), 4: ALL})
    assert [place for place, attacked in held.items() if attacked == (0, 4)] == [2, 3, 4, 20, 21, 22]


def test_frames_of_doubt_name_no_innocent_sensor():
    assert set(attacked_in({1: (5, 17), 4: set(ALL) - {5, 17}}).values()) == {(4,)}


@pytest.mark.parametrize("apart", [(5, 10, 11, 12), (10, 11, 12, 17)])
def test_a_frame_far_from_an_incident_that_names_another_sensor_is_no_end_of_it(apart):
    held = attacked_in({1: set(apart) - {10, 11, 12}, 4: (10, 11, 12)}, apart)
    assert held == dict.fromkeys((10, 11, 12), (4,))


def test_a_frame_beside_an_incident_or_within_it_that_names_another_sensor_is_part_of_it():
    assert set(attacked_in({1: (9, 15), 4: (10, 11, 12, 18, 19)}, (9, 10, 11, 12, 15, 18, 19))) == {
        *(9, 10, 11, 12, 15, 18, 19)
    }
