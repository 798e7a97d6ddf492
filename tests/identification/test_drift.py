"""Drift: what drifts is named before long, with its sensor; what does not is hardly ever."""

import numpy as np
import pytest

from auditor.identification.drift import RAISED_FROM, DailyLevels, SeriesName, drifts
from auditor.identification.refresh_parameters import DRIFT, LEAST_DEVIATIONS
from auditor.model.checks import Check

DAYS, NOISE = 40, 0.05
PAIRS = ((1, 3), (2, 3), (1, 2))


def series(check, sensors, vehicle, level, *, signed=False, day=None):
    day = np.arange(len(level)) if day is None else day
    return DailyLevels(SeriesName("kind", check, sensors, vehicle), signed, day, np.asarray(level, dtype=np.float64))


def fleet(rng, *, vehicles=6, days=DAYS, season=0.0, turned=()):
    """The row offsets of a fleet of three cameras; `turned` are px a day by (vehicle, camera), and the first day."""
    found = []
    shared = season * np.sin(np.arange(days) / 9)
    for vehicle in range(vehicles):
        rows = {camera: rng.normal() + np.zeros(days) for camera in (1, 2, 3)}
        for (turning, camera), px, first in turned:
            if turning == vehicle:
                rows[camera] = rows[camera] + px * np.maximum(np.arange(days) - first, 0)
        for i, k in PAIRS:
            level = rows[i] - rows[k] + NOISE * rng.normal(size=days) + shared
            found.append(series("row_offset", (i, k), f"car{vehicle}", level, signed=True))
    return found


def named(comparisons):
    return [one for one in drifts(comparisons, lambda _: 0.0) if one.named]


def who(found):
    return {(one.name.vehicle, one.name.sensors) for one in found}


def test_a_fleet_without_drift_gives_no_more_alarms_than_is_said():
    rng = np.random.default_rng(1)
    alarms = sum(bool(named(fleet(rng, season=0.3))) for _ in range(60))
    assert DRIFT.false_alarms == 0.01
    assert alarms <= 3, "of 60 nights: four or more have a chance of 0.3 %"


def test_days_that_resemble_each_other_give_no_more_alarms():
    rng = np.random.default_rng(2)

    def level():
        known = [rng.normal()]
        for _ in range(DAYS - 1):
            known.append(0.5 * known[-1] + np.sqrt(0.75) * rng.normal())
        return known

    alarms = 0
    for _ in range(30):
        some = [series("added_light", (s,), f"car{v}", level()) for v in range(6) for s in (1, 2, 3)]
        alarms += bool(named(some))
    assert alarms <= 2


def test_days_of_two_levels_in_one_of_the_sensors_give_no_more_alarms():
    rng, days, alarms = np.random.default_rng(6), 30, 0
    for _ in range(12):
        some = []
        for vehicle in range(12):
            for sensor in (1, 2, 3):
                level = 0.2 * rng.normal(size=days) + 2.0 * (rng.random(days) < 0.5) * (sensor == 2)
                some.append(series("removed_light", (sensor,), f"car{vehicle}", level))
        alarms += bool(named(some))
    assert alarms <= 1, "half of the evenings, where the days of all sensors are taken for alike"


def test_few_days_of_two_levels_give_hardly_more_alarms():
    rng, alarms = np.random.default_rng(8), 0
    for _ in range(40):
        some = []
        for vehicle in range(12):
            day = np.flatnonzero(rng.random(60) < 0.14)
            level = 1.0 * (rng.random(len(day)) < 0.2) + NOISE * rng.normal(size=len(day))
            some.append(series("coloured_light", (3,), f"car{vehicle}", level, day=day))
        alarms += bool(named(some))
    assert alarms <= 4, "twice as many, where each vehicle's own days say how rough days are"


def test_a_camera_that_turns_is_named_alone_before_its_frames_are_raised():
    px = 0.02 * 12.6  # of 0.02 degrees at a focal length of 722 px
    rng, first = np.random.default_rng(3), DAYS - 5
    found = named(fleet(rng, turned=[((2, 1), px, first)]))
    assert px * (DAYS - 1 - first) < RAISED_FROM["row_offset"]
    assert who(found) == {("car2", (1,))}
    [one] = found
    assert one.trending
    assert one.per_day == pytest.approx(px, rel=0.3)
    assert one.changes[-1].on_day == pytest.approx(first, abs=2)


def test_days_left_are_those_until_the_tilt_that_frames_are_raised_at():
    rng = np.random.default_rng(4)
    comparisons = [series("row_offset", (1,), f"car{v}", NOISE * rng.normal(size=30)) for v in range(5)]
    comparisons.append(series("row_offset", (1,), "turning", 0.05 * np.arange(30) + NOISE * rng.normal(size=30)))
    [one] = named(comparisons)
    assert one.name.vehicle == "turning"
    assert one.days_left == pytest.approx((2.0 - 1.45) / 0.05, abs=3)


def test_a_visit_to_a_workshop_is_a_change_on_its_day_with_the_levels_beside_it():
    rng = np.random.default_rng(5)
    visited = np.where(np.arange(DAYS) < 25, 1.0, 0.2) + NOISE * rng.normal(size=DAYS)
    steady = [series("brightness", (1,), f"car{v}", NOISE * rng.normal(size=DAYS)) for v in range(5)]
    [one] = named([*steady, series("brightness", (1,), "visited", visited)])
    [change] = one.changes
    assert (change.after_day, change.on_day) == (24, 25)
    assert (change.before, change.now) == (pytest.approx(1.0, abs=0.1), pytest.approx(0.2, abs=0.1))
    assert change.chance < DRIFT.false_alarms
    assert not one.trending, "it does not drift since"


def test_a_camera_that_turned_and_was_put_right_has_changed_and_drifts_no_longer():
    rng, day = np.random.default_rng(6), np.arange(DAYS)
    level = np.where(day < 30, 0.05 * day, 0.0) + NOISE * rng.normal(size=DAYS)
    steady = [series("row_offset", (1,), f"car{v}", NOISE * rng.normal(size=DAYS)) for v in range(5)]
    [one] = named([*steady, series("row_offset", (1,), "turned", level)])
    assert one.changes[-1].on_day == 30
    assert not one.trending


def test_one_odd_day_is_no_change():
    rng = np.random.default_rng(7)
    snow = NOISE * rng.normal(size=DAYS)
    snow[20] += 5.0
    steady = [series("added_light", (1,), f"car{v}", NOISE * rng.normal(size=DAYS)) for v in range(5)]
    assert "snow" not in {one.name.vehicle for one in named([*steady, series("added_light", (1,), "snow", snow)])}


def test_a_season_of_all_vehicles_is_no_drift_of_one():
    rng = np.random.default_rng(8)
    season = np.linspace(0, 3, DAYS)

    def of(vehicles):
        return [series("texture", (1,), f"car{v}", season + NOISE * rng.normal(size=DAYS)) for v in range(vehicles)]

    assert not named(of(3))
    assert not named(of(1)), "one level alone cannot tell drift from days that resemble each other"


def test_two_cameras_that_are_compared_with_each_other_alone_are_both_named():
    rng = np.random.default_rng(9)
    steady = [series("row_offset", (1, 2), f"car{v}", NOISE * rng.normal(size=DAYS), signed=True) for v in range(5)]
    level = 0.1 * np.arange(DAYS) + NOISE * rng.normal(size=DAYS)
    found = named([*steady, series("row_offset", (1, 2), "turned", level, signed=True)])
    assert who(found) == {("turned", (1,)), ("turned", (2,))}
    slopes = {one.name.sensors: one.per_day for one in found}
    assert slopes[1,] == pytest.approx(-slopes[2,])


def test_too_few_days_and_levels_that_never_differ_are_no_drift():
    assert drifts([series("returns", (0,), "car", [1.0, 2.0, 3.0])], lambda _: 0.0) == []
    flat = [series("returns", (0,), f"car{v}", np.ones(20)) for v in range(3)]
    assert [one.named for one in drifts(flat, lambda _: 0.0)] == [False] * 3


def test_vehicles_that_drove_on_different_days_are_compared_where_enough_did():
    rng = np.random.default_rng(10)
    day = [np.sort(rng.choice(60, size=30, replace=False)) for _ in range(6)]
    some = [series("returns", (0,), f"car{v}", 9 + NOISE * rng.normal(size=30), day=day[v]) for v in range(6)]
    assert not named(some)


@pytest.mark.parametrize("check", list(Check))
def test_what_is_less_than_anybody_is_concerned_about_is_not_named(check):
    rng, least = np.random.default_rng(5), LEAST_DEVIATIONS.of
    some = [series(check.value, (1,), f"car{number}", rng.normal(0, 1e-6, DAYS)) for number in range(5)]
    some[0].level[20:] += 1e-3
    assert named(some), "it is named where any deviation is believed"
    assert not [one for one in drifts(some, least) if one.named]
