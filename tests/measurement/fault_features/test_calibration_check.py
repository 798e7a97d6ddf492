"""Rigs that fit real recordings, and rigs that do not."""

import re
from dataclasses import replace
from itertools import islice
from pathlib import Path

import pytest

from auditor.lab.attacks.paper import Facula
from auditor.model.frames import Frame
from auditor.model.rig import Rig
from tests.benchmarks.real_drives import frames
from tests.making.wrong_rigs import CASES, checked
from tests.making.wrong_rigs import warnings as warnings_of


@pytest.fixture(scope="module")
def some(real_data: Path) -> tuple[Rig, list[Frame]]:
    rig, stream = frames("0009")
    return rig, list(islice(stream, 0, 6, 5))


@pytest.mark.parametrize(
    ("case", "warning"),
    [
        ("as it is", None),
        ("LiDAR pitch 0.5 deg", "px lower: wrong LiDAR mounting"),
        ("LiDAR yaw 1 deg", "1[26] px left: wrong LiDAR mounting"),
        ("baselines x 2", "0.49 times the LiDAR's: wrong baseline"),
        ("S_1 pitch 0.25 deg", "off by 3.. rows: wrong rectification flag"),
        ("S_1 not rectified", "points on the same row: wrong rectification flag"),
        ("S_1 yaw 0.5 deg", "by camera_gray_right: is that camera rotated"),
    ],
)
def test_a_broken_geometry_has_a_warning_and_a_sound_one_has_none(
    some: tuple[Rig, list[Frame]], case: str, warning: str | None
) -> None:
    warnings = warnings_of(CASES[case], *some)
    if warning is None:
        assert warnings == ()
    else:
        assert len(warnings) == 1
        assert re.search(warning, warnings[0])


def test_a_thinned_cloud_is_said_not_to_be_looked_at_for_what_is_gone(some: tuple[Rig, list[Frame]]) -> None:
    rig, clean = some
    few = [replace(frame, cloud=replace(frame.cloud, xyz_m=frame.cloud.xyz_m[::8])) for frame in clean if frame.cloud]
    [remark] = checked(CASES["as it is"], rig, few).remarks()
    assert "lost returns and rough ranges are not measured" in remark
    assert checked(CASES["as it is"], rig, clean).remarks() == ()


def test_an_attack_on_two_frames_of_three_is_no_broken_geometry(some: tuple[Rig, list[Frame]]) -> None:
    rig, clean = some
    dazzled = [
        replace(frame, images={**frame.images, 3: Facula(2000, 375, 600, 180).apply(frame.images[3])})
        for frame in clean * 2
    ]
    assert warnings_of(CASES["as it is"], rig, dazzled)
    assert warnings_of(CASES["as it is"], rig, [clean[0], *dazzled[:2], clean[1], *dazzled[2:]]) == ()
