"""Whom the checks of several LiDARs name."""

import numpy as np
import pytest

from auditor.identification.naming import name_attacked
from auditor.identification.systems import System
from auditor.model.checks import Check, SensorCheck, rig_sensor_checks
from auditor.model.verdict import Verdict, VerdictKind
from tests.making.several_lidars import BUMPER, REAR, ROOF, rig_of

LIMIT = 3.0


def verdict(lidars: int, found: dict[SensorCheck, float], *, missing: frozenset[int] = frozenset()) -> Verdict:
    """The verdict on a frame in which some checks have a z, and the others 0."""
    rig = rig_of(*(ROOF, REAR, BUMPER)[:lidars])
    system = System(rig_sensor_checks(rig), rig.triples, rig.sensors, rig.fallback)
    z = np.array([[np.nan if missing & {*one.needed} else found.get(one, 0.0) for one in system.sensor_checks]])
    [one] = name_attacked(z, system, [missing], LIMIT)
    return one


def contested(sensor: int, *others: int) -> SensorCheck:
    return SensorCheck(Check.CONTESTED_RETURNS, sensor, others)


def by_own_past(sensor: int) -> SensorCheck:
    return SensorCheck(Check.FREE_SPACE_CONFLICT, sensor, ())


@pytest.mark.parametrize("sensor", [0, 1])
def test_two_that_contradict_each_other_are_both_candidates_first_the_one_whose_points_are_contested(
    sensor: int,
) -> None:
    one = verdict(2, {contested(sensor, 1 - sensor): 6.0})
    assert (one.kind, one.attacked) == (VerdictKind.UNIDENTIFIED, ())
    assert [other.attacked for other in one.alternatives[:2]] == [(sensor,), (1 - sensor,)]
    assert [(said.i, said.k) for said in one.evidence] == [(sensor, 1 - sensor)]
    assert one.gap == pytest.approx(6.0 - LIMIT)


@pytest.mark.parametrize("sensor", [0, 1])
def test_its_own_past_names_one_of_two(sensor: int) -> None:
    one = verdict(2, {contested(sensor, 1 - sensor): 6.0, by_own_past(sensor): 6.0})
    assert (one.kind, one.attacked) == (VerdictKind.ATTACKED, (sensor,))


@pytest.mark.parametrize("sensor", [0, 1, 2])
def test_two_others_that_agree_name_the_third(sensor: int) -> None:
    others = tuple(sorted({0, 1, 2} - {sensor}))
    found = {contested(sensor, *others): 6.0} | {contested(sensor, other): 6.0 for other in others}
    assert verdict(3, found).attacked == (sensor,)


def test_one_other_of_two_names_nobody() -> None:
    assert verdict(3, {contested(0, 1): 6.0}).kind is VerdictKind.UNIDENTIFIED


def test_without_the_first_lidar_the_others_are_judged() -> None:
    one = verdict(3, {contested(1, 2): 6.0, by_own_past(1): 6.0}, missing=frozenset({0}))
    assert (one.attacked, one.reason) == ((1,), "judged without S_0")


def test_lidars_that_agree_are_clean() -> None:
    assert verdict(2, {}).kind is VerdictKind.CLEAN
