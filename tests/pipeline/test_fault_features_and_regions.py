"""What a scan keeps of a frame says whether a fault may lie behind it, and which portion of a sensor was damaged."""

import numpy as np

from auditor.pipeline.measure import measure_recording
from auditor.pipeline.measured import MeasureTask
from auditor.store.store import Store
from tests.making.small_drives import write_drive


def test_a_scan_keeps_fault_features_of_every_frame_and_the_regions_of_damaged_sensors(tmp_path):
    positions_m = (0.6, 0.3, 0.0)
    attacked = {1: range(2, 4), 0: range(4, 6)}
    drive = write_drive(tmp_path / "drive.mcap", count=6, seed=1, positions_m=positions_m, attacked=attacked)
    measured = measure_recording(MeasureTask(drive, tmp_path / "audit"), lambda what, done: None)
    store, [known] = Store.open(tmp_path / "audit"), measured.measurement_ids
    seen = store.load_fault_features(known)
    assert (seen.pairs, seen.cameras) == (((1, 3), (2, 3), (1, 2)), (1, 2, 3))
    assert len(seen.columns["agreeing"]) == 6
    assert (seen.columns["agreeing"][:2] > 0.8).all()
    assert (seen.brightness["level"][2:4, 0] > seen.brightness["level"][2:4, 2] + 60).all()
    assert np.isnan(seen.columns["before_only"][0]).all()
    assert [[r.sensor for r in store.load_regions(known, n)] for n in range(2)] == [[], []]
    for frame in (2, 3):
        [region] = [r for r in store.load_regions(known, frame) if r.sensor == 1]
        assert region.view == 1
        assert region.share > 0.5
        assert region.box_px[0] > 20
    for frame in (4, 5):
        [region] = store.load_regions(known, frame)
        assert (region.sensor, region.view) == (0, 3)
        assert region.share > 0.8
        # All points stand at 0.45 of their distance.
        assert abs(region.solid.centre_m[0] - 0.45 * (15 - 9 * frame / 6)) < 0.1
