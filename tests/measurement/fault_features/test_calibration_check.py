"""Rigs that fit real recordings, and rigs that do not."""

import re
from dataclasses import replace
from itertools import islice, pairwise
from math import nan
from pathlib import Path

import numpy as np
import pytest

from auditor.lab.attacks.paper import Facula
from auditor.measurement import CalibrationMonitor, FaultFeatures, measure_stream
from auditor.measurement.disparity.matchers import find_matcher
from auditor.measurement.fault_features.calibration_check import lags
from auditor.model.fault_features import PairFaultFeatures, RowMatches
from auditor.model.frames import Frame, PointCloud
from auditor.model.rig import LIDAR, Rig
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
    rig, clean = some
    warnings = warnings_of(CASES[case], rig, clean[:1])
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


def late(frames: list[Frame], sensor: int) -> list[Frame]:
    """The frames without the first, with what one sensor had in the frame before."""
    shown = []
    for before, frame in pairwise(frames):
        if sensor == LIDAR:
            shown.append(replace(frame, cloud=before.cloud))
        else:
            shown.append(replace(frame, images={**frame.images, sensor: before.images[sensor]}))
    return shown


@pytest.mark.parametrize("sensor", [LIDAR, 1, 3])
def test_a_sensor_that_is_late_in_most_frames_withholds_verdicts(real_data: Path, sensor: int) -> None:
    rig, stream = frames("0009")
    clean = list(islice(stream, 7))
    in_most = [*late(clean, sensor)[:5], *clean[6:]]
    said = f"{rig.name(sensor)} fit what the other sensors have of the frame before their own"
    assert said in withheld_of(rig, in_most)


def test_a_sensor_that_is_late_in_some_frames_withholds_nothing(real_data: Path) -> None:
    rig, stream = frames("0009")
    clean = list(islice(stream, 7))
    assert withheld_of(rig, [*clean[:4], *late(clean, LIDAR)[4:]]) == ""


def withheld_of(rig: Rig, frames: list[Frame]) -> str:
    check, features = CalibrationMonitor(), FaultFeatures()
    for _, arrays in measure_stream(frames, rig, find_matcher("sgbm")):
        check.offer(arrays, features.update(arrays))
    return check.withheld()


def test_a_sensor_lags_by_the_least_that_a_pair_of_it_says() -> None:
    def pair(now: float, lagged_i: float, lagged_k: float) -> PairFaultFeatures:
        return PairFaultFeatures(RowMatches(row_aligned=now, lagged_i=lagged_i, lagged_k=lagged_k))

    found = lags({(1, 3): pair(0.2, 0.9, 0.1), (2, 3): pair(0.9, 0.2, 0.3), (1, 2): pair(0.3, 0.8, nan)})
    assert found == pytest.approx({LIDAR: nan, 1: 0.5, 2: -0.7, 3: -0.6}, nan_ok=True)


@pytest.mark.parametrize(("reach_m", "said"), [((0, 25), True), ((7, 200), True), ((4, 40), False)])
def test_clouds_that_are_cropped_by_distance_are_said(
    some: tuple[Rig, list[Frame]], reach_m: tuple[float, float], said: bool
) -> None:
    rig, clean = some
    cropped = [replace(frame, cloud=within(frame.cloud, *reach_m)) for frame in clean if frame.cloud]
    assert ("do not reach as near, or as far" in " ".join(checked(CASES["as it is"], rig, cropped).remarks())) == said


def within(cloud: PointCloud, nearest_m: float, farthest_m: float) -> PointCloud:
    range_m = np.linalg.norm(cloud.xyz_m, axis=1)
    return replace(cloud, xyz_m=cloud.xyz_m[(range_m > nearest_m) & (range_m < farthest_m)])


def test_clouds_that_are_rounded_coarsely_are_said(some: tuple[Rig, list[Frame]]) -> None:
    rig, clean = some
    for step_m, said in ((0.1, True), (0.05, False)):
        rounded = [
            replace(frame, cloud=replace(frame.cloud, xyz_m=np.round(frame.cloud.xyz_m / step_m) * np.float32(step_m)))
            for frame in clean
            if frame.cloud
        ]
        assert ("are rounded so coarsely" in " ".join(checked(CASES["as it is"], rig, rounded).remarks())) == said
