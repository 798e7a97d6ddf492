"""A LiDAR beside cameras is compared with its last scan on all sides: what no camera sees is found and shown."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from auditor.cli import run
from auditor.lab.simulation.drives import make_drive
from auditor.measurement import localise, measure_stream
from auditor.measurement.disparity.matchers import SgbmMatcher
from auditor.measurement.drawing import damaged_cloud
from auditor.measurement.frame import MeasuredFrame
from auditor.model.checks import Check, SensorCheck
from auditor.model.frames import Frame, PointCloud, SkippedFrame
from auditor.recordings import write_mcap
from auditor.store.store import Store
from auditor.store.tables import read_table

DRIVE = make_drive(7, 3, n_cameras=3, width_px=620, height_px=188)
ASIDE = np.radians(56)
PLACE_M = 5 * np.array([np.cos(ASIDE), np.sin(ASIDE)])
ACROSS = np.array([-np.sin(ASIDE), np.cos(ASIDE)])
BLOCK = np.array([(*(PLACE_M + w * ACROSS), z) for w in np.linspace(-0.8, 0.8, 24) for z in np.linspace(-1.0, 0.3, 10)])
"""Points of a thing to the left of the vehicle, beyond all pictures."""
AROUND, IN_VIEW = SensorCheck(Check.SURROUNDING_CONFLICT, 0, ()), SensorCheck(Check.FREE_SPACE_CONFLICT, 0, (3,))


@pytest.fixture(scope="module")
def frames() -> list[Frame]:
    return [frame for frame in DRIVE.frames() if frame.cloud is not None]


def ghost(frame: Frame) -> Frame:
    """The frame with the thing beside the vehicle."""
    assert frame.cloud is not None
    points = np.vstack([frame.cloud.xyz_m, BLOCK]).astype(np.float32)
    return replace(frame, cloud=PointCloud(frame.cloud.stamp_ns, points))


def last_of(frames: list[Frame]) -> MeasuredFrame:
    *_, last = measure_stream(frames, DRIVE.rig, SgbmMatcher())
    assert not isinstance(last, SkippedFrame)
    return last


def test_what_appears_where_no_camera_looks_conflicts_with_the_last_scan(frames: list[Frame]) -> None:
    measurement, _ = last_of([*frames[:-1], ghost(frames[-1])])
    assert measurement.shares[AROUND] > 0.5
    assert measurement.shares[IN_VIEW] == 0
    clean, _ = last_of(frames)
    assert clean.shares[AROUND] == clean.shares[IN_VIEW] == 0


def test_the_first_frame_has_no_last_scan(frames: list[Frame]) -> None:
    measurement, _ = last_of(frames[:1])
    assert AROUND not in measurement.shares


def test_it_is_a_solid_without_pixels_and_its_points_are_the_damaged_ones(frames: list[Frame]) -> None:
    beside = ghost(frames[-1])
    assert beside.cloud is not None
    _, arrays = last_of([*frames[:-1], beside])
    [region] = localise(arrays, (0,), DRIVE.rig)
    assert (region.sensor, region.view, region.mask) == (0, 0, b"")
    assert region.solid is not None
    assert region.solid.centre_m[:2] == pytest.approx(PLACE_M, abs=0.3)
    damaged = damaged_cloud(beside.cloud, DRIVE.rig, [region])
    assert damaged[-len(BLOCK) :].mean() > 0.9
    assert damaged[: -len(BLOCK)].mean() < 0.01


def test_a_store_with_things_that_no_camera_sees_is_as_it_was_written(frames: list[Frame], tmp_path: Path) -> None:
    write_mcap(tmp_path / "ghost.mcap", DRIVE.rig, [*frames[:-1], ghost(frames[-1])])
    store = tmp_path / "audit"
    assert run(["scan", str(tmp_path / "ghost.mcap"), "--store", str(store), "--jobs", "1", "--pictures", "none"]) != 2
    kept = Store.open(store)
    [measurement] = kept.measurements()
    views = read_table("regions", kept.source("regions", measurement.measurement_id), ["view"])
    assert 0 in views["view"].to_pylist()
    assert run(["verify", "--store", str(store)]) == 0
