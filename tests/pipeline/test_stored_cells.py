"""What a scan keeps of a frame is enough to work out its statistics without the images."""

import numpy as np
import pytest

from auditor.identification import statistics
from auditor.model.checks import LIDAR_CHECKS, SHARE_CHECKS, Check, rig_sensor_checks
from auditor.pipeline.measure import measure_recording
from auditor.pipeline.measured import MeasureTask
from auditor.store import Store
from tests.making.small_drives import write_drive

FRAMES = 4


@pytest.fixture(scope="module")
def scanned(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scanned")
    drive = write_drive(folder / "drive.mcap", count=FRAMES, seed=1, attacked={1: range(2, FRAMES)})
    measured = measure_recording(MeasureTask(drive, folder / "audit"), lambda what, done: None)
    return Store.open(folder / "audit"), measured.measurement_ids[0]


def statistics_from_cells(store, measurement):
    """(F, M) statistics from the stored cells, as a scan computes them from the images."""
    sensor_checks = rig_sensor_checks(store.rig(store.measurement(measurement).rig_id))
    counted = [column for column, one in enumerate(sensor_checks) if one.check not in SHARE_CHECKS]
    of_cells = [sensor_checks[column] for column in counted]
    stored = store.load_statistics(measurement)
    found, row_of = stored.statistics.copy(), {frame: row for row, frame in enumerate(stored.frames.tolist())}
    for frame, cells in store.load_cells(measurement):
        found[row_of[frame], counted] = np.array(statistics.sensor_statistics(of_cells, cells, {}), dtype=np.float64)
    return found


def test_statistics_from_stored_cells_are_those_that_the_scan_stored(scanned):
    store, measurement = scanned
    stored = store.load_statistics(measurement).statistics
    sensor_checks = rig_sensor_checks(store.rig(store.measurement(measurement).rig_id))
    assert stored.shape == (FRAMES, len(sensor_checks))
    # The rightmost camera is attacked in the last frames, and what it sees is like nothing any more.
    inconsistent = [
        place
        for place, one in enumerate(sensor_checks)
        if one.check is Check.PHOTOMETRIC_INCONSISTENCY and one.sensor == 1
    ]
    assert (stored[2:, inconsistent] > stored[:2, inconsistent].max()).all()
    np.testing.assert_array_equal(statistics_from_cells(store, measurement), stored)


def test_other_windows_give_other_statistics_of_what_has_cells_and_of_nothing_else(scanned, monkeypatch):
    store, measurement = scanned
    stored = store.load_statistics(measurement).statistics
    in_windows(monkeypatch, statistics.Window(2, 2, 10, 10))
    changed = statistics_from_cells(store, measurement)
    sensor_checks = rig_sensor_checks(store.rig(store.measurement(measurement).rig_id))
    counted = np.array([one.check not in LIDAR_CHECKS for one in sensor_checks])
    assert (changed[:, counted] != stored[:, counted]).any()
    np.testing.assert_array_equal(changed[:, ~counted], stored[:, ~counted])


def in_windows(monkeypatch, window):
    """Make all statistics of cells in such windows."""
    for name in ("CONFLICT_WINDOW", "IMAGE_WINDOW"):
        monkeypatch.setattr(statistics, name, window)
