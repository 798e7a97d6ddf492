"""A check of a store finds what is missing, torn, of another version, inconsistent or foreign, one line each."""

from datetime import UTC, datetime

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from auditor.store import RecordingRecord
from auditor.store.maintenance.check import check
from auditor.store.records import GivenLabel
from auditor.store.schema import SCHEMA_VERSION
from tests.making.stores import add_judgement, add_measurement, make_measurement, make_rig, new_store

RIG = make_rig(3)


@pytest.fixture
def store(tmp_path):
    """A recording, measured, judged and labelled by a person."""
    store = new_store(tmp_path)
    measurement = add_measurement(store, RIG, [make_measurement(RIG, number) for number in range(4)])
    add_judgement(store, RIG, measurement, "cc2c")
    [recording] = store.ids("recordings")
    store.write_given_labels(recording, [GivenLabel(datetime(2026, 1, 31, tzinfo=UTC))])
    return store


def problems(store):
    return [line for line in check(store) if "calibration_id" not in line]  # no calibration was made for this store


def rewrite(path, change):
    table = pq.read_table(path)
    pq.write_table(change(table).replace_schema_metadata(table.schema.metadata), path)


def with_column(name, value):
    def change(table):
        place = table.schema.get_field_index(name)
        return table.set_column(
            place, table.schema.field(name), pa.array([value] * len(table), table.schema.field(name).type)
        )

    return change


def test_a_whole_store_has_no_problem(store):
    assert problems(store) == []
    assert len(list(check(store))) == 1  # the calibration that the judgement names


@pytest.mark.parametrize(
    ("table", "damage", "found"),
    [
        ("frames", lambda path: path.unlink(), "it is missing"),
        ("verdicts", lambda path: path.unlink(), "it is missing"),
        ("frames", lambda path: path.write_bytes(path.read_bytes()[:-9]), "no readable Parquet file"),
        (
            "frames",
            lambda path: rewrite(path, lambda table: table.slice(1)),
            "counts 4 rows of frames, and there are 3",
        ),
        (
            "verdicts",
            lambda path: rewrite(path, lambda table: table.slice(2)),
            "counts 4 rows of verdicts, and there are 2",
        ),
        (
            "frames",
            lambda path: rewrite(path, with_column("measurement_id", "f" * 32)),
            "it has rows of measurement_id",
        ),
        (
            "given_labels",
            lambda path: rewrite(path, with_column("recording_id", "f" * 64)),
            "there is no recording_id ffff",
        ),
        ("recordings", lambda path: path.unlink(), "there is no recording_id"),
        ("rigs", lambda path: path.unlink(), "there is no rig_id"),
        ("measurements", lambda path: path.unlink(), "there is no measurement_id"),
        (
            "cells",
            lambda path: pq.write_table(
                pq.read_table(path).replace_schema_metadata({b"schema_version": str(SCHEMA_VERSION - 1).encode()}), path
            ),
            "schema version",
        ),
    ],
)
def test_each_damage_is_found(store, table, damage, found):
    [row_id] = store.ids(table)
    damage(store.path(table, row_id))
    assert any(found in line for line in problems(store)), problems(store)


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("notes.txt", "it is not of a store"),
        ("frames/notes.txt", "it is not of a store"),
        ("frames/.aa.parquet.0123456789abcdef.part", "killed"),
        (f"frames/{'e' * 32}.parquet", "killed"),
        (f"pictures/{'e' * 32}/0_S1.jpg", "killed"),
        (".upgraded/x", "killed"),
    ],
)
def test_what_does_not_belong_there_is_found(store, name, found):
    path = store.folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"x")
    [line] = problems(store)
    assert line.startswith(name.split("/0_S1")[0].split("/x")[0])
    assert found in line


def test_a_check_changes_nothing_and_goes_on_behind_a_problem(store):
    store.write_recording(RecordingRecord("b" * 64, "b.mcap", "/b.mcap"))
    for path in store.finished_paths("recordings"):
        path.write_bytes(b"")
    before = {path: path.stat().st_mtime_ns for path in store.folder.rglob("*")}
    assert sum("no readable Parquet file" in line for line in problems(store)) == 2
    assert {path: path.stat().st_mtime_ns for path in store.folder.rglob("*")} == before
