"""Dust beside attacks: what scatters names no sensor, and hides no other one."""

import numpy as np
import pytest

from auditor.identification.causes import of_aerosol
from auditor.identification.naming import name_beside_aerosols
from auditor.identification.systems import System
from auditor.model.checks import Check, SensorCheck, sensor_checks_of
from auditor.model.rig import LIDAR, triples_of
from auditor.model.verdict import Cause, FaultHypothesis, Verdict, VerdictKind

LIMIT = 3.0
PAIRS = tuple((i, k) for k in range(2, 5) for i in range(1, k))
FOUR = System(sensor_checks_of(PAIRS, PAIRS, (4,)), triples_of(4, lidar=True), tuple(range(5)))


def verdict_of(*fired: tuple[Check, int, float]) -> Verdict:
    """The verdict on a frame in which these checks of these sensors have a z and the others are quiet."""

    def z_of(one: SensorCheck) -> float:
        return next((z for check, sensor, z in fired if (one.check, one.sensor) == (check, sensor)), -1.0)

    z = np.array([[z_of(one) for one in FOUR.sensor_checks]])
    return name_beside_aerosols(z, FOUR, [frozenset()], LIMIT)[0]


LIT = (Check.ADDED_LIGHT, 2, 9.0)
DUST = FaultHypothesis(Cause.AEROSOL, LIDAR)


@pytest.mark.parametrize("scatters", [Check.SCATTERED_RANGES, Check.SCATTERED_RETURNS])
@pytest.mark.parametrize("z", [5.0, 12.0])
def test_a_lit_camera_beside_dust_is_named_alone(scatters: Check, z: float) -> None:
    verdict = verdict_of(LIT, (scatters, LIDAR, z))
    assert (verdict.kind, verdict.attacked) == (VerdictKind.ATTACKED, (2,))
    assert of_aerosol(verdict) == ()


def test_a_lit_camera_beside_a_wall_in_dust_is_named_with_the_lidar() -> None:
    verdict = verdict_of(LIT, (Check.FALSE_RANGES, LIDAR, 9.0), (Check.SCATTERED_RANGES, LIDAR, 5.0))
    assert verdict.attacked == (LIDAR, 2)


@pytest.mark.parametrize("beside", [-1.0, 4.0])
def test_dust_alone_is_an_aerosol_whatever_weaker_it_makes_fire(beside: float) -> None:
    verdict = verdict_of((Check.SCATTERED_RANGES, LIDAR, 6.0), (Check.ISOLATED_POINTS, LIDAR, beside))
    assert of_aerosol(verdict) == (DUST,)
    assert of_aerosol(verdict_of((Check.SCATTERED_RANGES, LIDAR, 3.5), (Check.ISOLATED_POINTS, LIDAR, 4.0))) == ()
    assert of_aerosol(verdict_of()) == ()
