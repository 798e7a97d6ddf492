import hashlib
import json
import os
import signal
import subprocess
import sys
from dataclasses import replace
from datetime import UTC, date, datetime
from decimal import Decimal
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from auditor.errors import StoreError
from auditor.identification.paper import judge_frames
from auditor.model.checks import Check, CountedPair, rig_sensor_checks
from auditor.model.frames import Presence, SensorState, TopicBalance
from auditor.model.measurement import Cells, Counts, Coverage, Measurement, Statistic
from auditor.model.pictures import Picture
from auditor.model.verdict import AttackLabel, Verdict, VerdictKind
from auditor.store import files
from auditor.store.queries import run_query, run_sql
from auditor.store.records import JudgementRecord, MeasurementRecord, RecordingRecord, Sighting
from auditor.store.schema import SCHEMA_VERSION
from auditor.store.store import Store
from auditor.store.tables import BATCH_ROWS, ROW_GROUP_BATCHES, read_rows, write_rows
from tests.making.stores import (
    NOON,
    PERIOD_NS,
    PROCEDURE,
    RULES,
    add_frames,
    add_judgement,
    add_measurement,
    make_measurement,
    make_rig,
    make_thresholds,
    new_store,
    skip,
)


def digests(folder):
    return {str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() for p in folder.rglob("*.parquet")}


# Opening


def test_a_store_is_made_where_there_is_nothing(tmp_path):
    Store.open(tmp_path / "deep" / "audit", create=True)
    assert Store.open(tmp_path / "deep" / "audit").ids("measurements") == []


def test_a_store_is_not_made_unasked(tmp_path):
    with pytest.raises(StoreError, match="no store"):
        Store.open(tmp_path / "audit")
    assert not (tmp_path / "audit").exists()


def test_a_folder_that_holds_something_else_is_refused(tmp_path):
    (tmp_path / "holiday.jpg").write_bytes(b"")
    with pytest.raises(StoreError, match=r"no store.*holiday\.jpg"):
        Store.open(tmp_path, create=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["holiday.jpg"]


def test_a_file_is_refused(tmp_path):
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(StoreError, match="a file, not a store"):
        Store.open(tmp_path / "file", create=True)


@pytest.mark.parametrize("content", ["", "[]", '{"format": "other"}', '{"format": "auditor store"}', "\udcff"])
def test_a_marker_that_is_none_is_refused(tmp_path, content):
    (tmp_path / "store.json").write_text(content, errors="surrogateescape")
    with pytest.raises(StoreError):
        Store.open(tmp_path)


def test_a_store_of_a_newer_version_is_refused(tmp_path):
    newer = SCHEMA_VERSION + 1
    (tmp_path / "store.json").write_text(json.dumps({"format": "auditor store", "schema_version": newer}))
    with pytest.raises(StoreError, match=f"schema version {newer}, and this auditor knows {SCHEMA_VERSION}"):
        Store.open(tmp_path)


def test_making_a_store_that_was_interrupted_is_done_again(tmp_path):
    (tmp_path / (".store.json." + "0" * 16 + ".part")).write_bytes(b"{")
    Store.open(tmp_path, create=True)


# Round trips


def test_a_recording_comes_back(tmp_path):
    store = new_store(tmp_path)
    recording = RecordingRecord(
        "a" * 64,
        "x\0<b>.mcap",
        "/logs/x",
        files=("a", "b"),
        size_bytes=5,
        format="mcap",
        clock="utc",
        from_ns=1,
        to_ns=2**62,
        vehicle="v1",
        date=date(2026, 1, 2),
        drive="d",
        damage=("chunk 3 is cut",),
        sightings=(Sighting("x\0<b>.mcap", "/logs/y", NOON), Sighting("z", "/logs/x", NOON)),
        superseded_by="b" * 64,
        conflicts=("c" * 64,),
    )
    store.write_recording(recording)
    other = RecordingRecord("b" * 64, "y", "/y", sightings=(Sighting("y", "/y"),), conflicts=())
    store.write_recording(other)
    assert store.recordings() == [recording, other]
    assert recording.other_names == ("z",)
    assert store.recording("a" * 64) == recording


@pytest.mark.parametrize("lidar", [True, False])
def test_a_rig_comes_back_exactly_with_its_triples_in_order(tmp_path, lidar):
    store, rig = new_store(tmp_path), make_rig(4, lidar=lidar)
    store.write_rig(rig)
    assert store.rig(rig.rig_id).to_dict() == rig.to_dict()
    rows = run_sql(store, "SELECT i, j, k, baseline_m, fallback FROM triples ORDER BY position").to_pylist()
    triples = rig.measured_triples
    assert [(row["i"], row["j"], row["k"]) for row in rows] == list(triples)
    assert [row["baseline_m"] for row in rows] == [rig.baseline_m(triple.j, triple.k) for triple in triples]
    assert [row["fallback"] for row in rows] == [triple == rig.fallback for triple in triples]
    assert any(row["fallback"] for row in rows) == lidar
    of_e = run_sql(store, "SELECT i, j, k FROM paper_triples ORDER BY position").to_pylist()
    assert [(row["i"], row["j"], row["k"]) for row in of_e] == list(rig.triples)


def test_frames_come_back_as_disparity_errors_in_double_precision(tmp_path):
    store, rig = new_store(tmp_path), make_rig(3)
    counts = (Counts(300, 7, 299, 11, 0), Counts(199, 0, 200, 3, 0), None, Counts(400, 9, 300, 5, 0))
    presence = {s: Presence(SensorState.DAMAGED if s == 2 else SensorState.PRESENT, 5) for s in rig.sensors}
    frame = Measurement(3, 17, presence, counts, {1: Coverage(saturated_share=0.1)})
    measurement_id = add_measurement(store, rig, [skip(2), frame])
    for statistic in Statistic:
        errors = store.load_errors(measurement_id, statistic)
        expected = [c.disparity_error(statistic) if c else None for c in counts]
        assert [None if np.isnan(E) else E for E in errors.E[0]] == expected
        assert errors.frames.tolist() == [3]
        assert errors.stamps_ns.tolist() == [17]
        assert errors.states.tolist() == [["present", "present", "damaged", "present"]]
        column = {Statistic.PLAIN: "E_plain", Statistic.GATED: "E_gated"}[statistic]
        seen = run_sql(store, f"SELECT {column} FROM errors ORDER BY position").column(0).to_pylist()
        assert seen == expected


def test_frames_come_back_as_statistics_and_fingerprints(tmp_path):
    store, rig = new_store(tmp_path), make_rig(3)
    given = [0.1, None, 1 / 3]
    frames = [skip(0), make_measurement(rig, 1, statistics=given), make_measurement(rig, 2, missing=(2,))]
    measurement_id = add_measurement(store, rig, frames)
    found = store.load_statistics(measurement_id)
    checks = rig_sensor_checks(rig)
    assert found.statistics.shape == (2, len(checks))
    rest = [None] * (len(checks) - 3)
    assert [None if np.isnan(x) else x for x in found.statistics[0]] == [*given, *rest]
    assert np.isnan(found.statistics[1]).all()
    assert found.returns.tolist() == [1001, 1002]
    assert (found.frames.tolist(), found.stamps_ns.tolist()) == ([1, 2], [PERIOD_NS, 2 * PERIOD_NS])
    assert found.states.tolist()[1] == ["present", "present", "missing", "present"]
    assert found.fingerprints.tolist() == [[10, 11, 12, 13], [20, 21, -1, 23]]
    sql = "SELECT check_name, sensor, others, statistic FROM statistics WHERE frame = 1 ORDER BY position"
    seen = run_sql(store, sql).to_pylist()
    assert [(row["check_name"], row["sensor"], tuple(row["others"])) for row in seen] == [*checks]
    assert [row["statistic"] for row in seen] == [*given, *rest]


def test_statistics_without_the_lidar_are_the_usual_ones_where_nothing_else_was_kept(tmp_path):
    store, rig = new_store(tmp_path), make_rig(3)
    checks = rig_sensor_checks(rig)
    usual, last = [0.5] * len(checks), [None] * (len(checks) - 1)
    record = MeasurementRecord("a" * 64, rig.rig_id, PROCEDURE, (), {}, NOON, 1.0)
    known = record.measurement_id
    store.write_rig(rig)
    with store.frames_writer(known, rig) as writer:
        writer.add(make_measurement(rig, 0), usual, [*last, 0.25])
        writer.add(make_measurement(rig, 1), usual)
        writer.commit(record)
    found = store.load_statistics(known)
    assert found.unmasked.tolist() == [[*usual[:-1], 0.25], usual]


def test_cells_come_back_by_what_they_count_without_reading_the_file_at_once(tmp_path):
    store, rig = new_store(tmp_path), make_rig(3)
    pairs = [
        CountedPair(Check.LIDAR_CONFLICT, 1, 3, 0),
        CountedPair(Check.ADDED_LIGHT, 1, 3, 1),
        CountedPair(Check.ADDED_LIGHT, 1, 3, 3),
        CountedPair(Check.PHOTOMETRIC_INCONSISTENCY, 2, 3, 2),
    ]
    rng = np.random.default_rng(4)

    def frame(number, chosen):
        valid = rng.integers(0, 128, (len(chosen), 5, 7)).astype(np.uint8)
        total = rng.integers(-127, 128, (len(chosen), 5, 7)).astype(np.int8)
        cells = {counted: Cells(*grids) for counted, *grids in zip(chosen, valid, total, strict=True)}
        return replace(make_measurement(rig, number), cells=cells)

    given = [
        frame(1, pairs),
        frame(2, ()),
        frame(3, pairs[1:2]),
        *(frame(n, pairs) for n in range(4, 90)),
    ]
    measurement_id = add_measurement(store, rig, [skip(0), *given])
    found = list(store.load_cells(measurement_id))
    assert [number for number, _ in found] == [f.number for f in given if f.cells]
    for (_, cells), original in zip(found, (f for f in given if f.cells), strict=True):
        assert list(cells) == list(original.cells)
        for counted, grids in cells.items():
            assert np.array_equal(grids.valid, original.cells[counted].valid)
            assert np.array_equal(grids.total, original.cells[counted].total)
    with pq.ParquetFile(store.path("cells", measurement_id)) as file:
        assert file.num_row_groups == 2
    sql = "SELECT check_name, i, k, sensor, rows, columns, valid, total FROM cells WHERE frame = 3"
    [row] = run_sql(store, sql).to_pylist()
    grids = given[2].cells[pairs[1]]
    assert (row["check_name"], row["i"], row["k"], row["sensor"]) == pairs[1]
    assert np.array_equal(np.reshape(row["valid"], (row["rows"], row["columns"])), grids.valid)
    assert np.array_equal(np.reshape(row["total"], (row["rows"], row["columns"])), grids.total)


def test_a_measurement_without_a_single_frame_can_be_finished(tmp_path):
    store, rig = new_store(tmp_path), make_rig(3)
    measurement_id = add_measurement(store, rig, [])
    assert store.load_errors(measurement_id, Statistic.PLAIN).E.shape == (0, 4)
    assert store.load_statistics(measurement_id).statistics.shape == (0, len(rig_sensor_checks(rig)))
    assert store.measurement(measurement_id).frames == 0


def test_a_measurement_comes_back_with_its_mass_balance_and_counts(tmp_path):
    store, rig = new_store(tmp_path), make_rig(3)
    balance = (
        TopicBalance("/velo", "PointCloud2", 0, read=9, used=5, unused=1, damaged=1, skipped={"late": 1, "edge": 1}),
        TopicBalance("/imu", "Imu", None, read=4, unused=3),
    )
    frames = [skip(0, "edge", None), make_measurement(rig, 1), skip(2), skip(3)]
    measurement_id = add_measurement(store, rig, frames, balance=balance, versions={"cv2": "5"}, damage=("cut",))
    measurement = store.measurement(measurement_id)
    assert store.measurements() == [measurement]
    assert (measurement.frames, measurement.measured) == (4, 1)
    assert measurement.skipped == {"edge": 1, "no LiDAR": 2}
    assert measurement.balance == balance
    assert measurement.procedure == PROCEDURE
    assert (measurement.damage, measurement.versions, measurement.measured_at) == (("cut",), {"cv2": "5"}, NOON)
    rows = run_sql(store, "SELECT topic, adds_up FROM balance ORDER BY topic").to_pylist()
    assert rows == [{"topic": "/imu", "adds_up": False}, {"topic": "/velo", "adds_up": True}]


def test_labels_find_their_sensor_by_its_topic(tmp_path):
    store, rig = new_store(tmp_path), make_rig(3)
    labels = [AttackLabel("/cam2", "facula", 5, 9, {"A": 510}), AttackLabel("/imu", "spoof", 0, 1, {})]
    store.write_labels("a" * 64, labels, rig)
    assert store.labels("a" * 64) == labels
    rows = run_sql(store, "SELECT topic, sensor, parameters FROM labels ORDER BY topic").to_pylist()
    assert rows == [
        {"topic": "/cam2", "sensor": 2, "parameters": '{"A": 510}'},
        {"topic": "/imu", "sensor": None, "parameters": "{}"},
    ]


def test_a_judgement_comes_back_and_the_latest_is_the_current_one(tmp_path):
    store, rig = new_store(tmp_path), make_rig(3)
    measurement_id = add_measurement(store, rig, [make_measurement(rig, f) for f in range(4)])
    assert store.current_judgements() == {}
    first = add_judgement(store, rig, measurement_id, "cc1n", r="0.01", resolvable=False)
    second = add_judgement(store, rig, measurement_id, "cc22", minutes=1)
    assert [judgement.judgement_id for judgement in store.judgements()] == [first, second]
    stored = store.judgements()[0]
    assert (stored.r, stored.resolvable, stored.transferred) == (Decimal("0.01"), False, False)
    assert {kind.value: n for kind, n in stored.counts.items() if n} == {"clean": 2, "attacked": 1, "not_auditable": 1}
    assert run_sql(store, "SELECT count(*) AS n FROM verdicts WHERE attacked = [2]").to_pylist() == [{"n": 2}]
    again = add_judgement(store, rig, measurement_id, "cc1n", minutes=2, r="0.010", resolvable=False)
    assert again == first
    assert store.current_judgements()[measurement_id].judgement_id == first
    assert run_sql(store, "SELECT count(*) AS n FROM verdicts WHERE attacked = [1]").to_pylist() == [{"n": 1}]


def test_r_keeps_every_digit_and_too_many_are_refused(tmp_path):
    store, rig = new_store(tmp_path), make_rig(3)
    measurement_id = add_measurement(store, rig, [])
    add_judgement(store, rig, measurement_id, "", r="0.00000000000000001")
    assert store.current_judgements()[measurement_id].r == Decimal("1E-17")
    with pytest.raises(StoreError, match="more than 17 decimals"):
        add_judgement(store, rig, measurement_id, "", r="0.000000000000000001")
    assert len(store.judgements()) == 1


def test_an_answer_without_a_name_differs_from_nobody_named(tmp_path):
    store, rig = new_store(tmp_path), make_rig(3)
    measurement_id = add_measurement(store, rig, [make_measurement(rig, f) for f in range(2)])
    verdicts = [
        (0, 0, Verdict(VerdictKind.UNIDENTIFIED, "1--", named=None, out_of_system=(2,))),
        (1, 1, Verdict(VerdictKind.CLEAN, "000", named=())),
    ]
    store.write_judgement(JudgementRecord(measurement_id, "m", make_thresholds(rig), RULES, NOON), verdicts)
    rows = run_sql(store, "SELECT named, out_of_system, gap, reason FROM verdicts ORDER BY frame").to_pylist()
    assert rows == [
        {"named": None, "out_of_system": [2], "gap": None, "reason": None},
        {"named": [], "out_of_system": [], "gap": None, "reason": None},
    ]


def test_pictures_come_back(tmp_path):
    store = new_store(tmp_path)
    first = Picture(7, 3, {1: b"right", 3: b"left"}, b"mask")
    store.write_picture("a" * 32, first)
    store.write_picture("a" * 32, Picture(12, 2, {2: b"only"}, b"mask"))
    assert store.picture("a" * 32, 7) == first
    assert store.picture("a" * 32, 8) is None
    assert store.pictured_frames("a" * 32) == [7, 12]


def test_ids_follow_from_what_they_stand_for():
    def record(**changes):
        settings = {"procedure": PROCEDURE, "balance": (), "versions": {}, "measured_at": NOON, "seconds": 1.0}
        return MeasurementRecord("a" * 64, "b" * 64, **{**settings, **changes}).measurement_id

    assert record() == record(seconds=2.0, versions={"cv2": "6"}, measured_at=datetime.now(UTC))
    other = type(PROCEDURE)(PROCEDURE.matcher, PROCEDURE.settings, PROCEDURE.counting_version + 1)
    assert record() != record(procedure=other)


# Whole files


def test_writing_again_gives_the_same_bytes(tmp_path):
    rig = make_rig(3)
    stores = [new_store(tmp_path / name) for name in ("one", "two")]
    for minutes, store in enumerate(stores):
        frames = [skip(0), *(make_measurement(rig, f, [f % 50, None, 3]) for f in range(1, 3000))]
        measurement_id = add_measurement(store, rig, frames, measured_at=datetime.now(UTC))
        add_judgement(store, rig, measurement_id, "c1u" * 1000, minutes=minutes)
    assert digests(stores[0].folder / "frames") == digests(stores[1].folder / "frames")
    assert digests(stores[0].folder / "verdicts") == digests(stores[1].folder / "verdicts")


def test_rows_leave_in_groups_so_that_memory_stays_bounded(tmp_path):
    store, rig = new_store(tmp_path), make_rig(3)
    group = BATCH_ROWS * ROW_GROUP_BATCHES
    frame = make_measurement(rig, 0)
    measurement_id = add_measurement(store, rig, (frame for _ in range(group + 5)))
    with pq.ParquetFile(store.path("frames", measurement_id)) as file:
        assert [file.metadata.row_group(g).num_rows for g in range(file.num_row_groups)] == [group, 5]
        column = file.metadata.row_group(0).column(0)
        assert column.compression == "ZSTD"
        assert file.schema_arrow.metadata[b"schema_version"] == str(SCHEMA_VERSION).encode()


def test_without_a_commit_there_is_no_measurement(tmp_path):
    store, rig = new_store(tmp_path), make_rig(3)
    with store.frames_writer("a" * 32, rig) as writer:
        for number in range(2 * BATCH_ROWS * ROW_GROUP_BATCHES):
            writer.skip(skip(number))
    assert not store.has_measurement("a" * 32)
    assert digests(store.folder) == {}
    assert list(store.folder.rglob("*.part")) == []


def test_an_interrupted_measurement_leaves_the_finished_one_as_it_was(tmp_path):
    store, rig = new_store(tmp_path), make_rig(3)
    add_measurement(store, rig, [make_measurement(rig, 0)])
    before = digests(store.folder)

    def interrupted():
        yield make_measurement(rig, 1)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        add_measurement(store, rig, interrupted())
    assert digests(store.folder) == before


def test_a_frame_that_does_not_fit_its_rig_is_refused(tmp_path):
    store = new_store(tmp_path)
    with store.frames_writer("a" * 32, make_rig(3)) as writer, pytest.raises(StoreError, match="does not fit its rig"):
        writer.add(make_measurement(make_rig(4), 0), [])


def test_a_record_of_another_measurement_is_refused(tmp_path):
    store, rig = new_store(tmp_path), make_rig(3)
    record = MeasurementRecord("a" * 64, rig.rig_id, PROCEDURE, (), {}, NOON, 1.0)
    with store.frames_writer("a" * 32, rig) as writer, pytest.raises(StoreError, match="of measurement"):
        writer.commit(record)
    assert digests(store.folder) == {}


@pytest.mark.parametrize(
    ("rows", "table"), [(3, "frames"), (3, "cells"), (BATCH_ROWS * ROW_GROUP_BATCHES + 3, "frames")]
)
def test_a_full_disk_is_told_and_leaves_finished_tables_whole(tmp_path, monkeypatch, rows, table):
    store, rig, full_disk = new_store(tmp_path), make_rig(3), Path("/dev/full")
    add_measurement(store, rig, [make_measurement(rig, 0)])
    before = digests(store.folder)
    monkeypatch.setattr(
        files, "open_part", lambda path: full_disk.open("wb") if table in path.parts else path.open("xb")
    )
    full = (make_measurement(rig, number) for number in range(rows))
    with pytest.raises(StoreError, match="No space left on device"):
        add_frames(store, rig, "b" * 64, full)
    monkeypatch.undo()
    assert digests(store.folder).items() >= before.items()
    assert len(store.ids("measurements")) == 1
    assert run_query(store, "summary").num_rows == 1


def test_a_torn_file_is_told_by_its_name(tmp_path):
    store, rig = new_store(tmp_path), make_rig(3)
    measurement_id = add_measurement(store, rig, [make_measurement(rig, 0)])
    path = store.path("frames", measurement_id)
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(StoreError, match=measurement_id):
        store.load_errors(measurement_id, Statistic.PLAIN)
    with pytest.raises(StoreError, match=measurement_id):
        run_query(store, "skipped")


def test_a_missing_finished_file_is_told_by_its_name(tmp_path):
    store, rig = new_store(tmp_path), make_rig(3)
    measurement_id = add_measurement(store, rig, [make_measurement(rig, 0)])
    store.path("frames", measurement_id).unlink()
    with pytest.raises(StoreError, match=measurement_id):
        run_query(store, "skipped")


def test_files_that_no_manifest_names_are_not_read(tmp_path):
    store, rig = new_store(tmp_path), make_rig(3)
    add_measurement(store, rig, [make_measurement(rig, 0), skip(1)])
    store.path("frames", "f" * 32).write_bytes(b"torn")
    (store.folder / "verdicts").mkdir()
    store.path("verdicts", "f" * 32).write_bytes(b"torn")
    (store.folder / "frames" / ("." + "e" * 32 + ".parquet." + "0" * 16 + ".part")).write_bytes(b"torn")
    assert run_query(store, "skipped").column("ticks").to_pylist() == [1]
    assert run_query(store, "incidents").num_rows == 0


KILLED = """
import os, signal, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from auditor.store import store, tables
from tests.making.stores import *
tables.ROW_GROUP_BATCHES = 4
point, rows = sys.argv[3], 1_000
die = lambda: os.kill(os.getpid(), signal.SIGKILL)

def frames(rig):
    for number in range(rows):
        if point == f"frame {number}":
            die()
        yield make_measurement(rig, number, [number % 90, None, 5])

def write_rows(table, path, content, announce, write=store.write_rows):
    if point == f"before {table}":
        die()
    write(table, path, content, announce)

store.write_rows = write_rows
rig = make_rig(3)
store = new_store(Path(sys.argv[2]))
if store.ids("measurements"):
    measurement_id, = store.ids("measurements")
else:
    measurement_id = add_measurement(store, rig, frames(rig))
add_judgement(store, rig, measurement_id, "c12u" * (rows // 4))
"""


def run_killed(folder, point):
    root = Path(__file__).parents[2]
    command = [sys.executable, "-c", KILLED, str(root), str(folder), point]
    return subprocess.run(command, check=False, capture_output=True, text=True, timeout=300)


def test_a_killed_scan_leaves_a_store_that_the_next_one_completes_to_the_same_bytes(tmp_path):
    undisturbed = run_killed(tmp_path / "undisturbed", "never")
    assert undisturbed.returncode == 0, undisturbed.stderr
    killed = tmp_path / "killed"
    for point in ("frame 900", "before judgements"):
        assert run_killed(killed, point).returncode == -signal.SIGKILL, point
        store = Store.open(killed / "audit")
        assert run_query(store, "summary").num_rows == (1 if store.ids("recordings") else 0)
        assert run_query(store, "incidents").num_rows == 0
        assert (len(store.ids("measurements")) == 1) == (point == "before judgements")
    leftovers = [path for path in killed.rglob("*.part") if os.utime(path, (0, 0)) is None]
    assert leftovers
    last = run_killed(killed, "never")
    assert last.returncode == 0, last.stderr
    assert list(killed.rglob("*.part")) == []
    for table in ("frames", "cells", "verdicts", "triples", "sensor_checks", "rigs"):
        assert digests(killed / "audit" / table) == digests(tmp_path / "undisturbed" / "audit" / table)


def test_lists_of_before_there_was_a_fallback_are_read_with_nothing_measured_for_it(tmp_path):
    store, rig = new_store(tmp_path), make_rig(3)
    known = add_measurement(store, rig, [make_measurement(rig, f, [10, 20, 30, 40]) for f in range(3)])
    path, T = store.path("frames", known), len(rig.triples)
    rows = list(read_rows("frames", path))
    for row in rows:
        row |= {name: row[name][:T] for name in row if name.endswith("_px")}
    write_rows("frames", path, rows)
    errors = store.load_errors(known, Statistic.GATED)
    np.testing.assert_array_equal(errors.E, [[0.01, 0.02, 0.03, np.nan]] * 3)
    [last] = run_sql(store, "SELECT E_gated, fallback FROM errors WHERE frame = 0 AND position = 4").to_pylist()
    assert last == {"E_gated": None, "fallback": True}


def test_the_fallback_has_a_state_in_sql_where_a_frame_was_judged_by_it(tmp_path):
    store, rig = new_store(tmp_path), make_rig(3)
    rows = [[10, 20, 30, 900], [None, None, None, 900], [None, None, 10, 900], [None, None, None, 10]]
    known = add_measurement(store, rig, [make_measurement(rig, f, row) for f, row in enumerate(rows)])
    thresholds = replace(make_thresholds(rig), theta=dict.fromkeys(rig.measured_triples, 0.1))
    errors = store.load_errors(known, Statistic.GATED)
    found = judge_frames(errors.E, thresholds, rig.triples, rig.sensors, [frozenset()] * 4, rig.fallback)
    record = JudgementRecord(known, "paper", thresholds, RULES, NOON)
    store.write_judgement(record, [(f, f * PERIOD_NS, verdict) for f, verdict in enumerate(found)])
    sql = "SELECT frame, string_agg(e, '' ORDER BY position) AS e FROM errors GROUP BY frame ORDER BY frame"
    states = [row["e"] for row in run_sql(store, sql).to_pylist()]
    assert states == [verdict.e for verdict in found] == ["000", "---1", "--0", "---0"]
