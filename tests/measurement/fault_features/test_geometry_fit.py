"""Points and images of real drives that fit somewhere, whatever is attacked, and such that fit nowhere."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from auditor.model.frames import Frame
from auditor.model.rig import Rig
from tests.benchmarks.geometry_fit import ATTACKS, FAULTS, withheld
from tests.benchmarks.real_drives import frames
from tests.making.wrong_rigs import CASES as WRONG_RIGS
from tests.making.wrong_rigs import cameras, turned


@pytest.fixture(scope="module")
def some(real_data: Path) -> tuple[Rig, list[Frame]]:
    rig, stream = frames("0009")
    return rig, [next(stream)]


@pytest.mark.parametrize("case", ["as it is", "LiDAR yaw 1 deg", "LiDAR pitch 0.5 deg", "S_1 yaw 0.5 deg"])
def test_a_rig_that_fits_somewhere_is_judged(some: tuple[Rig, list[Frame]], case: str) -> None:
    assert withheld(WRONG_RIGS[case], *some)[0] == ""


@pytest.mark.parametrize("case", ATTACKS)
def test_an_attack_on_every_frame_withholds_nothing(some: tuple[Rig, list[Frame]], case: str) -> None:
    assert withheld(ATTACKS[case], *some)[0] == ""


@pytest.mark.parametrize("case", FAULTS)
def test_points_that_fit_nowhere_withhold_all_verdicts(some: tuple[Rig, list[Frame]], case: str) -> None:
    why, _ = withheld(FAULTS[case], *some)
    assert f"with {case}, and not as they are" in why if "negated" in case else "fit the images nowhere" in why


def test_a_wrong_baseline_withholds_all_verdicts(some: tuple[Rig, list[Frame]]) -> None:
    assert "fit the images nowhere" in withheld(WRONG_RIGS["baselines x 2"], *some)[0]


def test_of_two_cameras_one_that_turned_is_named_beside_the_points(some: tuple[Rig, list[Frame]]) -> None:
    rig, [frame] = some
    two = Rig(rig.lidar, tuple(replace(rig.camera(number), number=number - 1) for number in (2, 3)))
    pair = replace(frame, images={number - 1: frame.images[number] for number in (2, 3)})
    why, _ = withheld(cameras([1], turn=turned(0.25, 0.25, 0.25)), two, [pair])
    names = f"{two.camera(1).name} and {two.camera(2).name}"
    assert re.match(rf"the images of {names} are off by \d\.\d rows, and the points of the LiDAR .* nowhere", why), why
