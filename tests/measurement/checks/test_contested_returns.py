"""What one LiDAR shows where another one's beams passed."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from auditor.lab.attacks.paper import BogusWall
from auditor.lab.attacks.spoofing import GhostCar
from auditor.lab.simulation.vehicles import rotation
from auditor.measurement.lidars_alone import LidarsAlone
from auditor.model.checks import Check, SensorCheck
from auditor.model.frames import Frame
from auditor.model.optics.geometry import motion
from auditor.model.rig import Rig
from tests.making.several_lidars import BUMPER, REAR, ROOF, attacked, rig_of, split_by_rings, street

FRAMES = 4
BY_EACH_OTHER = SensorCheck(Check.CONTESTED_RETURNS, 0, (1,)), SensorCheck(Check.CONTESTED_RETURNS, 1, (0,))

NOTHING = [(None, None), *[(0.0, 0.0)] * (FRAMES - 1)]
"""Of the first frame nobody knows how the vehicle moves."""


@pytest.fixture(scope="module", params=[(ROOF, REAR), (ROOF, BUMPER)], ids=["roof", "bumper"])
def drive(request: pytest.FixtureRequest) -> tuple[Rig, list[Frame]]:
    return rig_of(*request.param), list(street(request.param, 46001, FRAMES))


def said(rig: Rig, frames: Iterable[Frame]) -> list[tuple[float | None, float | None]]:
    """What each frame says of the first and of the second LiDAR; None where it could not be told."""
    return [(one.get(BY_EACH_OTHER[0]), one.get(BY_EACH_OTHER[1])) for one in shares(rig, frames)]


def shares(rig: Rig, frames: Iterable[Frame]) -> Iterator[dict[SensorCheck, float | None]]:
    several = LidarsAlone(rig)
    return (several.compare(frame).shares for frame in frames)


def test_clean_lidars_contest_nothing_of_each_other(drive: tuple[Rig, list[Frame]]) -> None:
    assert said(*drive) == NOTHING


@pytest.mark.parametrize("sensor", [0, 1])
def test_a_ghost_of_one_is_contested_by_the_other_in_every_frame(drive: tuple[Rig, list[Frame]], sensor: int) -> None:
    rig, frames = drive
    ghost = GhostCar(points=120, range_m=12.0)
    found = said(rig, (attacked(one, rig, sensor, ghost) for one in frames))
    assert all(one[sensor] and one[sensor] > 0.2 for one in found[1:])
    assert all(one[1 - sensor] == 0 for one in found[1:])


def test_a_wall_hides_nothing_from_the_lidar_that_does_not_see_it(drive: tuple[Rig, list[Frame]]) -> None:
    rig, frames = drive
    found = said(rig, (attacked(one, rig, 0, BogusWall(10.0, 0.0)) for one in frames))
    assert all(one[0] and one[0] > 0.6 and one[1] == 0 for one in found[1:])


def test_a_wire_and_a_post_are_contested_by_nobody(drive: tuple[Rig, list[Frame]]) -> None:
    """Beams pass beside what is thin."""
    rig, frames = drive
    lidar = rig.lidars[0].rig_SE3_lidar[:3, :3].T
    wire = np.stack([np.linspace(-1, 1, 40), np.full(40, 0.3), np.full(40, 9.0)])
    post = np.stack([np.full(40, 0.5), np.linspace(-0.5, 1.0, 40), np.full(40, 9.0)])
    for thing in (wire, post):
        points = (lidar @ thing).T.astype(np.float32)
        odd = [
            replace(one, cloud=replace(one.cloud, xyz_m=np.concatenate([one.cloud.xyz_m, points])))
            for one in frames
            if one.cloud
        ]
        assert said(rig, odd) == NOTHING


def test_what_the_other_does_not_see_is_not_contested(drive: tuple[Rig, list[Frame]]) -> None:
    """The other LiDAR returns nothing from ahead, as one that is covered there."""
    rig, frames = drive
    ghost = GhostCar(points=60, range_m=8.0)
    covered = [
        replace(one, others={1: replace(one.others[1], xyz_m=one.others[1].xyz_m[one.others[1].xyz_m[:, 0] < 0])})
        for one in frames
    ]
    assert said(rig, (attacked(one, rig, 0, ghost) for one in covered)) == NOTHING


def test_lidars_whose_places_do_not_fit_are_not_compared(drive: tuple[Rig, list[Frame]]) -> None:
    rig, frames = drive
    turned = motion(rotation(0.0, float(np.deg2rad(5)), 0.0), np.zeros(3)) @ rig.others[0].rig_SE3_lidar
    wrong = Rig(rig.lidar, (), (replace(rig.others[0], rig_SE3_lidar=turned),))
    assert said(wrong, frames) == [(None, None)] * FRAMES


def test_slightly_wrong_places_make_no_finding(drive: tuple[Rig, list[Frame]]) -> None:
    rig, frames = drive
    for degrees in (-2, -1, 1, 2):
        turned = motion(rotation(0.0, float(np.deg2rad(degrees)), 0.0), np.zeros(3)) @ rig.others[0].rig_SE3_lidar
        found = said(Rig(rig.lidar, (), (replace(rig.others[0], rig_SE3_lidar=turned),)), frames)
        assert {share for one in found for share in one} <= {None, 0.0}


def test_the_share_that_another_lidar_looked_at_is_told(drive: tuple[Rig, list[Frame]]) -> None:
    rig, frames = drive
    several = LidarsAlone(rig)
    before, both = (several.compare(frame).coverage for frame in frames[:2])
    assert [one.compared_share for one in before.values()] == [0, 0]
    assert all(0.05 < (one.compared_share or 0) < 0.6 and one.compared_by_two_share == 0 for one in both.values())
    [alone] = several.compare(replace(frames[2], others={})).coverage.values()
    assert alone.compared_share == 0


@pytest.mark.parametrize("name", ["kitti_raw_2011_09_26_drive_0009", "kitti_odometry_04"])
def test_real_scans_split_in_two_agree_and_a_ghost_in_one_is_contested(name: str, real_data: Path) -> None:
    rig, frames = split_by_rings(real_data / name, lambda rings: rings % 2 == 0)
    assert said(rig, frames) == [(None, None), *[(0.0, 0.0)] * (len(frames) - 1)]
    ghost = GhostCar(points=120, range_m=12.0)
    found = said(rig, (attacked(one, rig, 1, ghost) for one in frames[:6]))
    assert all(one[1] and one[1] > 0.2 and one[0] == 0 for one in found[1:])
