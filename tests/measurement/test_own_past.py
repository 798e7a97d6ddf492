"""Which of its earlier pictures a lone camera is compared with."""

from collections import defaultdict
from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest

from auditor.lab.simulation.drives import make_drive
from auditor.measurement import measure, measure_stream, own_past
from auditor.measurement.checks.in_time.parallax_conflict import ParallaxComparison
from auditor.measurement.checks.lidar_conflict import VerifiedConflicts
from auditor.measurement.disparity.matchers import find_matcher
from auditor.measurement.frame import NOT_LOOKED_AT
from auditor.model.frames import Frame
from auditor.model.rig import Rig
from auditor.model.verdict import Statistic
from tests.making.recorded_drives import PERIOD_NS, START_NS, make_frame, make_rig

SGBM = find_matcher("sgbm")
RIG = make_rig(1)


def compared_with(stamps: list[int], speed_m_s: float) -> list[int | None]:
    """By frame how many periods ago the picture was that it was compared with, at a constant speed."""
    chosen: list[int | None] = []

    def parallax_conflicts(now, before, expected=None, long_ago=None):
        none = np.zeros(0, dtype=np.int32)
        apart_ns = None if before is None else now.stamp_ns - before.stamp_ns
        chosen.append(None if apart_ns is None else round(apart_ns / PERIOD_NS))
        moved_m = float("nan") if apart_ns is None else speed_m_s * apart_ns / 1e9
        return ParallaxComparison(VerifiedConflicts(none, none, none.astype(bool), none.astype(bool)), moved_m)

    frames = [make_frame(RIG, n, stamp_ns=START_NS + stamp * PERIOD_NS) for n, stamp in enumerate(stamps)]
    with (
        patch.object(own_past, "parallax_conflicts", parallax_conflicts),
        patch.object(own_past, "cells_of_points", lambda points, view: None),
        patch("auditor.measurement.frame.saturated_by_light", lambda cells, half_res: {}),
        patch("auditor.measurement.frame.looked_at", lambda cells, cameras, points: defaultdict(lambda: NOT_LOOKED_AT)),
    ):
        list(measure_stream(frames, RIG, SGBM))
    return chosen


def test_fast_the_frame_before_will_do_and_slowly_the_one_before_that():
    assert compared_with([0, 1, 2, 3, 4], 15.0) == [None, 1, 1, 1, 1]
    assert compared_with([0, 1, 2, 3, 4], 8.0) == [None, 1, 2, 2, 2]
    assert compared_with([0, 1, 2, 3, 4], 0.0) == [None, 1, 2, 2, 2]


def test_while_the_speed_is_not_known_it_is_the_frame_before():
    assert compared_with([0, 1, 2, 3], float("nan")) == [None, 1, 1, 1]


def test_pictures_from_before_a_gap_are_too_old():
    assert compared_with([0, 1, 2, 8, 9, 10], 8.0) == [None, 1, 2, None, 1, 2]
    assert compared_with([0, 1, 3, 4], 8.0) == [None, 1, 2, 3], "one frame was dropped"


def test_a_clock_that_is_set_back_begins_anew():
    assert compared_with([10, 11, 2, 3], 15.0) == [None, 1, None, 1]


@pytest.fixture(scope="module")
def drive() -> tuple[Rig, list[Frame]]:
    made = make_drive(2, 3, n_cameras=1, width_px=620, height_px=188)
    return made.rig, list(made.frames())


def test_one_frame_alone_has_no_past(drive):
    rig, frames = drive
    measured, arrays = measure(frames[1], rig, SGBM)
    assert measured.counts[0].disparity_error(Statistic.GATED) is None
    assert (arrays.maps, list(arrays.lidar)) == ({}, [1])


def test_a_frame_without_its_cloud_is_compared_with_nothing_and_the_next_with_the_one_before(drive):
    rig, frames = drive
    blind = replace(frames[1], cloud=None)
    first, second, third = (one[0] for one in measure_stream([frames[0], blind, frames[2]], rig, SGBM))
    assert second.counts == (None,)
    assert first.counts[0].gated_valid_px == 0
    assert third.counts[0].gated_valid_px > 100
