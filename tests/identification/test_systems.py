import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from auditor.identification.systems import System, measured_triples
from auditor.model.checks import (
    CAMERA_CHECKS,
    LIDAR_CHECKS,
    Check,
    sensor_checks_of,
)
from auditor.model.checks.kind import Of
from auditor.model.rig import Triple, triples_of

PAIRS = {n: tuple((i, k) for k in range(2, n + 1) for i in range(1, k)) for n in range(2, 7)}

OF_CAMERAS = tuple(check for check in Check if check.kind.of is Of.CAMERAS)
"""The checks of a camera by other cameras."""

OF_PAIRS = (Check.LIDAR_CONFLICT, Check.LOST_RETURNS, Check.FALSE_RANGES, Check.SCATTERED_RANGES)
"""The checks of the LiDAR by pairs of cameras."""


def system(cameras, *, lidar=True, views=None, fallback=None):
    """A rig whose cameras are all matched with each other."""
    views = (cameras,) if views is None else views
    checks = sensor_checks_of(PAIRS[cameras], PAIRS[cameras] if lidar else (), views if lidar else ())
    sensors = tuple(range(0 if lidar else 1, cameras + 1))
    return System(checks, triples_of(cameras, lidar=lidar), sensors, fallback)


def counting(one, *absent):
    return [one.sensor_checks[column] for column in one.counting(frozenset(absent))]


def subjects(checks):
    return {(check.check, check.sensor, check.others) for check in checks}


def test_where_all_are_there_each_sensor_is_judged_once_by_all_the_others():
    one = system(4)
    assert subjects(counting(one)) == {
        *((check, 0, (1, 2, 3, 4)) for check in OF_PAIRS),
        *((check, n, tuple(m for m in range(1, 5) if m != n)) for check in OF_CAMERAS for n in range(1, 5)),
        (Check.POINT_DROPOUT, 0, (4,)),
        (Check.ISOLATED_POINTS, 0, (4,)),
        (Check.ROUGH_RANGES, 0, (4,)),
        (Check.FREE_SPACE_CONFLICT, 0, (4,)),
        (Check.SCATTERED_RETURNS, 0, (4,)),
        (Check.SURROUNDING_CONFLICT, 0, ()),
    }
    assert one.judged_together == 1 + 4 * 3 + 2 + 6, (
        "and the six pairs; light of one colour or in rows, lost returns, false and rough ranges do not count"
    )


def test_without_a_camera_the_others_judge_each_other_by_those_that_are_left():
    assert subjects(counting(system(4), 2)) == {
        *((check, 0, (1, 3, 4)) for check in OF_PAIRS),
        *((check, n, tuple(m for m in (1, 3, 4) if m != n)) for check in OF_CAMERAS for n in (1, 3, 4)),
        (Check.POINT_DROPOUT, 0, (4,)),
        (Check.ISOLATED_POINTS, 0, (4,)),
        (Check.ROUGH_RANGES, 0, (4,)),
        (Check.FREE_SPACE_CONFLICT, 0, (4,)),
        (Check.SCATTERED_RETURNS, 0, (4,)),
        (Check.SURROUNDING_CONFLICT, 0, ()),
    }


def test_without_two_cameras_of_four_two_are_left_that_judge_each_other_alone():
    found = counting(system(4), 1, 2)
    assert subjects(found) == {
        (Check.LIDAR_CONFLICT, 0, (3, 4)),
        *((check, n, (7 - n,)) for check in OF_CAMERAS for n in (3, 4) if not check.kind.by_two_others),
        (Check.POINT_DROPOUT, 0, (4,)),
        (Check.ISOLATED_POINTS, 0, (4,)),
        (Check.ROUGH_RANGES, 0, (4,)),
        (Check.FREE_SPACE_CONFLICT, 0, (4,)),
        (Check.SCATTERED_RETURNS, 0, (4,)),
        (Check.SURROUNDING_CONFLICT, 0, ()),
    }
    assert {check.nameable for check in found if check.check in CAMERA_CHECKS} == {(3, 4), (4, 3)}


def test_without_the_lidar_none_of_its_checks_count():
    assert {check.check for check in counting(system(3), 0)} == set(OF_CAMERAS)
    assert subjects(counting(system(3), 0)) == subjects(counting(system(3, lidar=False)))


def test_without_its_view_the_lidar_s_points_are_not_judged():
    assert not LIDAR_CHECKS & {check.check for check in counting(system(3), 3)}
    views = counting(system(3, views=(3, 2)), 3)
    assert {check.others for check in views if check.check in LIDAR_CHECKS} == {(2,)}


def test_all_views_of_the_lidar_count_at_once():
    views = {check.others for check in counting(system(3, views=(3, 2))) if check.check in LIDAR_CHECKS}
    assert views == {(3,), (2,)}


def test_of_a_large_rig_up_to_two_sensors_may_be_missing():
    one = system(6)
    for absent in ((), (1,), (1, 2)):
        left = [n for n in range(1, 7) if n not in absent]
        expected = {(check, n, tuple(m for m in left if m != n)) for check in CAMERA_CHECKS for n in left}
        assert expected < subjects(counting(one, *absent))
    # With three gone the checks by several voters are not there: each pair is judged alone.
    assert all(len(check.others) == 1 for check in counting(one, 1, 2, 3) if check.check in CAMERA_CHECKS)


@given(st.integers(2, 6), st.booleans(), st.sets(st.integers(0, 6)))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_no_check_counts_that_needs_an_absent_sensor_and_all_of_a_subject_have_as_many_voters(cameras, lidar, absent):
    one = system(cameras, lidar=lidar)
    columns = one.counting(frozenset(absent))
    assert columns.tolist() == sorted(set(columns.tolist()))
    found = [one.sensor_checks[column] for column in columns]
    assert all(absent.isdisjoint(check.needed) for check in found)
    for subject in {check[:2] for check in found}:
        assert len({len(check.others) for check in found if check[:2] == subject}) == 1
    # Whatever could be judged by the sensors that are there is judged.
    there = {check[:2] for check in one.sensor_checks if absent.isdisjoint(check.needed)}
    assert there == {check[:2] for check in found}


def triples(one, measured, *absent):
    return set(measured_triples(one, frozenset(measured), frozenset(absent)))


def test_triples_are_measured_where_their_sensors_were_compared():
    one = system(3)
    every = counting(one)
    assert triples(one, every) == {(0, 1, 3), (0, 2, 3), (1, 2, 3)}
    cameras = [check for check in every if check.check in CAMERA_CHECKS]
    assert triples(one, cameras) == {(1, 2, 3)}
    without_1 = [check for check in cameras if check.sensor != 1]
    assert triples(one, without_1) == set()
    assert triples(one, [check for check in every if check.check is Check.LIDAR_CONFLICT]) == {(0, 1, 3), (0, 2, 3)}
    assert triples(one, []) == set()


def test_triples_of_absent_sensors_are_not_measured():
    assert triples(system(3), system(3).sensor_checks, 2) == {(0, 1, 3)}
    assert triples(system(3), system(3).sensor_checks, 0) == {(1, 2, 3)}


@pytest.mark.parametrize(
    ("absent", "expected"), [((), {(0, 1, 3), (0, 2, 3), (1, 2, 3), (0, 1, 2)}), ((3,), {(0, 1, 2)})]
)
def test_the_fallback_is_one_of_them(absent, expected):
    one = system(3, fallback=Triple(0, 1, 2))
    assert triples(one, one.sensor_checks, *absent) == expected
