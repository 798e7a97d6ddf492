"""Synthetic streets from images to verdicts: what a tilt, a camera that lags, rain and a wall are called."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest

from auditor.lab.attacks.faults import Rain
from auditor.lab.attacks.paper import BogusWall
from auditor.lab.simulation.drives import make_drive
from auditor.model.calibration import RobustThresholds
from auditor.model.frames import Frame
from auditor.model.rig import LIDAR, Rig
from auditor.model.verdict import Cause, Verdict, VerdictKind
from tests.benchmarks.lasting_faults import on, taken
from tests.benchmarks.measured_series import judged, learn, measured
from tests.making.matched_once import matched_once

FRAMES = 4
# Two vehicles, each with a street of its own; the LiDAR of the second lies well beside its calibration.
CALIBRATED_ON, TILTED = 1001, 1003


@dataclass(frozen=True, eq=False)
class Street:
    """The frames of a vehicle, and the thresholds from another one's clean frames."""

    rig: Rig
    frames: list[Frame]
    thresholds: RobustThresholds

    def verdicts(self, frames: Iterable[Frame]) -> list[Verdict]:
        """The verdicts on frames as they were changed."""
        return judged(measured(frames, self.rig), self.thresholds, self.rig)


@pytest.fixture(scope="module", autouse=True)
def _matched_once() -> Iterator[None]:
    """Whatever befalls the LiDAR, the cameras see the same."""
    with matched_once():
        yield


@pytest.fixture(scope="module")
def street() -> Street:
    one, other = (
        make_drive(seed, FRAMES, vehicle=seed, width_px=828, height_px=250) for seed in (CALIBRATED_ON, TILTED)
    )
    tilt = other.vehicle.lidar.tilt
    assert np.rad2deg(np.arccos((np.trace(tilt) - 1) / 2)) > 0.1
    return Street(other.rig, list(other.frames()), learn([measured(one.frames(), one.rig)], one.rig))


def test_a_lidar_that_has_always_been_a_little_tilted_is_no_finding(street: Street) -> None:
    assert {verdict.kind for verdict in street.verdicts(street.frames)} == {VerdictKind.CLEAN}


def test_a_camera_a_frame_behind_is_suspect_and_named(street: Street) -> None:
    late = [taken(frame, before, 1) for before, frame in pairwise(street.frames)]
    for verdict in street.verdicts(late)[1:]:
        assert verdict.kind is VerdictKind.SUSPECT
        assert verdict.causes[0][:2] == (Cause.LATE, 1)


def test_a_wall_is_an_attack_on_the_lidar(street: Street) -> None:
    walls = map(on(LIDAR, BogusWall(8.0, 0.0), street.rig), street.frames)
    assert {(verdict.kind, verdict.attacked) for verdict in street.verdicts(walls)} == {(VerdictKind.ATTACKED, (0,))}


def test_rain_is_named_and_no_finding_and_a_wall_in_it_is_an_attack(street: Street) -> None:
    rain = on(LIDAR, Rain(10, seed=1), street.rig)
    wet = list(map(rain, street.frames))
    for verdict in street.verdicts(wet):
        assert verdict.kind is VerdictKind.CLEAN
        assert verdict.causes[0][:2] == (Cause.RAIN, LIDAR)
    walls = map(rain, map(on(LIDAR, BogusWall(8.0, 0.0), street.rig), street.frames))
    for verdict in street.verdicts(walls):
        assert (verdict.kind, verdict.attacked) == (VerdictKind.ATTACKED, (0,))
        assert verdict.causes[0][:2] == (Cause.RAIN, LIDAR)
