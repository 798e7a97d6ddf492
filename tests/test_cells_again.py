"""What a scan keeps of a frame is enough to work out its local ratios without the images."""

import numpy as np
import pytest

from auditor.elements import Witness, rig_elements
from auditor.identification import local_ratio
from auditor.judging import ratios_from_cells
from auditor.pipeline import MeasureTask, measure_recording
from auditor.store import Store
from tests.small_drives import write_drive

FRAMES = 4


@pytest.fixture(scope="module")
def scanned(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scanned")
    drive = write_drive(folder / "drive.mcap", count=FRAMES, seed=1, attacked={1: range(2, FRAMES)})
    measured = measure_recording(MeasureTask(drive, folder / "audit"), lambda what, done: None)
    return Store.open(folder / "audit"), measured.measurement_ids[0]


def test_local_ratios_from_stored_cells_are_those_that_the_scan_stored(scanned):
    store, measurement = scanned
    stored = store.load_ratios(measurement).ratios
    elements = rig_elements(store.rig(store.measurement(measurement).rig_id))
    assert stored.shape == (FRAMES, len(elements))
    # The rightmost camera is attacked in the last frames, and what it sees is like nothing any more.
    unlike = [place for place, e in enumerate(elements) if e.witness is Witness.UNLIKE and e.i == 1]
    assert (stored[2:, unlike] > stored[:2, unlike].max()).all()
    np.testing.assert_array_equal(ratios_from_cells(store, measurement), stored)


def test_other_windows_give_other_local_ratios_of_what_has_cells_and_of_nothing_else(scanned, monkeypatch):
    store, measurement = scanned
    stored = store.load_ratios(measurement).ratios
    smaller = {witness: local_ratio.Window(2, 2, 10) for witness in local_ratio.WINDOWS}
    monkeypatch.setattr(local_ratio, "WINDOWS", smaller)
    changed = ratios_from_cells(store, measurement)
    elements = rig_elements(store.rig(store.measurement(measurement).rig_id))
    counted = np.array([element.witness in smaller for element in elements])
    assert (changed[:, counted] != stored[:, counted]).any()
    np.testing.assert_array_equal(changed[:, ~counted], stored[:, ~counted])
