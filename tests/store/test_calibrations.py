from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest

from auditor.errors import StoreError, ThresholdsError
from auditor.model import calibration as model
from auditor.model.checks import CAMERA_CHECKS, rig_sensor_checks
from auditor.model.measurement import Statistic
from auditor.model.verdict import Cause
from auditor.store import calibrations, tables
from auditor.store.calibrations import OutdatedCalibrationError, make_calibration, read_calibration, write_calibration
from auditor.store.queries import run_sql
from auditor.store.schema import table_schema
from auditor.store.tables import write_rows
from tests.making.calibrations import clean_frames
from tests.making.stores import PROCEDURE, make_rig, new_store

RIG = make_rig(4)
SAMPLES = {(s, t): [0.1 * n / 3 + t.i / 7 for n in (3, 1, 2)] for t in RIG.triples for s in Statistic}


STATISTICS = {check: [0.3, 0.2, 0.1] for check in rig_sensor_checks(RIG)}
STRENGTHS = {(Cause.LATE, 0): [-2.0, 0.5, 1.0], (Cause.DARK, None): [0.1, 0.2]}


def make(samples=SAMPLES, recordings=("b" * 64, "a" * 64), kind=RIG.kind, statistics=STATISTICS, strengths=STRENGTHS):
    return make_calibration(kind, PROCEDURE, clean_frames(samples, recordings, statistics, strengths))


def columns(calibration):
    """Everything in it, comparable: NaN is like NaN."""
    return [
        (
            one.recording_id,
            one.stamps_ns.tolist(),
            {k: repr(v.tolist()) for k, v in {**one.errors, **one.statistics, **one.strengths}.items()},
        )
        for one in calibration.clean
    ]


def test_a_calibration_comes_back_exactly_from_a_file_anywhere(tmp_path):
    calibration = make()
    write_calibration(calibration, tmp_path / "fleet.thresholds")
    again = read_calibration(tmp_path / "fleet.thresholds")
    assert columns(again) == columns(calibration)
    assert (again.rig_kind, again.procedure) == (calibration.rig_kind, calibration.procedure)
    assert again.calibrated_at == calibration.calibrated_at
    assert again.recordings == ("a" * 64, "b" * 64)
    assert again.samples[Statistic.GATED, RIG.triples[0]] == tuple(sorted(SAMPLES[Statistic.GATED, RIG.triples[0]]))


def test_of_many_recordings_few_are_in_memory_and_row_groups_may_end_within_one(tmp_path, monkeypatch):
    monkeypatch.setattr(model, "MOST_FRAMES_KEPT", 2)
    monkeypatch.setattr(tables, "BATCH_ROWS", 70)
    monkeypatch.setattr(tables, "GROUP_BYTES", 1)
    calibration = make(recordings=tuple(letter * 64 for letter in "ebdac"))
    write_calibration(calibration, tmp_path / "c")
    assert pq.ParquetFile(tmp_path / "c").num_row_groups > len(calibration.clean)
    again = read_calibration(tmp_path / "c")
    assert columns(again) == columns(calibration)
    assert columns(again) == columns(calibration)
    [kept] = {one._kept for one in again.clean}
    assert sum(known.frames for known in kept._frames.values()) <= 2 < sum(one.frames for one in again.clean)
    assert read_calibration(tmp_path / "c").recordings == calibration.recordings


def test_a_calibration_is_read_and_hashed_again_only_once_its_file_changes(tmp_path, monkeypatch):
    hashed, content_of = [], calibrations.content_of
    monkeypatch.setattr(calibrations, "content_of", lambda clean: hashed.append(clean) or content_of(clean))
    write_calibration(make(), tmp_path / "c")
    hashed.clear()
    first = read_calibration(tmp_path / "c")
    assert read_calibration(tmp_path / "c") is first
    assert len(hashed) == len(first.clean)
    other = make(recordings=("c" * 64, "d" * 64))
    write_calibration(other, tmp_path / "c")
    assert read_calibration(tmp_path / "c").calibration_id == other.calibration_id
    with ThreadPoolExecutor(1) as thread:
        assert thread.submit(read_calibration, tmp_path / "c").result() is not read_calibration(tmp_path / "c")


def test_what_all_rows_have_and_is_long_stands_in_the_first_alone(tmp_path):
    """Else a calibration of many recordings names all of them in each row, and each has its stamps a hundred times."""
    store = new_store(tmp_path)
    store.write_calibration(make())
    sql = "SELECT count(recordings) AS lists, count(stamps_ns) AS stamps FROM stored_calibrations"
    assert run_sql(store, sql).to_pylist() == [{"lists": 1, "stamps": 2}]
    named = run_sql(store, "SELECT DISTINCT recordings FROM calibrations").to_pylist()
    assert named == [{"recordings": ["a" * 64, "b" * 64]}]
    assert store.calibration_recordings() == {store.ids("calibrations")[0]: ("a" * 64, "b" * 64)}


def test_what_serves_other_rigs_comes_back_and_is_no_sample_in_sql(tmp_path):
    """The statistics without the LiDAR are of the same checks, and the LiDAR's points in view are none."""
    check = next(one for one in rig_sensor_checks(RIG) if one.check in CAMERA_CHECKS)
    whole = clean_frames(SAMPLES, ("a" * 64,), STATISTICS, STRENGTHS)[0]
    without_lidar, returns = np.array([0.5, np.nan, 0.25]), np.array([100.0, np.nan, 300.0])
    clean = replace(whole, unmasked={check: without_lidar}, returns=returns)
    store = new_store(tmp_path)
    store.write_calibration(make_calibration(RIG.kind, PROCEDURE, [clean]))
    [again] = store.calibrations()[0].clean
    np.testing.assert_array_equal(again.unmasked[check], without_lidar)
    np.testing.assert_array_equal(again.returns, returns)
    sql = "SELECT samples FROM calibrations WHERE sensor = {} AND others = {} AND statistic = '{}'"
    rows = run_sql(store, sql.format(check.sensor, list(check.others), check.check.value)).to_pylist()
    assert [row["samples"] for row in rows] == [[0.1, 0.2, 0.3]]
    kinds = {row["statistic"] for row in run_sql(store, "SELECT DISTINCT statistic FROM calibrations").to_pylist()}
    assert not kinds & {"returns", f"{check.check.value}_unmasked"}
    assert make_calibration(RIG.kind, PROCEDURE, [whole]).calibration_id != store.ids("calibrations")[0]


def test_a_store_keeps_calibrations_by_their_ids(tmp_path):
    store, one, two = new_store(tmp_path), make(), make(recordings=("c" * 64,))
    store.write_calibration(one)
    store.write_calibration(two)
    assert columns(store.calibration(one.calibration_id)) == columns(one)
    assert {calibration.calibration_id for calibration in store.calibrations()} == {
        one.calibration_id,
        two.calibration_id,
    }


def test_equal_content_has_equal_ids_and_any_change_another(tmp_path):
    clean = clean_frames(SAMPLES, ("b" * 64, "a" * 64), STATISTICS, STRENGTHS)
    assert make().calibration_id == make_calibration(RIG.kind, PROCEDURE, reversed(clean)).calibration_id
    first = next(iter(SAMPLES))
    changed = {**SAMPLES, first: [*SAMPLES[first][:-1], SAMPLES[first][-1] + 2**-50]}
    louder = {check: [*values[:-1], 0.2] for check, values in STATISTICS.items()}
    others = [
        make(changed),
        make(recordings=("a" * 64,)),
        make(kind=make_rig(4, focal_px=701.0).kind),
        make(statistics=louder),
        make(statistics={}),
        make(strengths={(Cause.LATE, 0): [-2.0, 0.5, 1.0]}),
    ]
    assert len({make().calibration_id, *(other.calibration_id for other in others)}) == 7


def test_a_triple_without_samples_is_kept_as_one(tmp_path):
    calibration = make({**SAMPLES, (Statistic.PLAIN, RIG.triples[0]): []})
    write_calibration(calibration, tmp_path / "c")
    assert read_calibration(tmp_path / "c").samples[Statistic.PLAIN, RIG.triples[0]] == ()


def test_an_id_that_is_not_its_contents_is_not_written(tmp_path):
    with pytest.raises(StoreError, match="not that of its content"):
        write_calibration(replace(make(), calibration_id="a" * 32), tmp_path / "c")
    assert not (tmp_path / "c").exists()


def test_a_calibration_that_was_changed_is_refused(tmp_path):
    write_calibration(make(), tmp_path / "c")
    rows = pq.read_table(tmp_path / "c").to_pylist()
    rows[3]["clean"] = [*rows[3]["clean"][:-1], 0.9]
    write_rows("calibrations", tmp_path / "c", rows)
    with pytest.raises(ThresholdsError, match="was changed"):
        read_calibration(tmp_path / "c")


def test_a_file_that_is_no_calibration_is_refused(tmp_path):
    (tmp_path / "text").write_text("theta = 0.3")
    write_rows("labels", tmp_path / "labels", [])
    write_rows("calibrations", tmp_path / "empty", [])
    for name in ("text", "labels", "empty", "nowhere"):
        with pytest.raises(ThresholdsError) as caught:
            read_calibration(tmp_path / name)
        assert name in caught.value.where
        assert "auditor calibrate" in caught.value.remedy


def test_a_calibration_of_a_newer_version_is_refused(tmp_path):
    schema = table_schema("calibrations").arrow.with_metadata({b"schema_version": b"99"})
    pq.write_table(schema.empty_table(), tmp_path / "c")
    with pytest.raises(ThresholdsError, match="schema version 99"):
        read_calibration(tmp_path / "c")


def test_an_older_file_without_a_column_reads_as_null(tmp_path):
    write_calibration(make(), tmp_path / "c")
    pq.write_table(pq.read_table(tmp_path / "c").drop_columns(["calibrated_at"]), tmp_path / "old")
    again = read_calibration(tmp_path / "old")
    assert again.calibrated_at is None
    assert columns(again) == columns(make())


def test_one_of_measurements_that_were_counted_otherwise_is_refused_and_does_not_bar_the_store(tmp_path):
    store, earlier = new_store(tmp_path), replace(PROCEDURE, counting_version=PROCEDURE.counting_version - 1)
    store.write_calibration(make_calibration(RIG.kind, earlier, clean_frames(SAMPLES, strengths=STRENGTHS)))
    assert store.calibrations() == []
    with pytest.raises(OutdatedCalibrationError, match=r"earlier way of counting.*calibrate --measure-again"):
        store.calibration(store.ids("calibrations")[0])
