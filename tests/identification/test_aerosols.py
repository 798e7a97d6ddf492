"""Dust beside attacks: what scatters names no sensor, and hides no other one."""

import numpy as np
import pytest

from auditor.identification.causes import of_aerosol
from auditor.identification.faults import weigh
from auditor.identification.incidents.events import series_of, windows_of
from auditor.identification.incidents.series import FrameSeries
from auditor.identification.robust import name_beside_aerosols
from auditor.identification.systems import System
from auditor.model.checks import Check, SensorCheck, sensor_checks_of
from auditor.model.rig import LIDAR, triples_of
from auditor.model.verdict import Cause, FaultHypothesis, Verdict, VerdictKind

LIMIT = 3.0
PAIRS = tuple((i, k) for k in range(2, 5) for i in range(1, k))
FOUR = System(sensor_checks_of(PAIRS, PAIRS, (4,)), triples_of(4, lidar=True), tuple(range(5)))


def verdict_of(*fired: tuple[Check, int, float], agreeing: float = np.nan) -> Verdict:
    """The verdict on a frame in which these checks of these sensors have a z and the others are quiet.

    Of the LiDAR's points a share is `agreeing` with the cameras.
    """

    def z_of(one: SensorCheck) -> float:
        return next((z for check, sensor, z in fired if (one.check, one.sensor) == (check, sensor)), -1.0)

    z = np.array([[z_of(one) for one in FOUR.sensor_checks]])
    return name_beside_aerosols(z, FOUR, [frozenset()], LIMIT, np.array([agreeing]))[0]


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


@pytest.mark.parametrize(("agreeing", "kind"), [(0.2, VerdictKind.ATTACKED), (0.6, VerdictKind.SUSPECT)])
def test_no_aerosol_explains_a_cloud_that_agrees_with_cameras_nearly_nowhere(
    agreeing: float, kind: VerdictKind
) -> None:
    verdict = verdict_of((Check.SCATTERED_RANGES, LIDAR, 8.0), (Check.FALSE_RANGES, LIDAR, 6.0), agreeing=agreeing)
    assert weigh(verdict, (), LIMIT, agreeing=agreeing).kind is kind
    beside = verdict_of(LIT, (Check.SCATTERED_RANGES, LIDAR, 8.0), agreeing=agreeing)
    assert (LIDAR in beside.attacked) == (kind is VerdictKind.ATTACKED)


def test_a_stretch_agrees_with_cameras_as_the_median_of_its_frames() -> None:
    stamps = np.arange(12) * 10**8
    here, runs = np.ones((12, 1), dtype=np.bool_), np.zeros(12, dtype=np.int64)
    series = FrameSeries(stamps, runs, np.zeros((12, 1)), here, ~here, agreeing=np.repeat([0.2, 0.8], [8, 4]))
    agreeing = series_of(series, windows_of(stamps, runs)).agreeing
    assert agreeing is not None
    assert agreeing.tolist() == [0.2] * len(agreeing)
