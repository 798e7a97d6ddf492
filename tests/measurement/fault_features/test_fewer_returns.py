"""Scans with far fewer returns than those just before."""

import numpy as np
import pytest

from auditor.measurement import FewerReturns
from auditor.measurement.warning_parameters import FEWER_RETURNS
from auditor.model.arrays import Floats, Points
from auditor.model.frames import Frame, PointCloud
from auditor.model.rig import LIDAR

PERIOD_NS = 100_000_000
COUNT, FROM = 30, 12


def around(number: int) -> Points:
    """A scan all around, from 5 to 60 m, which differs from the next one."""
    random = np.random.default_rng(number)
    azimuth, elevation = random.uniform(-np.pi, np.pi, 60_000), np.radians(random.uniform(-20, 10, 60_000))
    away_m = random.uniform(5, 60, 60_000)
    across = away_m * np.cos(elevation)
    return np.stack([across * np.cos(azimuth), across * np.sin(azimuth), away_m * np.sin(elevation)], axis=1).astype(
        "f4"
    )


def azimuth_deg(xyz_m: Points) -> Floats:
    return np.degrees(np.arctan2(xyz_m[:, 1], xyz_m[:, 0])) % 360


def elevation_deg(xyz_m: Points) -> Floats:
    return np.degrees(np.arctan2(xyz_m[:, 2], np.hypot(xyz_m[:, 0], xyz_m[:, 1])))


def watched(lost, *, numbers=range(FROM, COUNT), period_ns=PERIOD_NS, count=COUNT) -> FewerReturns:
    """A recording in whose scans of these numbers the points of a mask are missing."""
    fewer = FewerReturns()
    frames = []
    for number in range(count):
        xyz_m = around(number)
        xyz_m = xyz_m[~lost(xyz_m)] if number in numbers else xyz_m
        stamp_ns = 10**18 + number * period_ns
        frames.append(Frame(number, stamp_ns, {}, PointCloud(stamp_ns, xyz_m), {}))
    assert [*fewer.watch(frames)] == frames
    return fewer


@pytest.mark.parametrize(
    ("lost", "where"),
    [
        (lambda p: (azimuth_deg(p) > 90) & (azimuth_deg(p) < 270), "from about 88 to 272 degrees"),
        (lambda p: (azimuth_deg(p) > 315) | (azimuth_deg(p) < 60), "from about 316 to 60 degrees"),
        (lambda p: np.abs(azimuth_deg(p) - 6) < 7.5, "from about 0 to 12 degrees"),
        (lambda p: np.arange(len(p)) % 2 == 0, "left in all"),
        (lambda p: np.linalg.norm(p, axis=1) > 20, "beyond 20 m"),
        (lambda p: np.abs(elevation_deg(p) + 3) < 1, "-4 to -2 degrees above the horizon"),
    ],
    ids=["behind", "ahead", "a narrow sector", "half of all", "far away", "a band of beams"],
)
def test_what_vanishes_at_once_is_counted_from_its_first_scan_on_and_told(lost, where):
    fewer = watched(lost)
    assert fewer.counts == {LIDAR: COUNT - FROM}
    assert fewer.first[LIDAR].startswith("from 1.2 s on ")
    assert where in fewer.first[LIDAR]


def test_scans_count_until_the_returns_are_there_again():
    assert watched(lambda p: p[:, 0] < 0, numbers=range(FROM, FROM + 8)).counts == {LIDAR: 8}


def test_what_goes_bit_by_bit_is_no_loss():
    fewer = FewerReturns()
    frames = (
        Frame(n, n * PERIOD_NS, {}, PointCloud(n * PERIOD_NS, around(n)[: 60_000 - 900 * n]), {}) for n in range(1, 50)
    )
    assert len([*fewer.watch(frames)]) == 49
    assert (fewer.counts, fewer.first) == ({}, {})


def test_dark_paint_in_a_sector_and_a_few_lost_scans_are_no_loss():
    assert watched(lambda p: (np.abs(azimuth_deg(p) - 80) < 10) & (np.arange(len(p)) % 3 > 0)).counts == {}
    assert watched(lambda p: p[:, 0] < 0, numbers=range(FROM, FROM + FEWER_RETURNS.scans - 1)).counts == {}


def test_scans_that_are_far_apart_are_not_compared():
    assert watched(lambda p: p[:, 0] < 0, period_ns=PERIOD_NS * 5).counts == {}
