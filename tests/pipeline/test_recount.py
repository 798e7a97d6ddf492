"""What a scan keeps of a frame is enough to work out its statistics without the images, and to judge by them."""

from decimal import Decimal

import numpy as np
import pytest

from auditor.cli import run
from auditor.errors import StoreError
from auditor.identification import statistics
from auditor.model.checks import LIDAR_CHECKS, Check, rig_sensor_checks
from auditor.model.pictures import CellRetention
from auditor.pipeline.clean_frames import statistics_from_cells
from auditor.pipeline.judge import Criteria, judge_measurement
from auditor.pipeline.measure import measure_recording
from auditor.pipeline.measured import MeasureTask
from auditor.store.queries import run_sql
from auditor.store.store import Store
from tests.making.calibrations import calibrate
from tests.making.small_drives import write_drive

FRAMES = 4


@pytest.fixture(scope="module")
def scanned(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scanned")
    drive = write_drive(folder / "drive.mcap", count=FRAMES, seed=1, attacked={1: range(2, FRAMES)})
    measured = measure_recording(MeasureTask(drive, folder / "audit", cells=CellRetention.ALL), lambda what, done: None)
    return Store.open(folder / "audit"), measured.measurement_ids[0]


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
    for name in ("CONFLICT_WINDOW", "CAMERA_WINDOW"):
        monkeypatch.setattr(statistics, name, window)


def judged(store, measurement, *, recount):
    """A judgement of the attacked frames by the clean ones, and its verdicts."""
    clean = calibrate([(store, measurement)], range(2), recount=recount)
    judgement = judge_measurement(store, measurement, clean, Criteria(Decimal("0.01"), recount=recount))
    sql = f"SELECT kind, gap, evidence FROM verdicts WHERE judgement_id = '{judgement.judgement_id}' ORDER BY frame"
    return judgement, run_sql(store, sql).to_pylist()


def checks(verdicts):
    return {evidence["check_name"] for verdict in verdicts for evidence in verdict["evidence"]}


def test_a_recounted_judgement_in_the_same_windows_has_the_same_verdicts_and_says_that_it_was_recounted(scanned):
    store, measurement = scanned
    (plain, as_measured), (again, recounted) = (judged(store, measurement, recount=r) for r in (False, True))
    assert recounted == as_measured
    assert plain.judgement_id != again.judgement_id
    assert (plain.recounted, again.recounted) == (False, True)
    assert store.current_judgements()[measurement] == again


def test_a_recounted_judgement_in_other_windows_has_other_verdicts_and_leaves_what_was_measured(scanned, monkeypatch):
    store, measurement = scanned
    before, (_, as_measured) = store.load_statistics(measurement).statistics, judged(store, measurement, recount=False)
    assert "photometric_inconsistency" in checks(as_measured)
    in_windows(monkeypatch, statistics.Window(6, 8, 10**8, 200))
    assert not checks(judged(store, measurement, recount=True)[1]) & {"photometric_inconsistency", "added_light"}
    assert judged(store, measurement, recount=False)[1] == as_measured
    np.testing.assert_array_equal(store.load_statistics(measurement).statistics, before)


def test_the_command_line_recounts_and_refuses_to_by_the_papers_method(scanned, capfd):
    store, measurement = scanned
    folder = str(store.folder)
    assert (
        run(["calibrate", str(store.folder.parent / "drive.mcap"), "--store", folder, "--frames", "0:2", "--recount"])
        == 0
    )
    assert run(["judge", folder, "-r", "0.01", "--recount"]) == 1, "its last frames are attacked"
    assert store.current_judgements()[measurement].recounted
    assert run(["judge", folder, "-r", "0", "--recount", "--method", "paper"]) == 2
    assert "--recount: the paper's method has no statistics that come from cells" in capfd.readouterr().err


def test_what_is_the_same_without_the_lidar_is_so_recounted(scanned, monkeypatch):
    store, measurement = scanned
    stored = store.load_statistics(measurement)
    sensor_checks = rig_sensor_checks(store.rig(store.measurement(measurement).rig_id))
    in_windows(monkeypatch, statistics.Window(2, 2, 10, 10))
    [clean] = calibrate([(store, measurement)], recount=True).clean
    others = np.isfinite(stored.unmasked) & (stored.unmasked != stored.statistics)
    assert clean.unmasked.keys() == {one for one, other in zip(sensor_checks, others.any(axis=0), strict=True) if other}


@pytest.mark.parametrize(("cells", "kept"), [(CellRetention.ALL, {0, 1, 2, 3}), (CellRetention.INCIDENTS, {0, 2, 3})])
def test_cells_that_are_left_out_change_no_statistic_and_are_missed_by_a_recount(scanned, tmp_path, cells, kept):
    store, measurement = scanned
    drive = store.folder.parent / "drive.mcap"
    [same] = measure_recording(MeasureTask(drive, tmp_path / "audit", cells=cells), lambda *_: None).measurement_ids
    fewer = Store.open(tmp_path / "audit")
    assert {frame for frame, _ in fewer.load_cells(same)} == kept
    assert fewer.source("frames", same).path.read_bytes() == store.source("frames", measurement).path.read_bytes()
    if cells is CellRetention.ALL:
        np.testing.assert_array_equal(statistics_from_cells(fewer, same), statistics_from_cells(store, measurement))
        return
    with pytest.raises(StoreError, match=f"of {FRAMES - len(kept)} frames no cells were kept"):
        statistics_from_cells(fewer, same)
